"""What pictures of a sweep say of values that nobody knows, of runs left out, and of values that are no numbers."""

from __future__ import annotations

import math

import numpy as np
import pytest

import flocking as fk
from flocking.show.margin_pictures import margins_figure
from flocking.study.margins.brackets import Count
from flocking.study.margins.margin_table import Margins, Varied
from tests.study.sweeps.sweep_cases import make


def sweep(grid, measures, seeds=8, made=None, **options):
    def plain(seed, **given):
        return make(seed=seed)

    return fk.sweep(made or plain, grid=grid, seeds=seeds, measures=measures, workers=1, progress=False, **options)


def texts(axes):
    return [text.get_text() for text in axes.texts]


GRID = {"x": [1.0, 2.0], "y": [1, 2]}
UNKNOWN = {
    # Four of eight seeds are even: nobody knows of the others whether they are true.
    "unknown": (lambda run: False if run.scenario.seed % 2 == 0 else math.nan, "unknown\n0–"),
    "never": (lambda run: math.nan, "no value"),
    "endless": (lambda run: math.inf, "inf\nno interval"),
}


@pytest.mark.parametrize("name", UNKNOWN)
def test_cells_without_a_mean_say_why(name):
    measure, words = UNKNOWN[name]
    axes = sweep(GRID, {name: measure}, seeds=range(8)).plot("x", "y", name).axes[0]
    assert all(text.startswith(words) for text in texts(axes)[:4])


def test_a_cell_without_runs_says_so():
    def made(seed, x, y):
        if (x, y) == (2.0, 2):
            raise KeyboardInterrupt
        return make(seed=seed)

    table = sweep(GRID, {"one": lambda run: float(run.scenario.seed)}, seeds=range(8), made=made)
    assert table.status == "interrupted"
    cells = texts(table.plot("x", "y", "one").axes[0])[:4]
    assert [text == "no run" for text in cells] == [False, False, False, True]


def test_runs_without_a_value_are_counted_above_the_means():
    late = {"late": lambda run: float(run.scenario.seed) if run.scenario.seed < 6 else math.nan}
    axes = sweep({"x": [1.0, 2.0]}, late, seeds=range(8)).plot("x", "late").axes[0]
    assert [text for text in texts(axes) if "4 of 16 runs without a value" in text]
    assert not texts(
        sweep({"x": [1.0, 2.0]}, {"n": lambda run: float(run.scenario.seed)}, range(8)).plot("x", "n").axes[0]
    )


def test_a_note_above_the_means_is_not_cut_off():
    """One value, two, ... of each point: as many reasons why there is no interval."""
    some = {"some": lambda run: float(run.scenario.seed) if run.scenario.seed < made["limit"] else math.nan}
    made = {"limit": 0}

    def limited(seed, x):
        made["limit"] = x
        return make(seed=seed)

    figure = sweep({"x": [1, 2, 3, 4, 5]}, some, seeds=range(6), made=limited).plot("x", "some")
    figure.draw_without_rendering()
    (note,) = [text for text in figure.axes[0].texts if text.get_gid() == "no interval"]
    reasons = [f"{count} value{'s' * (count > 1)}, 8 needed" for count in range(1, 6)]
    assert all(reason in note.get_text() for reason in reasons)
    assert "15 of 30 runs without a value" in note.get_text()
    around, inside = figure.bbox, note.get_window_extent()
    assert around.x0 <= inside.x0 < inside.x1 <= around.x1
    assert around.y0 <= inside.y0 < inside.y1 <= around.y1


def test_runs_of_one_scenario_are_told():
    def made(seed, x):
        return make(seed=0)

    axes = sweep({"x": [1.0, 2.0]}, {"true": lambda run: True}, made=made).plot("x", "true").axes[0]
    assert [text for text in texts(axes) if "16 runs, 2 different" in text]


