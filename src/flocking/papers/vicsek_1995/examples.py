"""Objects of the equation table of Vicsek et al.; each depends on a factor that is 1 for the paper."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flocking.engine.driver.simulate import simulate
from flocking.engine.reference.control import control
from flocking.model.checks import Array
from flocking.model.graphs.distance_graphs import Proximity
from flocking.model.law import Law, Scenario
from flocking.model.observables import order
from flocking.model.state import State
from flocking.model.terms.alignment import VelocityAverage
from flocking.papers import examples
from flocking.papers.vicsek_1995 import closed_forms, order_curves, system, theorems, transition
from flocking.papers.vicsek_1995.density_waves import waves_of
from flocking.papers.vicsek_1995.large_groups import HeadingGroup
from flocking.study.claims.audit import audit
from flocking.study.claims.claim import Verdict

FEW, SIDE, NOISE = 8, 2.5, 1.2
"""Agents, side and noise of the examples."""


def few(noise: float = NOISE, **changes: object) -> Scenario:
    """Eight agents on a small torus.

    Parameters
    ----------
    noise
        eta.
    changes
        Further arguments of `flocking.papers.vicsek_1995.system.group`.
    """
    return system.group(FEW, SIDE, noise, duration=2, **changes)  # type: ignore[call-overload, no-any-return]


def positions_of(scale: float) -> Array:
    """Displacements after one and two updates, the speed scaled."""
    run = simulate(few(speed=system.SPEED * scale), progress=False)
    return np.asarray(run.q[1:] - run.q[0])


def directions_of(scale: float) -> Array:
    """Mean directions of the examples' start, the second component of the velocities scaled."""
    begin, space = few().start, few().space
    return closed_forms.mean_directions(begin.q, begin.p * [1.0, scale], space)


def averages_of(scale: float) -> Array:
    """The control of the law in the example state, the gain scaled."""
    law = Law(Proximity(2.0), (VelocityAverage(scale),))
    return control(law, examples.example_state())


def turns_of(scale: float) -> Array:
    """Angles from mean directions to the headings after the first update, the noise scaled."""
    run = simulate(few(NOISE * scale), progress=False)
    return closed_forms.deviations(run.q[0], run.p[0], run.p[1], run.scenario.space)


def order_of(scale: float) -> float:
    """Order parameter of two agents whose headings differ by a scaled angle."""
    angle = 0.8 * scale
    return order(State(np.zeros((2, 2)), np.array([[1.0, 0.0], [np.cos(angle), np.sin(angle)]])))


def random_orders_of(scale: float) -> tuple[float, float, float]:
    """Moments of a hundred independent headings; the root, the mean and the variance scaled."""
    mean, square, variance = closed_forms.random_order(100)
    return mean * scale, square * scale, variance * scale


def settings_of(scale: float) -> list[tuple[int, float, float, float]]:
    """Agents, side, noise and speed of the panels of Fig. 1, sides and noises scaled."""
    found = []
    for name in system.FIGURE_1:
        shown = system.scenario(name=name)
        body = shown.agents
        noise, speed = (float(np.max(x)) for x in (getattr(body, "noise"), getattr(body, "speed")))  # noqa: B009
        found.append((shown.start.n, scale * shown.space.lengths[0], scale * noise, scale * speed))
    return found


def curve_of(scale: float) -> list[float]:
    """Mean of v_a of the group of 40 at two noises over many updates, the values scaled."""
    values = (order_curves.order_series(system.group(*system.FIGURE_2[0], noise), 3000)[500:] for noise in (2.0, 4.0))
    return [scale * float(x.mean()) for x in values]


def vectorial_of(scale: float) -> Array:
    """Velocities after the first update with vectorial noise, the noise scaled."""
    scenario = few(0.4 * scale, noise_kind="vectorial", update="forward")
    return np.asarray(simulate(scenario, progress=False).p[1])


def cumulants_of(scale: float) -> tuple[float, float]:
    """Cumulants of a series that is ordered half of the time, and of one of two values, the larger values scaled."""
    return (
        closed_forms.binder_cumulant(np.array([0.02, 0.9 * scale])),
        closed_forms.binder_cumulant(np.array([0.5, 0.5, 0.5, 0.7 * scale])),
    )


def large_of(scale: float) -> Array:
    """Unit vectors of the velocities after two updates of the compiled rule, the noise scaled."""
    group = HeadingGroup(system.group(30, 4.0, NOISE * scale, seed=3, duration=2, speed=0.5), threads=1)
    group.update(2)
    return group.state()[1]


def counts_of(scale: float) -> tuple[float, ...]:
    """Means and mean squares of numbers in boxes of two sizes, and the exponent of made-up deviations, all scaled."""
    q = np.array([[0.5, 0.5], [0.7, 0.1], [1.5, 0.5], [3.5, 3.5], [2.1, 3.9]])
    found = [x for row in transition.counted(q, 4.0, (1.0, 2.0)) for x in row]
    means = [float(10.0**k) for k in range(len(transition.SIZES))]
    made = transition.Fluctuations(1.0, 0.0, 1, 0, tuple(means), tuple(tuple(x**0.7 for x in means) for _ in range(10)))
    return tuple(scale * x for x in (*found, made.exponent[0]))


def bands_of(scale: float) -> tuple[float, ...]:
    """Strength of the strongest wave of eight agents, its angle to the mean velocity, and v_a, the side scaled."""
    start = few().start
    unit = start.p / np.linalg.norm(start.p, axis=1)[:, None]
    wave, strength, across, order_, profile, local = waves_of(start.q, unit, scale * SIDE)
    return (*map(float, wave), strength, across, order_, *profile[profile > 0.0], *local[profile > 0.0])


def judgements_of(scale: float) -> dict[str, Verdict]:
    """Verdicts about a run without noise whose velocities are declared to be scaled."""
    scenario = system.within_half_a_turn(*system.FIGURE_2[0])
    run = simulate(scenario.with_(t_end=200.0, frames=201), progress=False)
    run = replace(run, p=run.p * scale)
    return {r.claim.key: r.verdict for r in audit(run, theorems.claims(system.NOISELESS)).results}
