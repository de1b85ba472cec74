"""Pictures of sweeps: fractions as a map, means with confidence intervals as curves, one measure against another."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from flocking.errors import InvalidInput
from flocking.formula.safe_digits import compared_texts, nearest_text, rounded_down, rounded_up
from flocking.show.style import PALETTE, axes_or_new, figure_of, in_style, save, theme, themed
from flocking.study.sweeps.plan import label, stand_for_themselves

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from flocking.study.sweeps.table import SweepTable

LINES, DOTS = ("-", "--", ":", "-."), "o^sD"
"""Dashes of curves and shapes of dots, others after each round of the colours, so that no two values look alike."""

MOST_TICKS = 8
"""Largest number of values of an axis with a tick each; more labels would overlap."""

NOTE, NOTE_POINTS = 60, 8
"""Letters in a line of a note above axes, and the height of a line in points: letters of six points fit the width of
axes on half a page."""


def _need_grid(table: SweepTable, *names: str) -> None:
    for name in names:
        if name not in table.plan.grid:
            raise InvalidInput("sweep picture", "axis", f"must be one of {', '.join(table.plan.grid)}", name)


def _of_plane(table: SweepTable, *names: str | None) -> xarray.Dataset:
    """Means over these parameters; others that have a single value are no axis.

    Raises
    ------
    InvalidInput
        When there are several drawn points, whose values are no grid.
    """
    single = [name for name, values in table.plan.grid.items() if name not in names and len(values) == 1]
    if table.plan.sample is not None:
        if table.plan.sample.count > 1:
            raise InvalidInput(
                "sweep picture", "table", "must have no drawn points where a parameter is an axis",
                f"{table.plan.sample.count} points of {', '.join(table.plan.drawn)}",
                "Plot a measure over a measure, or take the values from table.columns.",
            )  # fmt: skip
        single.append("sample")
    return table.summary().isel(dict.fromkeys(single, 0))


def _note_missing(axes: Axes, table: SweepTable, found: xarray.Dataset, measure: str) -> None:
    """Write above the axes why some means of a measure have no interval, and of how many runs they are not."""
    methods = [str(method) for method in np.asarray(found[f"{measure}_interval"]).ravel()]
    reasons = sorted({method.removeprefix("none: ") for method in methods if method.startswith("none: ")})
    words = [f"no 95 % interval: {reasons[0]}", *reasons[1:]] if reasons else []
    counted, made = (int(found[name].sum()) for name in (f"{measure}_count", "different"))
    if counted < made:
        # A share is then no mean of the others, see `SweepTable.summary`.
        words.append(
            f"{made - counted} of {made} runs " + ("unknown" if table.is_share(measure) else "without a value")
        )
    if (runs := int(found["runs"].sum())) > made:
        words.append(f"{runs} runs, {made} different")
    if words:
        lines = _joined(words)
        axes.text(1.0, 1.01, "\n".join(lines), transform=axes.transAxes, ha="right", va="bottom", fontsize=6,
                  gid="no interval")  # fmt: skip
        axes.set_title(axes.get_title(), pad=6 + NOTE_POINTS * len(lines))


def _joined(words: list[str]) -> list[str]:
    """Parts of a note in lines that fit above axes."""
    lines = [words[0]]
    for word in words[1:]:
        lines[-1] += ";"
        if len(lines[-1]) + 1 + len(word) <= NOTE:
            lines[-1] += f" {word}"
        else:
            lines.append(word)
    return lines


def _look(number: int) -> tuple[str, int]:
    """Colour of a value by its number, and how often the colours were all used before it."""
    turn, place = divmod(number, len(PALETTE))
    if turn >= len(LINES):
        raise InvalidInput(
            "sweep picture", "hue", f"must have at most {len(LINES) * len(PALETTE)} values, that look different",
            number + 1, "Name another parameter as hue, or draw fewer values.",
        )  # fmt: skip
    return PALETTE[place], turn


@in_style
def share_map(
    table: SweepTable,
    measure: str,
    x: str,
    y: str,
    *,
    x_label: str = "",
    y_label: str = "",
    title: str = "",
    axes: Axes | None = None,
) -> Axes:
    """A mean over two parameters as coloured cells, labelled with value and interval.

    Parameters
    ----------
    table
        Results of a sweep over a grid of two parameters.
    measure
        The measure shown; a fraction for a boolean measure.
    x, y
        The parameters.
    x_label, y_label, title
        Text; the names by default.
    axes
        Axes to draw on; a new figure by default.

    Raises
    ------
    InvalidInput
        If a parameter is not in the grid.
    """
    _need_grid(table, x, y)
    axes = axes_or_new(axes, width=4.6)
    found = _of_plane(table, x, y).transpose(y, x, ...)
    means, lows, highs = (np.asarray(found[measure + end]) for end in ("", "_low", "_high"))
    made = np.asarray(found["runs"])
    known = means[np.isfinite(means)]
    least, top = float(known.min(initial=0.0)), float(known.max(initial=0.0))
    share = table.is_share(measure)
    top = 1.0 if share or least == top else top
    mesh = axes.imshow(means, origin="lower", aspect="auto", cmap="cividis", vmin=least, vmax=top)
    for (row, column), value in np.ndenumerate(means):
        ink = "white" if value < least + 0.55 * (top - least) else "black"
        low, high = lows[row, column], highs[row, column]
        ends = f"{rounded_down(low, 3)}–{rounded_up(high, 3)}" if np.isfinite(low) else "no interval"
        # What is less than all is not read as all.
        middle = compared_texts(value, 1.0)[0] if share else nearest_text(value, 3)
        if np.isnan(value):
            middle = "no run" if not made[row, column] else "unknown" if np.isfinite(low) else "no value"
        text = middle if middle.startswith("no ") else f"{middle}\n{ends}"
        axes.text(column, row, text, ha="center", va="center", color=ink, fontsize=6)
    for name, set_ticks in ((x, axes.set_xticks), (y, axes.set_yticks)):
        values = table.plan.grid[name]
        set_ticks(range(len(values)), [label(v) for v in values])
    axes.set_xlabel(x_label or x)
    axes.set_ylabel(y_label or y)
    axes.set_title(title)
    axes.figure.colorbar(mesh, ax=axes, fraction=0.05, pad=0.02)
    _note_missing(axes, table, found, measure)
    return axes


@in_style
def bands(
    table: SweepTable,
    measure: str,
    x: str,
    *,
    by: str | None = None,
    shown: Callable[[object], str] = label,
    x_label: str = "",
    y_label: str = "",
    title: str = "",
    runs: bool = False,
    axes: Axes | None = None,
) -> Axes:
    """Mean against one parameter with its interval, one curve for each value of another.

    Parameters
    ----------
    table
        Results of a sweep over a grid.
    measure
        What is shown.
    x
        The parameter along the axis.
    by
        The parameter of the curves; one curve by default.
    shown
        Text of a value of ``by`` in the legend.
    x_label, y_label, title
        Text; the names by default.
    runs
        Whether to show every run as a dot.
    axes
        Axes to draw on; a new figure by default.

    Raises
    ------
    InvalidInput
        If a parameter is not in the grid.
    """
    _need_grid(table, x, *([by] if by else []))
    axes = axes_or_new(axes, width=4.2)
    found = _of_plane(table, x, by)
    values = table.plan.grid[x]
    counted = stand_for_themselves(values) and not isinstance(values[0], str | bool)
    # Texts and parts stand side by side.
    places = np.asarray(values if counted else range(len(values)), dtype=float)
    order = np.argsort(places, kind="stable")
    places, found = places[order], found.isel({x: order})
    for k, value in enumerate(table.plan.grid[by] if by else [None]):
        own = found.isel({by: k}) if by else found
        color, turn = _look(k)
        middle, low, high = (np.asarray(own[measure + end]) for end in ("", "_low", "_high"))
        axes.plot(places, middle, LINES[turn], marker="o", color=color, ms=3, label=shown(value) if by else None)
        axes.fill_between(places, low, high, color=color, alpha=0.2, lw=0)
        # A band is drawn between neighbours that both have an interval; an error bar shows isolated ones.
        axes.vlines(places, low, high, color=color, lw=0.8)
        if runs:
            data = table.dataset[measure]
            data = (data.isel({by: k}) if by else data).isel({x: order})
            each = np.asarray(data.transpose(x, ...)).reshape(len(places), -1)
            axes.plot(np.repeat(places, each.shape[1]), each.ravel(), ".", color=theme().faint, ms=2, zorder=0)
    if by:
        axes.legend(title=by)
    if not counted:
        axes.set_xticks(places, [label(v) for v in values])
    elif len(places) <= MOST_TICKS:
        axes.set_xticks(places)
    axes.set_xlabel(x_label or x)
    axes.set_ylabel(y_label or measure)
    axes.set_title(title)
    _note_missing(axes, table, found, measure)
    return axes


@in_style
def against(
    table: SweepTable,
    x: str,
    y: str,
    *,
    by: str | None = None,
    shown: Callable[[object], str] = label,
    x_label: str = "",
    y_label: str = "",
    title: str = "",
    axes: Axes | None = None,
) -> Axes:
    """One measure against another, a dot per run on logarithmic axes, with the line where they are equal.

    Parameters
    ----------
    table
        Results of a sweep.
    x, y
        The measures.
    by
        A parameter of the grid that colours the dots.
    shown
        Text of a value of ``by`` in the legend.
    x_label, y_label, title
        Text; the names by default.
    axes
        Axes to draw on; a new figure by default.

    Raises
    ------
    InvalidInput
        If a name is not in the sweep.
    """
    _need_grid(table, *([by] if by else []))
    axes = axes_or_new(axes, width=4.2, height=3.6)
    pairs = np.array([(a, b) for a, b in zip(table.values(x).ravel(), table.values(y).ravel(), strict=True)])
    order = sorted(table.rows)
    here = {index: pairs[index] for index in order}
    for k, value in enumerate(table.plan.grid[by] if by else [None]):
        # Of values that are no numbers, as of arrays, the texts are equal where these are.
        chosen = [here[r] for r in order if by is None or label(table.plan.task(r).parameters[by]) == label(value)]
        dots, (color, turn) = np.array(chosen).reshape(-1, 2), _look(k)
        axes.plot(dots[:, 0], dots[:, 1], DOTS[turn], ms=2.5, alpha=0.7, mew=0, color=color,
                  label=shown(value) if by else None)  # fmt: skip
    drawn = np.array([here[r] for r in order]).reshape(-1, 2)
    drawn = drawn[(np.isfinite(drawn) & (drawn > 0)).all(axis=1)]
    if len(drawn):
        ends = np.array([drawn.min(), drawn.max()])
        axes.plot(ends, ends, color=theme().ink, lw=0.8, ls="--")
    if len(drawn) < len(order):
        # A logarithmic axis has no place for zero, and a run that failed has no value.
        said = f"{len(drawn)} of {len(order)} runs drawn: others have no positive value"
        axes.text(1.0, 1.01, said, transform=axes.transAxes, ha="right", va="bottom", fontsize=6, gid="left out")
    axes.set_xscale("log")
    axes.set_yscale("log")
    if by:
        axes.legend(title=by)
    axes.set_xlabel(x_label or x)
    axes.set_ylabel(y_label or y)
    axes.set_title(title)
    return axes


def plot_sweep(
    table: SweepTable, x: str, y: str, hue: str | None = None, *, save_as: str | Path | None = None,
    theme: str = "light",
) -> Figure:  # fmt: skip
    """Draw the results of a sweep.

    Parameters
    ----------
    table
        The results.
    x, y
        A parameter and a measure: means with their 95 % intervals over the parameter. Two measures: a dot for each run.
        Two parameters: a map of the measure ``hue``.
    hue
        A parameter: one curve, or one colour of dots, for each of its values. Of a map the measure.
    save_as
        As in `flocking.plot`.
    theme
        ``"light"`` or ``"dark"``.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.

    Raises
    ------
    InvalidInput
        If a name is neither a parameter of the sweep's grid nor a measure, or they do not go together.
    """
    from flocking.study.sweeps.table import SweepTable

    if not isinstance(table, SweepTable):
        raise InvalidInput("plot_sweep", "table", "must be the result of a sweep", table, "Use fk.sweep(...).")
    with themed(theme):
        made = figure_of(_drawn(table, x, y, hue))
        if save_as is not None:
            save(made, save_as)
    return made


def _drawn(table: SweepTable, x: str, y: str, hue: str | None) -> Axes:
    parameters, measures = tuple(table.plan.grid), table.measures
    for name, value in (("x", x), ("y", y), *([("hue", hue)] if hue is not None else [])):
        if value not in (*parameters, *measures):
            known = f"{', '.join(parameters)} (parameters), {', '.join(measures)} (measures)"
            raise InvalidInput("plot_sweep", name, f"must be one of {known}", value)
    curve = hue is None or hue in parameters
    others = [name for name in parameters if name not in (x, y, hue) and len(table.plan.grid[name]) > 1]
    if x in parameters and others:
        raise InvalidInput(
            "plot_sweep", "hue", f"must distinguish the values of {', '.join(others)}", hue,
            "A mean over values of a parameter is that of no population: name the parameter as hue.",
        )  # fmt: skip
    if x in parameters and y in measures and curve:
        return bands(table, y, x, by=hue, x_label=x, y_label=y)
    if x in measures and y in measures and curve:
        return against(table, x, y, by=hue, x_label=x, y_label=y)
    if x in parameters and y in parameters and x != y and hue in measures:
        return share_map(table, str(hue), x, y, x_label=x, y_label=y, title=str(hue))
    rule = "must be a measure over a parameter or over a measure, or a parameter over a parameter with a measure as hue"
    raise InvalidInput("plot_sweep", "x, y, hue", rule, (x, y, hue))
