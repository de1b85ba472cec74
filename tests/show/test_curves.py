import numpy as np
import pytest

import flocking as fk
from flocking.show import curves


def test_potential_with_minimum_radius_and_slope(psi, part):
    axes = curves.potential(psi, radius=4)
    x, y = part(axes, "curve").get_data()
    seen = np.isfinite(y)
    assert np.allclose(y[seen], 1 / x[seen] + 1 / (4 - x[seen]))
    assert x.max() < 4.0
    dot = part(axes, "minimum")
    assert (dot.get_xdata()[0], dot.get_ydata()[0]) == pytest.approx((2.0, 1.0), abs=1e-5)
    assert sorted(t.get_text() for t in axes.texts) == ["$R = 4$", "$r = 2$"]
    beside = axes.figure.axes[1]
    x, y = part(beside, "curve").get_data()
    assert np.allclose(y, -1 / x**2 + 1 / (4 - x) ** 2)
    low, high = beside.get_ylim()
    assert -low == pytest.approx(high)
    assert 30 < high < 300
    assert axes.get_xlim() == beside.get_xlim() == (0.0, 5.0)


def test_the_well_fills_the_picture():
    axes = curves.potential(fk.Potential("1/r**2 + log(r**2)"), radius=2)
    low, high = axes.get_ylim()
    assert low < 1.0 < 0.25 + np.log(4) < high < 5.0


def test_jump_at_the_radius_is_marked_and_a_continuous_end_is_not(part, has):
    psi = fk.Potential("1/r**2 + log(r**2)")
    end = 0.25 + np.log(4.0)
    assert not has(curves.potential(psi, radius=2, outside=end), "jump")
    axes = curves.potential(psi, radius=2, outside=0.0)
    assert part(axes, "jump").get_ydata() == pytest.approx([end, 0.0])
    assert list(part(axes, "outside").get_ydata()) == [0.0, 0.0]


def test_lines_stop_at_kinks():
    psi = fk.Potential("(r - 1)**2").cut(2.0)
    axes = curves.potential(psi, slope=False)
    pieces = [line for line in axes.lines if line.get_gid() == "curve"]
    assert len(pieces) == 2
    assert pieces[0].get_xdata()[-1] < 2.0 < pieces[1].get_xdata()[0]
    assert (pieces[0].get_ydata()[-1], pieces[1].get_ydata()[0]) == pytest.approx((1.0, 0.0), abs=1e-6)


def test_without_a_minimum_nothing_is_marked(has):
    assert curves.minimum(fk.Potential("1/r"), 0.0, np.inf) is None
    assert not has(curves.potential(fk.Potential("1/r"), upper=3.0), "minimum")


def test_minimum_far_and_near():
    assert curves.minimum(fk.Potential("(r - c)**2", c=73.25), 0.0, np.inf) == pytest.approx(73.25, rel=1e-6)
    assert curves.minimum(fk.Potential("(r - c)**2", c=0.03), 0.0, 1.0) == pytest.approx(0.03, rel=1e-6)


def test_any_function(part):
    axes = curves.curve(np.cos, 0.0, 3.0, label="cosine", marks={"here": 1.5})
    x, y = part(axes, "curve").get_data()
    assert np.array_equal(y, np.cos(x))
    assert part(axes, "mark").get_xdata()[0] == 1.5
    assert axes.get_ylabel() == "cosine"
    flat = curves.curve(lambda z: 1.0 + 0 * z, 0.0, 1.0)
    assert flat.get_ylim()[0] < 1.0 < flat.get_ylim()[1]


@pytest.mark.parametrize(("function", "ends"), [(np.cos, (1.0, 1.0)), (lambda z: z * np.nan, (0.0, 1.0))])
def test_empty_curves_are_refused(function, ends):
    with pytest.raises(fk.InvalidInput):
        curves.curve(function, *ends)
