"""Curves of functions: a potential with its slope, minimum, radius and jump, and any function of one variable."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, TypedDict

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import Array, number
from flocking.model.potentials.potential import Potential
from flocking.show.style import BLUE, GREEN, VERMILION, axes_or_new, in_style, theme

if TYPE_CHECKING:
    from matplotlib.axes import Axes

INSIDE = 1e-9
"""Share of an interval by which a curve is drawn inside its ends, where the formula may have poles."""

FARTHEST = 1e3
"""Distance up to which the minimum of a potential without a radius is looked for, a convention: in most units
distances of agents are near 1."""

NEAREST = 1e-6
"""Least distance at which the minimum is looked for, relative to the farthest; six decades show any."""

MINIMUM_ERROR = 1e-10
"""Relative error of the located minimum: far below the width of a line."""

SEARCHED = 4000
"""Distances at which a minimum is looked for, geometrically spaced, and as many evenly: some 650 a decade."""

BEFORE = 1e-12
"""Relative distance from a radius at which the value before a jump is read."""

JUMP = 1e-6
"""Change of a potential, by the height of the picture, that is drawn as a jump: smaller ones are below the width of a
line."""

HALF = 0.5
"""Half of the height of an axis over a constant, by the constant; of zero, in units of the axis."""

SAMPLES = 1200
"""Number of points of a curve: more than the pixels of its width."""


@in_style
def curve(
    function: Callable[[Array], Array],
    lower: float,
    upper: float,
    *,
    axes: Axes | None = None,
    breaks: Sequence[float] = (),
    focus: float | None = None,
    marks: Mapping[str, float] | None = None,
    variable: str = "$z$",
    label: str = "",
    color: str = BLUE,
    line: str = "-",
) -> Axes:
    """Draw any function of one variable.

    Parameters
    ----------
    function
        Maps an array to one of the same shape.
    lower, upper
        Ends of the interval.
    axes
        Axes to draw on; a new figure by default.
    breaks
        Points at which the function may jump; the line is interrupted there.
    focus
        Values beyond this point determine the vertical limits; all by default.
    marks
        Points marked by a dotted vertical line, by their labels.
    variable, label
        Labels of the axes.
    color, line
        Colour and style of the line.

    Raises
    ------
    InvalidInput
        If the interval is empty or the function is nowhere finite on it.
    """
    lower = number("curve", "lower", lower)
    upper = number("curve", "upper", upper, above=lower)
    axes = axes_or_new(axes)
    ends = [lower, *sorted(b for b in breaks if lower < b < upper), upper]
    drawn = []
    for begin, end in pairwise(ends):
        inner = (end - begin) * INSIDE
        x = np.linspace(begin + inner, end - inner, SAMPLES)
        with np.errstate(all="ignore"):
            y = np.asarray(function(x), dtype=np.float64) + np.zeros_like(x)
        y = np.where(np.isfinite(y), y, np.nan)
        axes.plot(x, y, color=color, ls=line, gid="curve")
        drawn.append(y if focus is None else np.where(x >= focus, y, np.nan))
    values = np.concatenate(drawn)
    if np.isnan(values).all():
        raise InvalidInput("curve", "function", "must be finite somewhere on the interval", (lower, upper))
    axes.set_xlim(lower, upper)
    axes.set_ylim(*_window(values))
    for text, place in (marks or {}).items():
        axes.axvline(place, color=theme().ink, lw=0.7, ls=":", gid="mark")
        axes.annotate(text, (place, 1.0), xycoords=("data", "axes fraction"), xytext=(0, 2), textcoords="offset points",
                      ha="center", va="bottom", fontsize=7)  # fmt: skip
    axes.set_xlabel(variable)
    axes.set_ylabel(label)
    return axes


class PotentialOptions(TypedDict, total=False):
    """Options of `potential` besides the potential and the axes, see there."""

    radius: float | None
    outside: float | None
    lower: float | None
    upper: float | None
    slope: bool


@in_style
def potential(
    psi: Potential,
    *,
    radius: float | None = None,
    outside: float | None = None,
    lower: float | None = None,
    upper: float | None = None,
    slope: bool = True,
    axes: Axes | None = None,
) -> Axes:
    """Draw a potential as in the papers, with its slope on a second axis.

    Parameters
    ----------
    psi
        The potential.
    radius
        Radius of interaction; the formula is drawn up to it.
    outside
        Constant value for distances above ``radius``; a jump to it is marked. Nothing is drawn there by default.
    lower, upper
        Ends of the interval; by default chosen from the radius, kinks and minimum.
    slope
        Whether to draw psi' as well.
    axes
        Axes to draw on; a new figure by default.

    Raises
    ------
    InvalidInput
        If the interval is empty, or the formula is nowhere finite on it.
    """
    if not isinstance(psi, Potential):
        raise InvalidInput("potential", "psi", "must be a Potential", psi)
    reach = np.inf if radius is None else number("potential", "radius", radius, above=0.0)
    kinks = [k for k in psi.kinks() if k < reach]
    low = 0.0 if lower is None else number("potential", "lower", lower, least=0.0)
    lowest = minimum(psi, low, reach)
    if upper is None:
        known = [radius * 1.25 if radius is not None else 0.0, *(1.25 * k for k in kinks[-1:])]
        upper = max(known) or (3.0 * lowest if lowest is not None else low + 5.0)
    end = number("potential", "upper", upper, above=low)
    inside = min(end, reach)
    marks = {} if lowest is None or lowest >= end else {f"$r = {lowest:.4g}$": lowest}
    if radius is not None and radius <= end:
        marks[f"$R = {radius:.4g}$"] = radius
    # Further left a singular potential only increases, which would flatten the well.
    focus = None if lowest is None or lowest >= end else 0.55 * lowest
    axes = curve(
        psi, low, inside, axes=axes, breaks=kinks, focus=focus, marks=marks, variable="$r$", label=r"$\psi(r)$"
    )
    axes.yaxis.label.set_color(BLUE)
    if lowest is not None and lowest < end:
        axes.plot([lowest], [float(psi(lowest))], "o", color=BLUE, ms=4, gid="minimum", zorder=4)
    if outside is not None and end > inside:
        _mark_outside(axes, psi, inside, end, number("potential", "outside", outside))
    if slope:
        beside = axes.twinx()
        curve(
            psi.slope,
            low,
            inside,
            axes=beside,
            breaks=kinks,
            focus=focus,
            color=VERMILION,
            line="--",
            label=r"$\psi'(r)$",
        )
        beside.set_ylim(*_slopes_in_view(psi, axes, low, inside))
        beside.spines["right"].set_visible(True)
        beside.axhline(0.0, color=VERMILION, lw=0.4, gid="zero")
        beside.yaxis.label.set_color(VERMILION)
        beside.set_xlabel("")
        if outside is not None and end > inside:
            beside.plot([inside, end], [0.0, 0.0], color=VERMILION, ls="--")
        beside.set_xlim(low, end)
    axes.set_xlim(low, end)
    return axes


def minimum(psi: Potential, lower: float, upper: float) -> float | None:
    """Distance of the lowest interior local minimum of a potential in (lower, upper), or None.

    Parameters
    ----------
    psi
        The potential.
    lower, upper
        Ends of the interval; ``upper`` may be infinite.
    """
    from scipy.optimize import minimize_scalar

    top = upper if np.isfinite(upper) else FARTHEST
    floor = max(lower, NEAREST * top)
    r = np.unique(np.concatenate([np.geomspace(floor, top, SEARCHED), np.linspace(floor, top, SEARCHED)]))[:-1]
    values = psi(r)
    dips = np.flatnonzero((values[1:-1] < values[:-2]) & (values[1:-1] <= values[2:])) + 1
    if len(dips) == 0:
        return None
    k = int(dips[np.argmin(values[dips])])
    found = minimize_scalar(lambda x: float(psi(x)), bounds=(r[k - 1], r[k + 1]), method="bounded",
                            options={"xatol": MINIMUM_ERROR * float(r[k])})  # fmt: skip
    return float(found.x)


def _mark_outside(axes: Axes, psi: Potential, inside: float, end: float, outside: float) -> None:
    axes.plot([inside, end], [outside, outside], color=BLUE, gid="outside")
    before = float(psi(inside * (1 - BEFORE)))
    if not np.isfinite(before):
        return
    low, high = axes.get_ylim()
    margin = 0.05 * (high - low)
    low, high = axes.set_ylim(min(low, outside - margin), max(high, outside + margin))
    if abs(before - outside) > JUMP * (high - low):
        axes.plot([inside, inside], [before, outside], color=GREEN, lw=1.4, gid="jump", zorder=4)
        axes.plot([inside], [before], "o", color=BLUE, mfc=theme().ground, ms=4, zorder=5)
        axes.plot([inside], [outside], "o", color=BLUE, ms=4, zorder=5)


def _slopes_in_view(psi: Potential, axes: Axes, low: float, high: float) -> tuple[float, float]:
    """Limits that cover the slope wherever the potential is visible."""
    r = np.linspace(low, high, SAMPLES)[1:-1]
    values, slopes = psi(r), psi.slope(r)
    bottom, top = axes.get_ylim()
    slopes = slopes[(values >= bottom) & (values <= top) & np.isfinite(slopes)]
    if slopes.size == 0:
        return -1.0, 1.0
    lowest, highest = min(float(slopes.min()), 0.0), max(float(slopes.max()), 0.0)
    margin = 0.06 * (highest - lowest) or 0.5
    return lowest - margin, highest + margin


def _window(values: Array) -> tuple[float, float]:
    """Vertical limits that cover the curve except near its poles."""
    finite = values[np.isfinite(values)]
    low, high = (float(x) for x in np.quantile(finite, [0.0, 1.0]))
    inner_low, inner_high = (float(x) for x in np.quantile(finite, [0.06, 0.94]))
    # Of a constant but for a few values all are shown.
    reach = inner_high - inner_low or high - low
    low, high = max(low, inner_low - 0.6 * reach), min(high, inner_high + 0.6 * reach)
    margin = 0.06 * (high - low) or HALF * abs(high) or HALF
    return low - margin, high + margin
