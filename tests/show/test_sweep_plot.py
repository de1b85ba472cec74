"""Pictures of a sweep by the names of its parameters and measures: the chart's data are the table's."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk


def two(separation: float, speed: float, seed: int = 0) -> fk.Scenario:
    law = fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0)])
    start = fk.State([[0.0, 0.0], [separation, 0.0]], [[0.0, 0.0], [speed * (1 + 0.01 * seed), 0.0]])
    return fk.Scenario(law, start, t_end=0.1, frames=3)


@pytest.fixture(scope="module")
def table():
    grid = {"separation": [0.5, 1.0, 3.0], "speed": [0.1, 0.2]}
    measures = {"distance": lambda run: float(np.ptp(run.q[-1][:, 0])), "linked": lambda run: bool(run.links[-1].any())}
    return fk.sweep(two, grid=grid, seeds=range(8), measures=measures, workers=1, progress=False)


def test_a_measure_over_a_parameter_has_a_curve_for_each_value_of_another(table):
    axes = table.plot("separation", "distance", "speed").axes[0]
    means = table.summary()["distance"]
    curves = [line for line in axes.lines if len(line.get_xdata()) == 3]
    assert len(curves) >= 2
    for line, speed in zip(curves, (0.1, 0.2), strict=False):
        assert list(line.get_xdata()) == [0.5, 1.0, 3.0]
        assert line.get_ydata() == pytest.approx(means.sel(speed=speed).to_numpy())
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("separation", "distance")


def test_two_measures_are_dots_and_two_parameters_a_map(table):
    dots = table.plot("distance", "linked", "speed").axes[0]
    assert sum(len(line.get_xdata()) for line in dots.lines) + sum(
        len(c.get_offsets()) for c in dots.collections
    ) >= len(table)
    cells = table.plot("separation", "speed", "linked").axes[0]
    shown = cells.images or cells.collections
    values = np.ma.filled(np.ma.asarray(shown[0].get_array(), dtype=float), np.nan).ravel()
    assert sorted(values[np.isfinite(values)]) == [0.0, 0.0, 1.0, 1.0, 1.0, 1.0]


def test_a_file_is_written_where_it_was_asked_for(table, tmp_path):
    table.plot("separation", "distance", "speed", save_as=tmp_path / "x.pdf")
    assert [p.name for p in tmp_path.iterdir()] == ["x.pdf"]
    assert (tmp_path / "x.pdf").read_bytes()[:5] == b"%PDF-"


@pytest.mark.parametrize(
    ("x", "y", "hue", "rule"),
    [
        ("separaton", "distance", None, "x must be one of separation, speed"),
        ("separation", "distance", "seed", "hue must be one of"),
        ("distance", "separation", None, "must be a measure over"),
        ("separation", "speed", None, "must be a measure over"),
        ("separation", "distance", None, "hue must distinguish the values of speed"),
        ("distance", "separation", "linked", "must be a measure over"),
    ],
)
def test_names_that_do_not_fit_are_refused_by_name(table, x, y, hue, rule):
    with pytest.raises(fk.InvalidInput, match=rule):
        table.plot(x, y, hue)


def test_the_lattice_picture_is_zero_in_a_lattice_and_follows_a_closed_form():
    law = fk.Law(fk.Proximity(1.2), [fk.Consensus(1.0)])
    # A chain that is stretched: the lengths are 1 and 1 + x, their relative deviation x/(2 + x).
    start = fk.State([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]], [[0.0, 0.0], [0.0, 0.0], [0.1, 0.0]])
    run = fk.simulate(fk.Scenario(law, start, t_end=1.0, frames=11), progress=False)
    (line,) = [x for x in fk.plot(run, "lattice").axes[0].lines if x.get_gid() == "link length deviation"]
    lengths = np.diff(run.q[:, :, 0], axis=1)
    assert line.get_ydata()[0] == pytest.approx(0.0, abs=1e-15)
    assert line.get_ydata() == pytest.approx(np.abs(np.diff(lengths, axis=1))[:, 0] / lengths.sum(axis=1), abs=1e-12)
    assert line.get_ydata()[-1] > 1e-3


def measured(unit: float, seed: int = 0, kind: str = "a") -> fk.Scenario:
    return two(1.0, 0.1, seed)


def small(values, grid, **options):
    """A sweep whose measure has stated values, one a run."""
    count = iter(values)
    measures = {"share": lambda run: next(count)}
    return fk.sweep(measured, grid=grid, measures=measures, workers=1, progress=False, **options)


def texts(axes):
    return [text.get_text() for text in axes.texts]


@pytest.mark.parametrize(("value", "said"), [(3.21e-8, "3.21e-08"), (-4.5, "-4.5"), (0.999, "0.999")])
def test_cells_of_a_map_say_their_numbers_in_any_unit(value, said):
    grid = {"unit": [1.0, 2.0], "kind": ["a", "b"]}
    axes = small([value] * 8, grid, seeds=range(2)).plot("unit", "kind", "share").axes[0]
    assert all(text.startswith(f"{said}\n") for text in texts(axes)[:4])
    least, top = axes.images[0].get_clim()
    assert least <= value <= top
    assert least < top


def test_a_share_of_nearly_all_is_not_read_as_all():
    values = [True] * 399 + [False]
    axes = (
        small(values * 2, {"unit": [1.0, 2.0], "kind": ["a"]}, seeds=range(400)).plot("unit", "kind", "share").axes[0]
    )
    assert [text.split("\n")[0] for text in texts(axes)[:2]] == ["0.998", "0.998"]


def test_texts_on_an_axis_stand_side_by_side():
    axes = (
        small([1.0, 2.0, 3.0, 4.0], {"kind": ["a", "b"], "unit": [1.0]}, seeds=range(2)).plot("kind", "share").axes[0]
    )
    assert [tick.get_text() for tick in axes.get_xticklabels()] == ["a", "b"]
    assert list(axes.lines[0].get_ydata()) == [1.5, 3.5]


def test_runs_that_a_logarithmic_axis_cannot_show_are_counted():
    count = iter([0.0, 1.0, -1.0, 2.0])
    measures = {"one": lambda run: next(count), "other": lambda run: 1.0}
    table = fk.sweep(measured, grid={"unit": [1.0]}, seeds=range(4), measures=measures, workers=1, progress=False)
    axes = table.plot("one", "other").axes[0]
    assert "2 of 4 runs drawn: others have no positive value" in texts(axes)
