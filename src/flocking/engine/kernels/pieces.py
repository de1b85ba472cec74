"""Piecewise formulas: a pair keeps the piece in force until its crossing of the border has been located.

A step across a border would average over two formulas, and its error estimate would be invalid. Conditions of a
piecewise formula are therefore evaluated at the distance clipped to the piece in force (``side``), while the piece
itself continues beyond its border at the true distance, as far as it is continuous. A piece that has no continuation is
evaluated at the distance clipped near the border (``reach``).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from flocking.model.checks import NO_LESS, Array

if TYPE_CHECKING:
    import sympy

Shape = Callable[..., Sequence[float]]
"""The formulas of one graph or group of obstacles: functions of distance, ``side``, ``reach`` and their parameters."""

Values = Callable[[float, float, float], list[float]]
"""Their values; one NaN where there are none."""

MARGIN = 1e-12
"""Relative distance from a border at which conditions are evaluated."""

STEP = 1e-4
"""Relative step over a border with which continuations are probed, and then a hundredth of it."""

FINER = 100
"""Ratio of the two distances from an edge at which its sides are compared: a gap linear in it falls as far."""

LEAST_SCALE = 1e-3
"""Borders nearer to 0 are probed as if they were at this distance, or at this share of the farthest border where that
is nearer than 1, so that the steps do not vanish."""

HALVED = 0.5
"""A gap that falls below this share when the step becomes a hundredth vanishes with the step: there is no jump."""

AGREED = 1e-9
"""Relative difference of values that counts as rounding of the formulas."""

FREE = (-np.inf, np.inf, -np.inf, np.inf)
"""Limits of ``side`` and ``reach`` that leave every condition to the distance itself."""


def held(formulas: Mapping[str, sympy.Expr], distance: str) -> tuple[dict[str, sympy.Expr], bool]:
    """Formulas whose pieces are chosen by ``side`` instead of the distance; whether there is such a piece.

    Parameters
    ----------
    formulas
        Expressions by name.
    distance
        Name of the distance.
    """
    import sympy

    def has_border(node: object) -> bool:
        return isinstance(node, sympy.Piecewise) and any(
            str(s) == distance for _, condition in node.args for s in condition.free_symbols
        )

    def changed(node: sympy.Basic) -> object:
        symbols = [s for s in node.free_symbols if str(s) == distance]
        inside = {s: sympy.Symbol("reach", **s.assumptions0) for s in symbols}
        asked = {s: sympy.Symbol("side", **s.assumptions0) for s in symbols}
        # A piece within a piece was changed before, from the inside out; only its condition must not change again.
        return sympy.Piecewise(*((v.xreplace(inside), c.xreplace(asked)) for v, c in node.args), evaluate=False)

    found = {name: formula.replace(has_border, changed) for name, formula in formulas.items()}
    return found, any(found[name] != formula for name, formula in formulas.items())


def piece_lines(distance: str) -> list[str]:
    """Source lines of a kernel's loop that set ``side`` and ``reach`` of pair ``e`` from its ``distance``."""
    return [
        "row = pieces[e]",
        f"side = min(max({distance}, spans[row, 0]), spans[row, 1])",
        f"reach = min(max({distance}, spans[row, 2]), spans[row, 3])",
    ]


def free_pieces(count: int) -> tuple[NDArray[np.int32], Array]:
    """Rows and limits of ``count`` pairs whose pieces the distance itself selects."""
    return np.zeros(count, dtype=np.int32), np.array([FREE])


def limits(borders: Sequence[float], formulas: Shape, parameters: Sequence[object] = ()) -> Array:
    """Limits of ``side`` and ``reach`` in the pieces that end at some borders, shape (borders, 4).

    Parameters
    ----------
    borders
        Distances at which pieces meet, ascending; the last may be infinite.
    formulas
        The formulas.
    parameters
        Their parameters.
    """

    def shape(distance: float, side: float, reach: float) -> list[float]:
        try:
            return [float(x) for x in formulas(distance, side, reach, *parameters)]
        except (ValueError, ArithmeticError, TypeError):
            return [math.nan]

    edges = [-math.inf, *borders]
    size = max((abs(float(x)) for x in borders if math.isfinite(x)), default=0.0)
    least = LEAST_SCALE * (size if 0.0 < size < 1.0 else 1.0)
    with np.errstate(all="ignore"):
        return np.array([_limits(low, high, shape, least) for low, high in pairwise(edges)])


def _limits(low: float, high: float, shape: Values, least: float) -> tuple[float, float, float, float]:
    inner = low + MARGIN * max(abs(low), NO_LESS) if math.isfinite(low) else -math.inf
    outer = high - MARGIN * max(abs(high), NO_LESS) if math.isfinite(high) else math.inf
    if not inner < outer:
        return FREE
    middle = min(max(0.5 * (inner + outer) if math.isfinite(inner + outer) else 0.0, inner), outer)
    found = []
    for edge, inwards in ((inner, 1.0), (outer, -1.0)):
        if not math.isfinite(edge):
            found.append((edge, edge))
        elif _goes_on(edge, inwards, middle if math.isfinite(middle) else edge, shape, least):
            found.append((edge, -inwards * math.inf))
        else:
            finite = all(map(math.isfinite, shape(edge, edge, edge)))
            found.append((edge, edge) if finite else (-inwards * math.inf, -inwards * math.inf))
    return found[0][0], found[1][0], found[0][1], found[1][1]


def _goes_on(edge: float, inwards: float, side: float, shape: Values, least: float) -> bool:
    """Whether the formulas of the piece around ``side`` are continuous beyond its edge."""
    scale = max(abs(edge), least)

    def gaps(step: float) -> list[tuple[float, float]]:
        """Differences over the edge, and the sizes of what differs; one pair of NaNs where there are no values."""
        before, after = (shape(d, side, d) for d in (edge + inwards * step * scale, edge - inwards * step * scale))
        return [(abs(b - a), abs(a) + abs(b)) for a, b in zip(before, after, strict=False)]

    return all(
        math.isfinite(coarse) and fine <= HALVED * coarse + AGREED * size
        for (coarse, size), (fine, _) in zip(gaps(STEP), gaps(STEP / FINER), strict=False)
    )
