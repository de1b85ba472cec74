"""Symmetries of whole worlds: each that a scenario states is kept by its motion, and each that is lost is broken by it.

Runs are compared with runs from transformed starts: nothing is read from the parts that state the symmetries.
"""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

import flocking as fk

N = 4
SPEED = np.array([3.0, -2.0])
TURN = np.array([[0.6, -0.8], [0.8, 0.6]])
ORDER = np.array([2, 0, 3, 1])
KEPT = 1e-6
"""Largest difference that is numerical: tolerances are 1e-9, and unit time multiplies errors by less than a hundred."""
BROKEN = 1e-4
"""Least difference that shows a broken symmetry."""

LAW = fk.Law(fk.Fixed.complete(N), [fk.Gradient(fk.Potential("r**4/40")), fk.Consensus(1.0)])
POINTS, HELD, EACH = fk.PointMass(), fk.Held(0.1), [0.1, 0.13, 0.1, 0.1]
SAMPLED = {"control": HELD, "information": fk.Messages(0.1)}
PAIRS = 0.1 * (1.0 - np.eye(N))
UNEVEN = PAIRS + np.where(np.arange(N)[:, None] == 1, PAIRS, 0.0)
M, G, R, P = "momentum", "galilean", "rotation", "relabelling"


def messages(**fields):
    return {"control": fk.Held(0.05), "information": fk.Messages(0.1, **fields)}


WORLDS = {
    "ideal": ({}, ""),
    "damped": ({"agents": fk.PointMass(damping=0.5)}, (M, G)),
    "masses differ": ({"agents": fk.PointMass([1.0, 2.0, 0.5, 1.0])}, ""),
    "order 1": ({"agents": fk.SingleIntegrator()}, ""),
    "order 1, masses differ": ({"agents": fk.SingleIntegrator([1.0, 2.0, 0.5, 1.0])}, (M,)),
    "neighbours late": ({"information": fk.Delayed(0.1)}, (M, G)),
    "all late": ({"information": fk.Delayed(0.1, self_delayed=True)}, ""),
    "pairs late": ({"information": fk.Delayed(UNEVEN)}, (M, G, P)),
    "rows late": ({"information": fk.Delayed(np.outer([0.1, 0.2, 0.1, 0.1], np.ones(N)), self_delayed=True)}, (M, P)),
    "held": ({"control": HELD}, ""),
    "held, late": ({"control": fk.Held(0.1, latency=0.05)}, ""),
    "held, latencies differ": ({"control": fk.Held(0.1, latency=[0.0, 0.03, 0.0, 0.0])}, (M, P)),
    "held, phases differ": ({"control": fk.Held(0.1, phase=[0.0, 0.03, 0.0, 0.0])}, (M, P)),
    "held, periods differ": ({"control": fk.Held(EACH)}, (M, P)),
    "samples at every tick": (SAMPLED, ""),
    "samples between ticks": (messages(), (M, G)),
    "samples moved on": (messages(predict=True), (M,)),
    "late": (messages(delay=0.05), (M, G)),
    "all measured": (messages(self_known="measured"), ""),
    "all measured, others moved on": (messages(self_known="measured", predict=True), (M, G)),
    "all measured, late": (messages(self_known="measured", delay=0.05), (M, G)),
    "all measured, phases differ": (messages(self_known="measured", phase=[0.0, 0.03, 0.0, 0.0]), (G, P)),
    "losses": ({"control": HELD, "information": fk.Messages(0.1, loss=0.5, seed=1)}, (M, G, P)),
    "losses in pairs": ({"control": HELD, "information": fk.Messages(0.1, loss=fk.Bernoulli(0.5, True))}, (M, G, P)),
    "losses, moved on": (messages(predict=True, loss=0.5, seed=1), (M, P)),
    "jitter, moved on": (messages(predict=True, jitter=0.2, seed=1), (M, P)),
    "noise": ({"control": HELD, "information": fk.Messages(0.1, noise=0.1)}, (M, R, P)),
    "noise, moved on": (messages(predict=True, noise=fk.WhiteNoise(0.1, 0.1)), (M, R, P)),
    "noise, all measured": (messages(self_known="measured", noise=0.1), (R, P)),
    "rounded": ({"control": HELD, "information": fk.Messages(0.1, resolution=0.5, predict=True)}, (M, G, R)),
    "rounded velocities": (messages(predict=True, velocity_resolution=0.7), (M, G, R)),
    "force limited": ({"agents": fk.Limited(POINTS, force=0.8)}, (M,)),
    "force limited along axes": ({"agents": fk.Limited(POINTS, force=0.8, shape="box")}, (M, R)),
    "speed limited": ({"agents": fk.Limited(POINTS, speed=1.0)}, (G,)),
    "unicycles": ({"agents": fk.Limited(fk.Unicycle(0.3), force=0.8)}, (M,)),
    "filter": ({"control": fk.SafetyFilter(0.05, distance=0.9, acceleration=4.0)}, ()),
    "filter of stopping paths": (
        {"control": fk.SafetyFilter(0.05, distance=0.05, acceleration=1.5, form="stopping")}, (M, G)
    ),
    "lagged": ({"agents": fk.Lagged(POINTS, 0.2)}, ""),
    "lags differ": ({"agents": fk.Lagged(POINTS, [0.1, 0.4, 0.2, 0.2])}, (M,)),
    "gusts": ({"agents": fk.Disturbed(POINTS, 0.5, period=0.1)}, (M, R, P)),
    "mixture": ({"agents": fk.Mixture((POINTS, fk.Lagged(POINTS, 0.2)), [0, 0, 1, 0])}, (M,)),
}  # fmt: skip
"""Worlds, and which symmetries their motions break beyond doubt."""

