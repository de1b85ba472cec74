"""The solution between frames: dense enough that a short encounter is not missed."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk

REPULSION = fk.Law(fk.Fixed(2, ((0, 1),)), [fk.Gradient(fk.Potential("b/r", b=0.01))])


def encounter(frames: int = 4) -> fk.Scenario:
    """Head on: energy gives the turning point, 0.005, and relative speeds of 2 except for a moment around t = 2."""
    start = fk.State(np.array([[-2.0, 0.0], [2.0, 0.0]]), np.array([[1.0, 0.0], [-1.0, 0.0]]))
    return fk.Scenario(REPULSION, start, t_end=4.0, frames=frames)


def test_a_turning_point_between_frames_is_sampled() -> None:
    run = fk.simulate(encounter(), progress=False, fine=True)
    speeds = np.abs(run.fine.p[:, 0, 0])
    assert np.abs(run.p[:, 0, 0]).min() > 0.9
    assert speeds.min() < 0.2
    distance = np.linalg.norm(run.fine.q[:, 1] - run.fine.q[:, 0], axis=1)
    energy = (run.fine.p**2).sum(axis=(1, 2)) / 2 + 0.01 / distance
    assert np.abs(energy - energy[0]).max() < 1e-6
    assert (np.diff(run.fine.t) > 0).all()
    assert (run.fine.t[0], run.fine.t[-1]) == (0.0, 4.0)


def test_frames_lie_on_the_samples_and_an_end_cuts_both() -> None:
    run = fk.simulate(encounter(9), progress=False, fine=True)
    cut = run.until(2.0)
    assert cut.t[-1] == 2.0
    assert cut.fine.t[-1] <= 2.0 < run.fine.t[len(cut.fine.t)]
    whole = fk.simulate(encounter(9), progress=False)
    assert whole.fine is None
    assert (whole.q == run.q).all()


def test_other_engines_and_stored_runs_refuse_it(tmp_path) -> None:
    with pytest.raises(fk.InvalidInput, match="fine"):
        fk.simulate(encounter(), progress=False, fine=True, save=tmp_path / "run")
