"""What curves are drawn from: extrema survive thinning, and fine samples take the place of frames."""

from __future__ import annotations

import numpy as np

import flocking as fk
from flocking.show.motion import BINS, thinned, thinned_path
from flocking.show.series import velocities
from tests.engine.exact.test_fine_samples import encounter


def test_thinning_keeps_the_extrema_of_every_column() -> None:
    rng = np.random.default_rng(1)
    t = np.sort(rng.uniform(0, 1, 50_000))
    values = rng.normal(size=50_000)
    values[31_234] = 40.0
    few, kept = thinned(t, values)
    assert len(few) <= 4 * BINS
    assert (kept.max(), kept.min()) == (40.0, values.min())
    assert (few[0], few[-1]) == (t[0], t[-1])
    assert (np.diff(few) > 0).all()


def test_a_short_curve_is_left_alone() -> None:
    t = np.linspace(0, 1, 100)
    assert thinned(t, t**2)[1] is not None
    assert len(thinned(t, t**2)[0]) == 100


def test_a_path_keeps_its_shape() -> None:
    angle = np.linspace(0, 2 * np.pi, 10_000)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    few = thinned_path(circle, 0.01)
    assert 600 < len(few) < 660
    assert (few[0] == circle[0]).all()
    assert (few[-1] == circle[-1]).all()
    assert np.linalg.norm(np.diff(few, axis=0), axis=1).max() < 0.011


def test_velocity_curves_show_what_happens_between_frames(part) -> None:
    run = fk.simulate(encounter(), progress=False, fine=True)
    lines = part(velocities(run, 0), "agents").get_segments()
    assert np.abs(lines[0][:, 1]).min() < 0.2
    assert np.isin(lines[0][:, 0], run.fine.t).all()