@pytest.mark.parametrize("values", [[None, 2, "3"], [[1, 2], [3, 4]], [np.arange(3), np.arange(3) + 1], [True, 2]])
def test_dots_of_values_that_are_no_numbers_are_drawn(values):
    measures = {"a": lambda run: 1.0 + run.scenario.seed, "b": lambda run: 2.0 + run.scenario.seed}
    axes = sweep({"kind": values}, measures, seeds=range(5)).plot("a", "b", "kind").axes[0]
    dots = [line for line in axes.lines if not line.get_label().startswith("_")]
    assert [len(line.get_xdata()) for line in dots] == [5] * len(values)


def test_curves_follow_their_axis_in_any_order_of_the_grid():
    table = sweep({"x": [3.0, 1.0, 2.0]}, {"seed_of_run": lambda run: float(run.scenario.seed)}, seeds=8)
    means = table.summary()["seed_of_run"]
    (line, *_) = table.plot("x", "seed_of_run").axes[0].lines
    assert line.get_xdata().tolist() == [1.0, 2.0, 3.0]
    assert line.get_ydata() == pytest.approx([float(means.sel(x=x)) for x in (1.0, 2.0, 3.0)])


def test_drawn_points_are_no_axis():
    measures = {"a": lambda run: float(run.scenario.seed), "b": lambda run: 1.0}
    table = sweep({"x": [1.0, 2.0]}, measures, seeds=[1], sample=fk.Sample("latin", 4, {"z": (0.0, 1.0)}))
    with pytest.raises(
        fk.InvalidInput, match="must have no drawn points where a parameter is an axis; got '4 points of z'"
    ):
        table.plot("x", "a")
    assert table.plot("a", "b", "x").axes
    one = sweep({"x": [1.0, 2.0]}, measures, seeds=[1], sample=fk.Sample("latin", 1, {"z": (0.0, 1.0)}))
    assert one.plot("x", "a").axes


def test_levels_of_margins_are_told_apart():
    one = Varied("period", "how long", "held", {"agree": {0.5511: Count(4), 0.5512: Count(0, 4)}})
    table = Margins("four", {"agree": ""}, {"agree": Count(4)}, (one,), {}, 1.0, 0.01, 0.95, (0, 1), 12, "finished")
    figure = margins_figure(table)
    assert [tick.get_text() for tick in figure.axes[0].get_xticklabels()] == ["ideal", "0.5511", "0.5512"]


def test_a_table_in_a_notebook_tells_values_apart():
    shown = sweep({"x": [1.00001, 1.00002]}, {"one": lambda run: 1.0 / 3.0}, seeds=1)._repr_html_()
    assert all(text in shown for text in (">1.00001<", ">1.00002<", ">0.3333<"))


def test_no_two_values_look_alike():
    measures = {"a": lambda run: 1.0 + run.scenario.seed, "b": lambda run: 2.0 + run.scenario.seed}
    table = sweep({"x": [1.0, 2.0], "kind": list(range(20))}, measures, seeds=range(2))
    for axes in (table.plot("x", "a", "kind").axes[0], table.plot("a", "b", "kind").axes[0]):
        looks = {
            line.get_label(): (line.get_color(), line.get_linestyle(), line.get_marker())
            for line in axes.lines
            if not line.get_label().startswith("_")
        }
        assert len(looks) == len(set(looks.values())) == 20
    many = sweep({"x": [1.0], "kind": list(range(60))}, measures, seeds=range(1))
    with pytest.raises(fk.InvalidInput, match="hue must have at most"):
        many.plot("x", "a", "kind")


def test_truth_values_on_an_axis_are_words():
    table = sweep({"whole": [True, False]}, {"seed_of_run": lambda run: float(run.scenario.seed)}, seeds=8)
    axes = table.plot("whole", "seed_of_run").axes[0]
    assert [tick.get_text() for tick in axes.get_xticklabels()] == ["true", "false"]
    assert axes.lines[0].get_ydata() == pytest.approx(table.summary()["seed_of_run"].to_numpy())
