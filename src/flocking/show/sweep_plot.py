"""Common function for pictures of sweeps."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from flocking.errors import InvalidInput
from flocking.show.style import figure_of, save, themed
from flocking.show.sweep_pictures import against, bands, share_map
from flocking.study.sweeps.table import SweepTable

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


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
            "plot_sweep", "hue", f"must tell apart the values of {', '.join(others)}", hue,
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
