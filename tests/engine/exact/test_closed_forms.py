"""The exact engine against solutions known in closed form."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.engine.driver.simulate import start
from tests.engine.exact.groups import flight, simulate, spring

PAIR = fk.Fixed(2, ((0, 1),))


def damped(t: np.ndarray, k: float, c: float, x0: float, v0: float) -> tuple[np.ndarray, np.ndarray]:
    """Solution of x'' = -2 k x - 2 c x' for the distance vector of two agents."""
    w = np.sqrt(2 * k - c**2)
    a, b = x0, (v0 + c * x0) / w
    x = np.exp(-c * t) * (a * np.cos(w * t) + b * np.sin(w * t))
    v = np.exp(-c * t) * ((b * w - c * a) * np.cos(w * t) - (a * w + c * b) * np.sin(w * t))
    return x, v


@pytest.mark.parametrize("begin", [0.0, 7.5])
def test_two_agents_on_a_spring_with_friction(begin: float) -> None:
    law = spring(PAIR, gain=0.3, k=2.0)
    run = simulate(law, flight([[0, 0], [1.5, 0]], [[0.1, 0.2], [-0.3, 0.2]], begin), begin + 6.0, frames=61)
    x, v = damped(run.t - begin, 2.0, 0.3, 1.5, -0.4)
    np.testing.assert_allclose(run.q[:, 1, 0] - run.q[:, 0, 0], x, atol=2e-8)
    np.testing.assert_allclose(run.p[:, 1, 0] - run.p[:, 0, 0], v, atol=2e-8)
    np.testing.assert_allclose(run.q.mean(axis=1)[:, 0], 0.75 - 0.1 * (run.t - begin), atol=1e-10)
    # Twice the friction of each agent times the squared relative speed is what the ledger must have lost.
    lost = run.trace["energy"][0] - run.trace["energy"]
    np.testing.assert_allclose(run.trace["dissipated"], lost, atol=1e-8)
    assert run.trace["energy"][0] == pytest.approx(0.5 * (0.01 + 0.04 + 0.09 + 0.04) + 2.0 * 1.5**2 / 2)


def test_error_follows_the_tolerance() -> None:
    law = spring(PAIR, gain=0.3, k=2.0)
    errors = []
    for tolerance in (1e-5, 1e-7, 1e-9, 1e-11):
        run = simulate(law, flight([[0, 0], [1.5, 0]], [[0, 0], [0, 0]]), 6.0, frames=13, tolerance=tolerance)
        x, _ = damped(run.t, 2.0, 0.3, 1.5, 0.0)
        errors.append(np.abs(run.q[:, 1, 0] - run.q[:, 0, 0] - x).max())
    assert all(error < 100 * tol for error, tol in zip(errors, (1e-5, 1e-7, 1e-9, 1e-11), strict=True))
    assert errors[0] > 100 * errors[2]


def test_observed_order_of_the_steps_is_eight() -> None:
    session = start(fk.Scenario(spring(PAIR, gain=0.3, k=2.0), flight([[0, 0], [1.5, 0]], [[0, 0], [0, 0]]), t_end=4.0))
    stepper = session._stepper
    stepper.tolerance[:] = 1e3
    first = stepper.memory
    errors = []
    for steps in (8, 16):
        stepper.recall(type(first)(first.t, first.y, first.slope, 4.0 / steps))
        for k in range(steps):
            segment = stepper.step(4.0 * (k + 1) / steps, 4.0 / steps)
        y = segment.coefficients[-1]
        errors.append(abs(y[2] - y[0] - damped(np.array([4.0]), 2.0, 0.3, 1.5, 0.0)[0][0]))
    assert 7.4 < np.log2(errors[0] / errors[1]) < 9.6


