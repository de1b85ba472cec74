"""What a standard law's theorem or closed form is about: of other agents, laws and starts its measures say nothing."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest

import flocking as fk
from flocking.papers.cucker_smale_2007 import hypotheses as cucker
from flocking.papers.cucker_smale_2007 import system as alignment
from flocking.papers.cucker_smale_2007 import theorems as cucker_claims
from flocking.papers.olfati_saber_2006 import system as group
from flocking.papers.olfati_saber_2006 import theorems as olfati
from flocking.papers.reynolds_1987 import system as boids
from flocking.papers.reynolds_1987 import theorems as reynolds
from flocking.papers.vicsek_1995 import system as headings
from flocking.papers.vicsek_1995 import theorems as vicsek
from flocking.study.evidence import NotMeasurable

GENTLE = group.scenarios()[group.GENTLE](0)
FOLLOWING = GENTLE.with_(law=group.law(group.Algorithm(2, (1.0, 1.0, 0.05), goal=group.goal())))
FAST = GENTLE.with_(start=fk.State(GENTLE.start.q, 100.0 * np.eye(GENTLE.start.n, 2)))
DISCRETE, LATE = alignment.discrete_group(), alignment.late_pair(0.3, duration=1.0)
TURNING = headings.scenarios()[headings.KEY](0)
HELD = group.held_network()
BIRDS = boids.scenarios()[boids.KEY](0)


def of(scenario: fk.Scenario) -> SimpleNamespace:
    """As much of the evidence of a run as these measures look at before they refuse it."""
    start = scenario.start
    return SimpleNamespace(
        run=SimpleNamespace(scenario=scenario, n=start.n), law=scenario.law, t=np.array([start.t]), q=start.q[None],
        p=start.p[None],
    )  # fmt: skip


def turning(scenario: fk.Scenario, speed: np.ndarray | float) -> fk.Scenario:
    """The scenario with agents that turn at given speeds."""
    p = np.broadcast_to(np.asarray(speed), scenario.start.n)[:, None] * [1.0, 0.0]
    start = fk.State(scenario.start.q, p)
    return scenario.with_(start=start, agents=fk.Heading(speed, masses=scenario.agents.masses))


OTHER: dict[str, tuple[Callable, fk.Scenario, str]] = {
    "too fast to be held together": (
        lambda e: cucker.alignment(e.run.scenario), alignment.parting_pair(), "do not suffice to hold this start"),
    "continuous motion": (cucker.discrete_system, DISCRETE.with_(agents=fk.PointMass()), "not set at steps"),
    "a largest speed": (cucker.discrete_system, DISCRETE.with_(agents=fk.Impulsive(speed=1.0)), "without limits"),
    "forward": (cucker.discrete_system, DISCRETE.with_(agents=fk.Impulsive(update="forward")), "without limits"),
    "other masses": (cucker.discrete_system, DISCRETE.with_(agents=fk.Impulsive(masses=2.0)), "undamped unit masses"),
    "some pairs": (cucker.discrete_system, DISCRETE.with_(law=fk.Law(fk.Proximity(1.0), DISCRETE.law.terms)),
                   "not all pairs align"),
    "a later first step": (cucker.discrete_system, DISCRETE.with_(control=fk.Held(0.1, phase=0.05)), "step together"),
    "delays of pairs": (cucker.stable_delay, LATE.with_(information=fk.Delayed([[0.3, 0.2], [0.3, 0.3]], True)),
                        "delays differ between pairs"),
    "neighbours late": (cucker.stable_delay, LATE.with_(information=fk.Delayed(0.3)), "own velocity is not known late"),
    "two masses": (cucker.stable_delay, LATE.with_(agents=fk.PointMass([1.0, 2.0])), "point masses of one mass"),
    "a damped pair": (cucker.stable_delay, LATE.with_(agents=fk.PointMass(1.0, 0.1)), "no free point masses"),
    "a fast group": (olfati.apart_by_energy, FAST, "the energy suffices for a collision"),
    "weakly damped": (
        olfati.centre_as_predicted,
        FOLLOWING.with_(law=fk.Law(FOLLOWING.law.graph, (*FOLLOWING.law.terms[:-1], fk.Track(group.goal(), 1.0, 1.9)))),
        "not critically damped"),
    "heavy agents": (olfati.moved_as_held, HELD.with_(agents=fk.PointMass(2.0)), "no undamped unit masses"),
    "damped boids": (reynolds.force_limited, BIRDS.with_(agents=fk.Impulsive(force=1.0, damping=0.1)), "damped too"),
    "several speeds": (vicsek._sets_the_average,
                       turning(TURNING, np.linspace(0.01, 0.03, TURNING.start.n)), "different speeds"),
}  # fmt: skip
"""The measure, a scenario that it is not about, and words of the reason."""


@pytest.mark.parametrize("case", OTHER)
def test_other_laws_agents_and_starts_are_not_measured(case: str) -> None:
    measure, scenario, words = OTHER[case]
    with pytest.raises(NotMeasurable, match=words):
        measure(of(scenario))


def test_of_agents_that_are_held_together_no_speed_is_left() -> None:
    """w(0) = 0.5 is less than pi/2 - arctan 1."""
    with pytest.raises(NotMeasurable, match="suffice to hold the two agents together"):
        cucker_claims._parting_speed(np.array([1.0]), np.array([0.5]))
