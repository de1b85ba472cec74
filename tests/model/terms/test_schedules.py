"""Gains that change at given times."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.errors import InvalidInput


def test_value_at_and_between_switches() -> None:
    gain = fk.Schedule([1.0, 2.5], [0.5, 0.0, 2.0])
    assert [gain.at(t) for t in (-3.0, 0.999, 1.0, 2.4, 2.5, 99.0)] == [0.5, 0.5, 0.0, 0.0, 2.0, 2.0]
    assert gain.switch_times(1.0, 5.0) == (2.5,)
    assert not gain.per_agent


def test_velocity_follows_the_schedule_in_closed_form() -> None:
    """v' = -c(t) (v - 1): the logarithm of the gap falls by the integral of the gain."""
    each = fk.Schedule([1.0, 2.0], [[1.0, 0.0], [0.0, 2.0], [3.0, 3.0]])
    law = fk.Law(fk.Proximity(0.1), [fk.Track(fk.Velocity([1.0]), velocity_gain=each)])
    start = fk.State([[0.0], [9.0]], [[3.0], [-2.0]])
    frames = [0.0, 0.5, 1.0, 1.7, 2.0, 2.6]
    run = fk.simulate(fk.Scenario(law, start, 2.6, frames=frames, tolerance=1e-11), progress=False)
    passed = np.array([[0, 0], [0.5, 0], [1, 0], [1, 1.4], [1, 2.0], [2.8, 3.8]])
    np.testing.assert_allclose(run.p[:, :, 0], 1 + np.array([2.0, -3.0]) * np.exp(-passed), rtol=1e-9)
    state = fk.State(start.q, start.p, 1.5)
    np.testing.assert_allclose(fk.control(law, state)[:, 0], [0.0, 6.0])
    np.testing.assert_allclose(fk.control_of(law, fk.Agent([9.0], [-2.0], 1), [], 1.5), [6.0])


def test_stored_energy_jumps_with_the_gain() -> None:
    gain = fk.Schedule([0.8], [1.0, 4.0])
    law = fk.Law(fk.Proximity(0.1), [fk.Track(fk.Sink([0.0]), position_gain=gain, velocity_gain=0.0)])
    run = fk.simulate(fk.Scenario(law, fk.State([[1.0]]), 2.0), progress=False)
    assert run.trace["jumped"][-1] == pytest.approx(0.5 * 3.0 * np.cos(0.8) ** 2, rel=1e-8)
    assert np.abs(run.residual).max() < 1e-7
    t = run.t[-1] - 0.8
    expected = np.cos(0.8) * np.cos(2 * t) - np.sin(0.8) / 2 * np.sin(2 * t)
    assert run.q[-1, 0, 0] == pytest.approx(expected, rel=1e-8)


def test_resume_after_a_switch() -> None:
    gain = fk.Schedule([0.5, 1.0], [1.0, 0.0, 2.0])
    law = fk.Law(fk.Proximity(0.1), [fk.Track(fk.Velocity([1.0]), velocity_gain=gain)])
    scenario = fk.Scenario(law, fk.State([[0.0]], [[3.0]]), 2.0)
    whole = fk.simulate(scenario, progress=False)
    session = fk.start(scenario)
    session.advance(0.7)
    again = fk.ExactSession.resume(session.snapshot())
    again.advance(2.0)
    np.testing.assert_array_equal(again.run().p, whole.p)


TWICE = fk.Schedule([0.5], [1.0, 2.0])


@pytest.mark.parametrize(
    "make",
    [
        lambda: fk.Consensus(TWICE), lambda: fk.Consensus([TWICE, TWICE]), lambda: fk.PointMass(TWICE),
        lambda: fk.PointMass(1.0, TWICE), lambda: fk.Held(TWICE), lambda: fk.Messages(0.1, phase=TWICE),
        lambda: fk.PerAgentRadii(TWICE), lambda: fk.Limited(fk.PointMass(), force=TWICE), lambda: fk.State([TWICE] * 2),
        lambda: fk.Consensus(1.0, weights=[TWICE, TWICE]), lambda: fk.Delayed([TWICE, TWICE], self_delayed=True),
    ],
)  # fmt: skip
def test_values_at_times_are_not_taken_for_those_of_agents(make) -> None:
    """Two agents had the gains 1 and 2 at all times."""
    with pytest.raises(InvalidInput, match="same at all times"):
        make()


def test_errors() -> None:
    with pytest.raises(InvalidInput, match="ascending"):
        fk.Schedule([2.0, 1.0], [0.0, 1.0, 2.0])
    with pytest.raises(InvalidInput, match="one more"):
        fk.Schedule([2.0], [0.0])
    with pytest.raises(InvalidInput, match="all"):
        fk.Schedule([2.0], [0.0, [1.0, 2.0]])
    with pytest.raises(InvalidInput, match="velocity_gain"):
        fk.Track([1.0], velocity_gain=fk.Schedule([1.0], [1.0, -1.0]))
    law = fk.Law(fk.Proximity(1.0), [fk.Track([1.0], velocity_gain=fk.Schedule([1.0], [[1.0, 2.0], [2.0, 1.0]]))])
    with pytest.raises(InvalidInput, match="3 agents"):
        fk.control(law, fk.State(np.zeros((3, 1))))