@pytest.mark.parametrize("begin", [0.0, 1e6])
@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_free_flight_through_a_radius(begin: float, dimension: int) -> None:
    q = np.zeros((2, dimension))
    q[1, 0] = -3.0
    q[1, 1:2] = 0.6
    p = np.zeros((2, dimension))
    p[1, 0] = 2.0
    law = spring(fk.Proximity(1.0), gain=0.0, k=0.0)
    run = simulate(law, flight(q, p, begin), begin + 4.0)
    half = np.sqrt(1 - 0.36) if dimension > 1 else 1.0
    assert run.switches["kind"].tolist() == ["appear", "break"]
    np.testing.assert_allclose(run.switches["time"] - begin, [(3 - half) / 2, (3 + half) / 2], atol=1e-9)
    np.testing.assert_allclose(run.switches["speed"], [-2 * half, 2 * half], rtol=1e-9)
    assert not run.switches["tangential"].any()
    assert run.closest.distance == pytest.approx(0.6 if dimension > 1 else 0.0, abs=1e-7)
    assert run.closest.time - begin == pytest.approx(1.5, abs=1e-5)
    assert run.closest.pair == (0, 1)


def test_hysteresis_links_at_the_inner_and_breaks_at_the_outer_radius() -> None:
    law = spring(fk.Hysteresis(radius=1.0, gap=0.25), gain=0.0, k=0.0)
    run = simulate(law, flight([[0, 0], [-3, 0]], [[0, 0], [1, 0]]), 5.0)
    np.testing.assert_allclose(run.switches["time"], [2.25, 4.0], atol=1e-9)


def test_event_time_of_two_attracted_agents() -> None:
    # Linked at rest at 1.5 on a spring: the distance is 1.5 cos(w t); a pair farther out is caught on the way.
    law = spring(fk.Fixed(2, ((0, 1),)), gain=0.0, k=1.0)
    law = fk.Law(law.graph, [*law.terms, fk.Consensus(0.0, over=fk.Proximity(0.5))])
    run = simulate(law, flight([[0, 0], [1.5, 0]], [[0, 0], [0, 0]]), 2.0)
    w = np.sqrt(2.0)
    times = np.array([np.arccos(1 / 3) / w, np.arccos(-1 / 3) / w])
    np.testing.assert_allclose(run.switches["time"], times, atol=1e-9)
    np.testing.assert_allclose(run.switches["speed"], [-1.5 * w * np.sin(w * times[0]), 1.5 * w * np.sin(w * times[1])])
    assert run.switches["graph"].tolist() == [1, 1]


def test_a_follower_approaches_its_leader_exponentially() -> None:
    law = fk.Law(fk.Fixed(1, ()), [fk.Track(fk.Velocity([2.0, -1.0]), velocity_gain=0.7)])
    run = simulate(law, flight([[3, 4]], [[0, 0]]), 5.0, frames=26)
    gap = np.exp(-0.7 * run.t)[:, None] * np.array([-2.0, 1.0])
    np.testing.assert_allclose(run.p[:, 0], gap + [2.0, -1.0], atol=2e-9)
    np.testing.assert_allclose(run.q[:, 0], [3, 4] + run.t[:, None] * [2.0, -1.0] + (gap - [-2, 1]) / -0.7, atol=5e-9)
    assert np.abs(run.residual).max() < 1e-7


def test_first_order_agents_on_springs_descend_the_gradient() -> None:
    law = spring(PAIR, gain=0.3, k=2.0)
    run = simulate(law, flight([[0, 0], [1.5, 0]], [[9, 9], [9, 9]]), 2.0, agents=fk.Agents(order=1), frames=21)
    np.testing.assert_allclose(run.q[:, 1, 0] - run.q[:, 0, 0], 1.5 * np.exp(-4 * run.t), atol=1e-8)
    energy = 2.0 * (1.5 * np.exp(-4 * run.trace["time"])) ** 2 / 2
    np.testing.assert_allclose(run.trace["energy"], energy, atol=1e-8)
    np.testing.assert_allclose(run.trace["dissipated"], energy[0] - energy, atol=1e-8)
    assert not run.trace["supplied"].any()


def test_first_order_speed_of_crossing() -> None:
    law = spring(PAIR, gain=0.3, k=2.0)
    law = fk.Law(law.graph, [*law.terms, fk.Consensus(0.0, over=fk.Proximity(0.5))])
    run = simulate(law, flight([[0, 0], [1.5, 0]], [[0, 0], [0, 0]]), 2.0, agents=fk.Agents(order=1))
    assert run.switches["time"].tolist() == pytest.approx([np.log(3) / 4], abs=1e-9)
    assert run.switches["speed"].tolist() == pytest.approx([-2.0], abs=1e-7)
    assert not run.switches["tangential"].any()
