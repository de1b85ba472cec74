"""Density maps of large flocks on a logarithmic scale."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from flocking.engine.runs.run import Run
from flocking.errors import InvalidInput
from flocking.formula.safe_digits import given_text
from flocking.model.checks import array, number
from flocking.model.space import OPEN
from flocking.model.state import State
from flocking.show.frames import (
    Outlined,
    changed_later,
    checked_outlines,
    checked_window,
    frame_at,
    own_obstacles,
    time_of,
)
from flocking.show.plane import draw_notes
from flocking.show.style import COLUMN, axes_or_new, in_style
from flocking.study.density_maps import DensityMap, density_map

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.colorbar import Colorbar
    from matplotlib.figure import Figure, SubFigure

ROUNDED = 1e-9
"""Relative difference by which a tick may lie below the scale and still be drawn."""

LEAST_EXTENT = 1e-12
"""Extent of a group along an axis that counts as the least, so that a group on a line has an area."""

COLORS = "inferno"
GROUND = "#000004"
"""The lowest colour of the map, for cells without agents."""
STONE, STONE_EDGE = "#4E6B78", "#A9C0CA"
"""Obstacles."""
SPAN = (0.3, 8.0)
"""Default range of densities relative to the reference."""
OUTLINE_POINTS = 91
"""Points of an obstacle's outline, four degrees apart on a circle: among cells corners are not seen."""
CELLS = 480
"""Default number of cells along the longer side of a picture: one for each dot of an axis 4.8 inches
long at 100 dots an inch, the resolution on a screen."""
MARGIN = 0.04
"""Margin around the group as a fraction of the side."""


@in_style
def density(
    what: Run | State | DensityMap,
    *,
    time: float | None = None,
    frame: int | None = None,
    axes: Axes | None = None,
    unit: float = 1.0,
    unit_name: str = "",
    reference: float | None = None,
    span: tuple[float, float] = SPAN,
    limits: tuple[Sequence[float], Sequence[float]] | None = None,
    cell: float | None = None,
    blur: float | None = None,
    obstacles: Sequence[Outlined] | None = None,
    title: str | bool = True,
    bar: bool = True,
) -> Axes:
    """Draw the density of agents in the plane.

    Parameters
    ----------
    what
        A run, a state, or a density map.
    time, frame
        Which stored frame of a run: the one nearest to ``time``, or its number; the last by default.
    axes
        Axes to draw on; a new figure by default.
    unit, unit_name
        Unit of length of the axes, and its name, such as ``"r"``.
    reference
        Unit of density; by default the median of the densities at the agents.
    span
        Lowest and highest density shown, relative to the reference.
    limits
        Lowest and highest corner of the picture; by default everything, and of a run in periodic space the box
        from 0 to its lengths. Beyond it the picture repeats.
    cell, blur
        Side of a cell of the map, and standard deviation of its smoothing; by default chosen from the picture's size.
    obstacles
        Objects with a method ``outline(count)``; by default those of the run's law at that time.
    title
        True for the time of a run or state, a text, or False for none.
    bar
        Whether to draw the scale of colours.

    Returns
    -------
    matplotlib.axes.Axes
        The axes; the shades have the label (gid) ``density``.

    Raises
    ------
    InvalidInput
        If the frame does not exist, agents are not in the plane, or a number is out of range.
    """
    from matplotlib.colors import LogNorm

    unit = number("density", "unit", unit, above=0.0)
    low, high = _checked_span(span)
    level = None if reference is None else number("density", "reference", reference, above=0.0)
    given = None if obstacles is None else checked_outlines("density", obstacles)
    made, stated, name = _mapped(what, time, frame, limits, cell, blur)
    level = _typical(made) if level is None else level
    axes = axes_or_new(axes, width=COLUMN, height=COLUMN)
    (left, down), (right, up) = made.low / unit, made.high / unit
    axes.set_facecolor(GROUND)
    shades = axes.imshow(
        np.clip(made.values / level, low, high), norm=LogNorm(low, high), cmap=COLORS, origin="lower",
        extent=(left, right, down, up), interpolation="bilinear", gid="density", zorder=0.2,
    )  # fmt: skip
    if given is not None:
        outlines = [o.outline(OUTLINE_POINTS) for o in given]
    else:
        found = own_obstacles(what) if isinstance(what, Run) else []
        outlines = [o.outline(OUTLINE_POINTS, stated.t) for o in found]
        draw_notes(axes, changed_later(what, stated.t) if found else [])
    for outline in outlines:
        axes.fill(*(np.asarray(outline).T / unit), facecolor=STONE, edgecolor=STONE_EDGE, lw=0.35, zorder=0.5)
    axes.set(xlim=(left, right), ylim=(down, up), aspect="equal")
    axes.set_xlabel(f"$x/{unit_name}$" if unit_name else "$x$")
    axes.set_ylabel(f"$y/{unit_name}$" if unit_name else "$y$")
    if bar:
        by = "median at agents" if reference is None else given_text(level)
        scale(axes.figure, shades, axes, low, high, f"density / {by}")
    if title is not False and (text := name if title is True else title):
        axes.set_title(text)
    return axes


