"""The vector from an agent to another, as lines of generated code: the one place where kernels subtract positions.

Rows of pairs that are too far apart are passed over whole.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from flocking.arrays import Array, Links

if TYPE_CHECKING:
    import sympy

Periods = Sequence["sympy.Symbol | None"]
"""Symbol of the length after which each axis repeats; None where it does not."""


def displacement_lines(
    periods: Periods,
    neighbour: Callable[[int], str] = lambda k: f"q[j, {k}]",
    own: Callable[[int], str] = lambda k: f"q[i, {k}]",
) -> list[str]:
    """Lines that compute ``d0...``, the displacement of agent ``j`` from agent ``i`` in arrays ``q``.

    Parameters
    ----------
    periods
        Those of the axes.
    neighbour, own
        Expressions of each coordinate of the two.
    """
    lines = [f"d{k} = {neighbour(k)} - {own(k)}" for k in range(len(periods))]
    # A tie goes away from zero in both directions, so that d_ji = -d_ij to the last bit; see Periodic.
    return lines + [
        f"d{k} = d{k} - {period} * math.copysign(math.floor(math.fabs(d{k}) / {period} + 0.5), d{k})"
        for k, period in enumerate(periods)
        if period is not None
    ]


def nearest_difference(difference: float, length: float) -> float:
    """A ``difference`` of coordinates to the nearest image along an axis of a ``length``, for native functions."""
    return difference - length * math.copysign(math.floor(math.fabs(difference) / length + 0.5), difference)


def closer_in_row(
    axes: Array, far: Array, linked: Links, i: int, linked_reach: float, reach: float, squares: Array
) -> int:
    """How many pairs (i, j) with j > i may come closer than some distances, by loops over vectors; for native code.

    Parameters
    ----------
    axes
        Positions now, shape (m, N).
    far
        Bound on the displacement of each agent, shape (N,).
    linked
        Links, shape (N, N).
    linked_reach, reach
        The distance for pairs linked as (i, j); that for others, as large as any: some may be linked as (j, i).
    squares
        Room for N numbers.
    """
    n = far.shape[0]
    for j in range(i + 1, n):
        squares[j] = 0.0
    for k in range(axes.shape[0]):
        for j in range(i + 1, n):
            squares[j] += (axes[k, j] - axes[k, i]) ** 2
    count = 0
    for j in range(i + 1, n):
        level = linked_reach if linked[i, j] else reach
        count += 0 if squares[j] > (level + far[i] + far[j]) ** 2 else 1
    return count


def period_lines(k: int, period: str) -> list[str]:
    """Lines before the loops of a vectorised kernel, in its precision ``T``, see `nearest_image_line`.

    Parameters
    ----------
    k
        Number of the axis.
    period
        Name of the length after which it repeats.
    """
    return [f"period{k} = T({period})", f"per_period{k} = T(1.0 / {period})"]


def nearest_image_line(k: int) -> str:
    """Line of a vectorised kernel that moves a difference of positions along axis ``k`` to the nearest image.

    A tie at half a length goes up, in both directions: no link is so long.
    """
    return f"d{k} = d{k} - period{k} * floor_of(d{k} * per_period{k} + T(0.5))"
