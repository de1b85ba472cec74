"""Pictures do not depend on units, and late times are told apart."""

import dataclasses

import numpy as np
import pytest

import flocking as fk
from flocking.show import curves, plane, series
from flocking.show.frames import frame_at
from flocking.show.phase import phase


def scaled(run, unit):
    """The same frames in another unit of length."""
    return dataclasses.replace(run, q=run.q * unit, p=run.p * unit)


@pytest.mark.parametrize("unit", [1e-12, 1e-6, 1e9])
@pytest.mark.parametrize("draw", [series.velocities, series.positions, series.velocity_errors])
def test_limits_of_an_axis_have_the_unit_of_its_curves(run, draw, unit):
    limits = draw(run).get_ylim()
    assert np.ptp(limits) < 3 * np.ptp(run.q)
    assert draw(scaled(run, unit)).get_ylim() == pytest.approx(tuple(unit * x for x in limits), rel=1e-9)


def test_rounding_errors_are_not_magnified(run):
    rng = np.random.default_rng(0)
    together = 1e3 + 1e-13 * rng.normal(size=run.p.shape)
    axes = series.velocity_errors(dataclasses.replace(run, p=together))
    assert np.ptp(axes.get_ylim()) > 1.0
    still = series.velocities(dataclasses.replace(run, p=np.zeros_like(run.p)))
    assert np.ptp(still.get_ylim()) == 1.0


@pytest.mark.parametrize("unit", [1e-12, 1.0, 1e9])
def test_a_jump_of_a_potential_is_drawn_in_any_unit(unit, has):
    jumping = curves.potential(fk.Potential("k*(r - 1)**2", k=unit), radius=2.0, outside=2.0 * unit)
    assert has(jumping, "jump")
    ending = curves.potential(fk.Potential("k*(r - 1)**2", k=unit), radius=2.0, outside=unit)
    assert not has(ending, "jump")


def test_a_well_fills_the_picture_in_any_unit():
    heights = []
    for unit in (1e-20, 1.0):
        low, high = curves.potential(fk.Potential("k*(1/r + r)", k=unit), radius=4.0).get_ylim()
        heights.append((low / unit, high / unit))
    assert heights[0] == pytest.approx(heights[1])


def test_a_time_outside_a_short_run_is_refused(run):
    short = dataclasses.replace(run, t=run.t * 1e-12)
    assert frame_at(short, 3e-12) == 30
    with pytest.raises(fk.InvalidInput, match="must be in the run, from 0 to 3e-12"):
        frame_at(short, 4e-11)
    late = dataclasses.replace(run, t=run.t + 1e9)
    with pytest.raises(fk.InvalidInput, match="from 1000000000 to 1000000003"):
        frame_at(late, 1e9 + 5.0)


@pytest.mark.parametrize("frame", [1.5, True, "1", 31, -32])
def test_a_frame_that_is_none_is_refused(run, frame):
    with pytest.raises(fk.InvalidInput, match="frame must be one of the 31 stored frames"):
        plane.net(run, frame=frame)


def test_late_frames_have_different_times_above_them(run):
    late = dataclasses.replace(run, t=run.t + 1e9)
    titles = [plane.net(late, frame=k).get_title() for k in range(31)]
    assert len(set(titles)) == 31
    assert titles[1] == "$t = 1000000000.1$"
    assert repr(late).count("t = 1000000000 to 1000000003") == 1
    (_, end) = [x.get_text() for x in phase(late, (0, 1)).get_legend().get_texts()]
    assert end == "$t = 1000000003$"
