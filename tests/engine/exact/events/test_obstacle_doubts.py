"""Agents that graze the range of an obstacle by less than the integration error, against an orbit in closed form."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk

RANGE, T_END = 0.5, 10.0
OBSTACLES = {
    "ball": lambda top: fk.Ball([0.0, top + 1.5], 1.0),
    "moved ball": lambda top: fk.Ball(fk.Path(["0*t", "0*t"], start=[0.0, top + 1.5]), 1.0),
    "wall": lambda top: fk.Wall([0.0, top + RANGE], [0.0, -1.0]),
}


def grazing(kind: str, depth: float, tolerance: float) -> fk.Run:
    """An agent on the ellipse (2 cos t, 1.5 sin t) about a sink, whose top is this deep within range of an obstacle."""
    obstacle = OBSTACLES[kind](1.5 - depth)
    law = fk.Law(
        fk.Fixed(1, []),
        [
            fk.Track(fk.Sink([0.0, 0.0]), position_gain=1.0, velocity_gain=0.0),
            fk.Avoid([obstacle], range=RANGE, gamma_agents=False, damping_gain=5.0, repulsion_gain=0.0),
        ],
    )
    start = fk.State([[2.0, 0.0]], [[0.0, 1.5]])
    return fk.simulate(fk.Scenario(law, start, T_END, frames=41, tolerance=tolerance), engine="exact", progress=False)


def undisturbed(run: fk.Run) -> np.ndarray:
    """Distance of the frames from the ellipse."""
    true = np.stack([2.0 * np.cos(run.t), 1.5 * np.sin(run.t)], axis=1)
    return np.asarray(np.linalg.norm(run.q[:, 0] - true, axis=1))


@pytest.mark.parametrize("kind", OBSTACLES)
def test_an_obstacle_that_is_touched_by_the_error_alone_is_in_doubt(kind: str) -> None:
    run = grazing(kind, -1e-6, 1e-3)
    assert len(run.switches) > 0
    assert run.accuracy is not None
    assert not run.certain.any()
    assert set(run.accuracy.doubts["what"]) == {"obstacle"}
    assert (undisturbed(run) <= run.accuracy.frames[:, 0]).all()


@pytest.mark.parametrize("kind", OBSTACLES)
def test_an_obstacle_that_is_missed_by_the_error_alone_is_in_doubt(kind: str) -> None:
    run, fine = grazing(kind, 1e-8, 1e-5), grazing(kind, 1e-8, 1e-12)
    assert (len(run.switches), len(fine.switches)) == (0, 4)
    assert fine.certain.all()
    assert run.accuracy is not None
    assert set(run.accuracy.doubts["kind"]) == {"near miss"}
    assert run.accuracy.doubts["time"][0] == pytest.approx(np.pi / 2, abs=1e-4)
    off = np.linalg.norm(run.q - fine.q, axis=2)[:, 0]
    assert off.max() > 1e-5
    assert (off <= run.accuracy.frames[:, 0]).all()
