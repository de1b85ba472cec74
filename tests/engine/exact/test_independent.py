"""The exact engine against computations that share nothing with it, and its kernels against the array functions."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.engine.reference.control import Agent
from tests.engine.exact.groups import simulate, spring, zhou


def slope(law: fk.Law, q: np.ndarray, p: np.ndarray, links: np.ndarray) -> np.ndarray:
    return np.stack([p, fk.control(law, fk.State(q, p, links=links))])


def fixed_steps(law: fk.Law, q: np.ndarray, p: np.ndarray, radius: float, t_end: float, steps: int) -> np.ndarray:
    """Classical Runge-Kutta with links by the distances at the start of each step."""
    y, h = np.stack([q, p]), t_end / steps
    for _ in range(steps):
        distance = np.linalg.norm(y[0][:, None] - y[0][None], axis=2)
        links = (distance < radius) & ~np.eye(len(q), dtype=bool)
        k1 = slope(law, *y, links)
        k2 = slope(law, *(y + h / 2 * k1), links)
        k3 = slope(law, *(y + h / 2 * k2), links)
        k4 = slope(law, *(y + h * k3), links)
        y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return y


def test_dense_fixed_steps_approach_the_same_motion() -> None:
    law, begin = spring(fk.Proximity(2.0)), fk.start.box(8, side=5, speed=2, seed=3)
    run = simulate(law, begin, 1.5, frames=2)
    assert len(run.switches) >= 3
    errors = []
    for steps in (400, 2000):
        q, p = fixed_steps(law, begin.q, begin.p, 2.0, 1.5, steps)
        errors.append(max(np.abs(q - run.q[-1]).max(), np.abs(p - run.p[-1]).max()))
    # Links a step late cost an error of first order in the step.
    assert errors[1] < 2e-3
    assert errors[1] < 0.4 * errors[0]


def test_time_reversal_without_damping() -> None:
    law, begin = zhou(gain=0.0), fk.start.box(5, side=4, speed=2, seed=2, connected_under=zhou().graph)
    there = simulate(law, begin, 2.0, frames=2, tolerance=1e-11)
    back = simulate(law, fk.State(there.q[-1], -there.p[-1], links=there.links[-1]), 2.0, frames=2, tolerance=1e-11)
    assert len(there.switches) == 0
    np.testing.assert_allclose(back.q[-1], begin.q, atol=1e-7)
    np.testing.assert_allclose(back.p[-1], -begin.p, atol=1e-7)


@pytest.mark.parametrize(("barrier", "order"), [(False, 1), (False, 2), (True, 2)])
def test_kernels_agree_with_array_functions(barrier: bool, order: int) -> None:
    law = zhou() if barrier else spring(fk.Proximity(3.0), gain=0.7, k=1.3)
    begin = fk.start.box(9, side=5, speed=1, seed=4, connected_under=law.graph)
    agents = fk.Agents(order=order)
    session = fk.start(fk.Scenario(law, begin, t_end=1.0, agents=agents))
    seen = fk.evaluate(law, begin, agents=agents)
    dy = session._stepper.memory.slope
    u = dy[:18] if order == 1 else dy[18:36]
    np.testing.assert_allclose(u.reshape(9, 2), seen.u, rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(dy[-2:], [seen.dissipation, seen.supply], rtol=1e-11, atol=1e-12)
    assert session.energy == pytest.approx(seen.storage + seen.kinetic, rel=1e-12)


def test_an_agent_computes_its_own_control() -> None:
    law, begin = zhou(), fk.start.box(7, side=5, speed=1, seed=4, connected_under=zhou().graph)
    links, u = law.graph.initial(begin.q), fk.control(zhou(), begin)
    for i in range(7):
        seen = [Agent(begin.q[j], begin.p[j], int(j)) for j in np.flatnonzero(links[i])]
        own = fk.control_of(law, Agent(begin.q[i], begin.p[i], i), seen)
        np.testing.assert_allclose(own, u[i], rtol=1e-12, atol=1e-13)