@in_style
def scale(
    figure: Figure | SubFigure,
    shades: ScalarMappable,
    axes: Axes | list[Axes],
    low: float,
    high: float,
    label: str = "density",
) -> Colorbar:
    """Draw the colour bar beside axes, with few tick labels.

    Parameters
    ----------
    figure
        The figure.
    shades
        The mappable of `density`.
    axes
        Axes beside which it is drawn, one or several.
    low, high
        Ends of the scale.
    label
        Its label.
    """
    from matplotlib.ticker import NullFormatter

    drawn = figure.colorbar(shades, ax=axes, label=label, shrink=0.85, pad=0.015, aspect=28)
    ticks = [x for x in (0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0) if low <= x * (1 + ROUNDED) <= high * 1.001]
    drawn.set_ticks(ticks, labels=[f"{x:g}" for x in ticks])
    drawn.ax.yaxis.set_minor_formatter(NullFormatter())
    return drawn


def _mapped(
    what: object,
    time: float | None,
    frame: int | None,
    limits: tuple[Sequence[float], Sequence[float]] | None,
    cell: float | None,
    blur: float | None,
) -> tuple[DensityMap, State, str]:
    """The map, its state (an empty one for a given map), and its title."""
    if isinstance(what, DensityMap):
        for word, value in (("time", time), ("frame", frame), ("limits", limits), ("cell", cell), ("blur", blur)):
            if value is not None:
                raise InvalidInput("density", word, "must be absent for a density map", value)
        return what, State(np.zeros((1, 2)), np.zeros((1, 2))), ""
    if isinstance(what, Run):
        state = what.state(frame_at(what, time, frame))
    elif isinstance(what, State):
        state = what
    else:
        raise InvalidInput("density", "what", "must be a Run, a State or a DensityMap", what)
    if state.dimension != 2:
        raise InvalidInput("density", "what", "must be in the plane", state.dimension, "Draw a projection of it.")
    space = what.scenario.space if isinstance(what, Run) else OPEN
    lengths = np.array([*space.lengths, np.inf, np.inf][:2])
    repeats = np.isfinite(lengths)
    sides = np.where(repeats, lengths, np.ptp(state.q, axis=0))
    if limits is None:
        low = np.where(repeats, 0.0, state.q.min(axis=0))
        margin = np.where(repeats, 0.0, MARGIN * float(sides.max()) or 1.0)
        low, high = low - margin, low + sides + margin
    else:
        low, high = checked_window("density", limits, 2)
    size = float((high - low).max()) / CELLS if cell is None else number("density", "cell", cell, above=0.0)
    # A few agents per spot: a smaller blur shows single agents, a larger one hides narrow structures.
    area = float(np.prod(np.maximum(sides, LEAST_EXTENT)))
    width = max(size, float(np.sqrt(area / state.n))) if blur is None else number("density", "blur", blur, least=0.0)
    made = density_map(state.q, low=low, high=high, cell=size, blur=width, space=space)
    return made, state, f"$t = {time_of(what, state.t)}$"


def _checked_span(span: object) -> tuple[float, float]:
    found = array("density", "span", span, ndim=1)
    if found.shape != (2,):
        raise InvalidInput("density", "span", "must be the lowest and the highest density", span)
    return number("density", "span", found[0], above=0.0), number("density", "span", found[1], above=float(found[0]))


def _typical(made: DensityMap) -> float:
    """Median of the densities at the agents."""
    values = np.sort(made.values.ravel())
    total = np.cumsum(values)
    return float(values[np.searchsorted(total, total[-1] / 2)]) if total[-1] > 0 else 1.0