QUICK = {
    "damped", "neighbours late", "all late", "held, phases differ", "samples at every tick", "samples between ticks",
    "samples moved on", "all measured", "losses in pairs", "noise",
}  # fmt: skip
"""Worlds of the default tests: one of each kind."""


def scenario(**world: object) -> fk.Scenario:
    rng = np.random.default_rng(7)
    start = fk.State(rng.normal(size=(N, 2)), rng.normal(size=(N, 2)))
    return fk.Scenario(LAW, start, t_end=1.0, frames=6, **world)


def motion(case: fk.Scenario) -> tuple[np.ndarray, np.ndarray]:
    run = fk.simulate(case)
    assert run.finished
    return run.q, run.p


def largest(case: fk.Scenario, name: str) -> float:
    """How far the motion from a transformed start is from the transformed motion."""
    q, p = motion(case)
    times = case.frame_times[:, None, None]
    start = case.start
    if name == M:
        masses = np.broadcast_to(case.agents.masses, N)
        middle = np.einsum("i,fik->fk", masses, q) / masses.sum()
        given = masses @ start.p / masses.sum() if case.agents.order == 2 else np.zeros(2)
        return float(np.abs(middle - middle[0] - times[:, 0] * given).max())
    if name == G:
        there = motion(case.with_(start=fk.State(start.q + 5.0, start.p + SPEED)))[0] - 5.0 - SPEED * times
    elif name == R:
        there = motion(case.with_(start=fk.State(start.q @ TURN, start.p @ TURN)))[0] @ TURN.T
    else:
        there = motion(case.with_(start=fk.State(start.q[ORDER], start.p[ORDER]), **relabelled(case)))[0]
        q = q[:, ORDER]
    return float(np.abs(there - q).max())


def relabelled(case: fk.Scenario) -> dict[str, fk.Body]:
    """The agents, who take their own numbers with them; the world keeps its own."""
    body = case.agents
    names = [x.name for x in fields(body) if np.ndim(value := getattr(body, x.name)) and isinstance(value, np.ndarray)]
    return {"agents": replace(body, **{name: getattr(body, name)[ORDER] for name in names})} if names else {}


def cases() -> list[object]:
    """Worlds by name; those with bodies that ask for code of their own, and repeated kinds of messages, are slow."""
    return [pytest.param(name, marks=() if name in QUICK else pytest.mark.slow) for name in WORLDS]


@pytest.mark.parametrize("name", cases())
def test_a_world_keeps_the_symmetries_that_it_states_and_breaks_those_it_is_known_to_break(name: str) -> None:
    world, broken = WORLDS[name]
    case = scenario(**world)
    assert not case.symmetries & set(broken)
    for symmetry in (M, G, R, P):
        if symmetry in case.symmetries:
            assert largest(case, symmetry) < KEPT, symmetry
        elif symmetry in broken:
            assert largest(case, symmetry) > BROKEN, symmetry


@pytest.mark.parametrize("name", cases())
def test_rest_is_physical_in_exactly_the_worlds_whose_motion_depends_on_the_observer(name: str) -> None:
    world, _ = WORLDS[name]
    case = scenario(**world)
    if not case.agents.ideal or case.agents.order == 1 or np.any(case.agents.damping):
        return
    moved = largest(case, G)
    assert moved < KEPT or moved > BROKEN
    assert bool(case.rest_frame) == (moved > BROKEN)
    if case.rest_frame:
        assert case.rest_frame in case.imperfections


FOLLOWING = {
    "exactly": ({}, False),
    "late": ({"information": fk.Delayed(0.1, self_delayed=True)}, True),
    "measured": (messages(self_known="measured"), True),
    "measured, leaders too": (messages(self_known="measured", leader=True), False),
    "moved on": (messages(predict=True), False),
}
"""Worlds with a leader that moves uniformly, and whether rest is physical there."""


@pytest.mark.slow
@pytest.mark.parametrize("name", FOLLOWING)
def test_leaders_that_are_known_at_another_moment_make_rest_physical(name: str) -> None:
    world, physical = FOLLOWING[name]

    def followed(place: float, speed: np.ndarray, gain: float) -> fk.Scenario:
        leader = fk.Velocity(speed, [place, place])
        case = scenario(**world)
        start = fk.State(case.start.q + place, case.start.p + speed)
        return case.with_(law=fk.Law(LAW.graph, [*LAW.terms, fk.Track(leader, gain)]), start=start)

    # Without a gain of position only the velocity of the leader matters, which is constant.
    for gain in (1.0, 0.0):
        still, moving = followed(0.0, np.zeros(2), gain), followed(5.0, SPEED, gain)
        apart = motion(moving)[0] - 5.0 - SPEED * moving.frame_times[:, None, None] - motion(still)[0]
        assert (np.abs(apart).max() > BROKEN) == (physical and gain > 0.0)
        assert bool(still.rest_frame) == bool(moving.rest_frame) == (physical and gain > 0.0)
