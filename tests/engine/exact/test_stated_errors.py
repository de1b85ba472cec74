"""Errors that a run states of switches and closest approaches, against straight flights and springs in closed form."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk

FLIGHT = fk.Law(fk.Proximity(2.0), [fk.Consensus(0.0)])


def passing(aim: float, speed: float, tolerance: float = 1e-8, angle: float = 0.7) -> fk.Run:
    """One agent flies past another, at rest, at distance ``aim``."""
    along, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    q = np.stack([np.zeros(2), aim * across - 3.1 * along])
    return fk.simulate(fk.Scenario(FLIGHT, fk.State(q, np.stack([np.zeros(2), speed * along])), 6.5 / speed,
                                   tolerance=tolerance), progress=False)  # fmt: skip


@pytest.mark.parametrize("speed", [0.1, 1.0, 37.0])
def test_times_of_switches_are_within_their_error(speed: float) -> None:
    run = passing(0.83, speed)
    half = np.sqrt(4.0 - 0.83**2)
    expected = np.array([3.1 - half, 3.1 + half]) / speed
    assert (np.abs(run.switches["time"] - expected) <= run.switches["time_error"]).all()
    assert (run.switches["time_error"] < 1e-11 / speed).all()


@pytest.mark.parametrize("aim", [1.9, 1e-3, 1e-7, 1e-9])
def test_closest_approaches_are_within_their_error(aim: float) -> None:
    for angle in (0.0, 0.7, 2.1):
        run = passing(aim, 1.0, angle=angle)
        assert abs(run.closest.distance - aim) <= run.closest.error
        assert run.closest.error < (1e-12 if aim > 1 else 1e-6)


def test_agents_that_meet_head_on_are_within_the_error_of_each_other() -> None:
    """The force of (r^2 - 1)^2 is smooth where they meet; their squared distance is known to rounding alone."""
    law = fk.Law(fk.Fixed.complete(2), [fk.Gradient(fk.Potential("k*(r**2 - d**2)**2/4", k=0.4, d=1.0))])
    for half in (0.61, 0.93, 1.37):
        start = fk.State([[-half, 0.0], [half, 0.0]], [[1.1, 0.0], [-1.1, 0.0]])
        run = fk.simulate(fk.Scenario(law, start, 2.5, tolerance=1e-11), progress=False)
        assert run.closest.distance <= run.closest.error < 1e-6


@pytest.mark.parametrize("fine", [False, True], ids=["native", "python"])
def test_the_error_after_a_switch_is_no_smaller_because_the_polynomial_of_its_step_is_off(fine: bool) -> None:
    """Steps of a relaxation at a loose tolerance are long, and their polynomials wiggle by the error of the step."""
    rng = np.random.default_rng(1)
    rng.choice(4)
    start = fk.State(rng.uniform(-1.3, 1.3, (6, 2)))
    law = fk.Law(fk.Smooth(1.4, 0.3, sigma_norm=0.1), [fk.Gradient(fk.Potential("(r - 0.6)**2/2"))])
    made = fk.Scenario(
        law, start, 4.0, frames=(*np.linspace(0.0, 1.0, 41), 4.0), bodies=fk.SingleIntegrator(), tolerance=1e-3
    )
    session = fk.start(made, fine=fine)
    tight = fk.start(made.with_(tolerance=1e-11))
    for each in (session, tight):
        each.advance(1.0)
    run, true = session.run(), tight.run()
    assert run.accuracy is not None
    assert run.switches["time"][0] < true.switches["time"][0] - 0.01
    off = np.linalg.norm(run.q - true.q, axis=2).max(axis=1)
    assert (off <= run.accuracy.frames[:, 0]).all()
