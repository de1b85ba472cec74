"""Agents that come into a field of view by their bearing, near the turning point of an orbit in closed form."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk

HALF_ANGLE, PHASE = 0.5, 1.0


def turning(depth: float, tolerance: float) -> fk.Run:
    """Agent 0 rests and sees up to the axis y = 0; agent 1, on an ellipse, rises this far above it at 2 pi - 1."""
    middle = [4.0, depth - 1.0]
    leader = fk.Track(fk.Sink(middle), position_gain=[0.0, 1.0], velocity_gain=0.0)
    law = fk.Law(fk.FieldOfView(10.0, HALF_ANGLE), [fk.Consensus(0.0), leader])
    q = [[0.0, 0.0], [middle[0] + 2.0 * np.sin(PHASE), middle[1] + np.cos(PHASE)]]
    p = [[0.0, 0.0], [2.0 * np.cos(PHASE), -np.sin(PHASE)]]
    bodies = fk.PointMass(headings=[HALF_ANGLE, 0.0])
    scenario = fk.Scenario(law, fk.State(q, p), 8.0, agents=bodies, frames=3, tolerance=tolerance)
    return fk.simulate(scenario, engine="exact", progress=False)


@pytest.mark.parametrize(("depth", "tolerance"), [(1e-2, 1e-4), (1e-3, 1e-6), (1e-4, 1e-6), (1e-4, 1e-8)])
def test_times_of_views_by_bearing_are_within_their_errors(depth: float, tolerance: float) -> None:
    run = turning(depth, tolerance)
    expected = 2 * np.pi - PHASE + np.arccos(1.0 - depth) * np.array([-1.0, 1.0])
    assert run.switches["kind"].tolist() == ["appear", "break"]
    assert (np.abs(run.switches["time"] - expected) <= run.switches["time_error"]).all()
    assert (run.switches["time_error"] < 0.1 * np.ptp(expected)).all()
    assert run.certain.all()
    assert run.accuracy is not None
    assert len(run.accuracy.doubts) == 0


@pytest.mark.parametrize("world", [{}, {"control": fk.Held(0.25)}, {"information": fk.Messages(0.25)}])
@pytest.mark.parametrize("off", [0.0, 1e-9, -1e-9, 1e-4, -1e-4])
def test_a_border_across_the_heading_is_crossed_on_time(off: float, world: dict[str, object]) -> None:
    # A view of a quarter turn to each side is half a plane. Its border was passed late by the root of the rounding.
    law = fk.Law(fk.FieldOfView(3.0, np.pi / 2 + off), [fk.Consensus(0.0)])
    bodies = fk.PointMass(headings=[np.pi / 2, np.pi / 2])
    start = fk.State([[0.0, 0.0], [1.0, -1.0]], [[0.0, 0.0], [0.0, 1.0]])
    run = fk.simulate(fk.Scenario(law, start, 2.0, agents=bodies, frames=3, **world), progress=False)
    found = {(s["kind"], s["i"], s["j"]): float(s["time"]) for s in run.switches}
    # Where the cosine is small but not zero, the square that decides is rounded.
    within = 3e-7 if 0.0 < abs(off) < 1e-6 else 1e-9
    # It comes straight into view of agent 0, and agent 0 out of view of agent 1.
    assert run.switches["speed"] == pytest.approx(
        [-1.0 if kind == "appear" else 1.0 for kind in run.switches["kind"]], rel=1e-6
    )
    times = {("appear", 0, 1): 1.0 - np.tan(off), ("break", 1, 0): 1.0 + np.tan(off)}
    assert found == pytest.approx(times, abs=within)
    if not world:
        errors = {(s["kind"], s["i"], s["j"]): float(s["time_error"]) for s in run.switches}
        assert all(abs(found[key] - times[key]) <= errors[key] for key in times)


def test_views_by_bearing_that_the_error_decides_are_in_doubt() -> None:
    seen = turning(1e-4, 1e-4)
    assert len(seen.switches) == 2
    assert not seen.certain.any()
    missed = turning(-1e-6, 1e-5)
    assert len(missed.switches) == 0
    assert missed.accuracy is not None
    assert set(missed.accuracy.doubts["kind"]) == {"near miss"}
