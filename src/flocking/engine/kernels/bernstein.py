"""Polynomials in Bernstein form on [0, 1]: they lie between their smallest and largest coefficient.

Halving the interval therefore either proves that a polynomial has no value above zero, or closes in on the first one.
Nothing between two samples can be missed.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flocking.model.checks import Array

NEVER = 2.0
"""Returned if nothing happens on [0, 1]."""

NARROWEST = 1e-15
"""Width at which an interval around a root is no longer halved: some units of rounding of a place in [0, 1]."""

NARROWEST_MINIMUM = 1e-12
"""The same for a minimum, whose value changes by the square of the width."""

FINEST = 1e-13
"""Relative accuracy of smallest values."""

_DEPTH = 80
"""Rows of the stack of intervals: each halving needs one more, and an interval of 1e-15 is reached after 50."""


def halve_top(stack: Array, top: int) -> None:
    """Replace the polynomial in row ``top`` of a ``stack`` by its two halves, the left one above."""
    size = stack.shape[1]
    for k in range(size):
        stack[top + 1, k] = stack[top, 0]
        for a in range(size - 1 - k):
            stack[top, a] = 0.5 * (stack[top, a] + stack[top, a + 1])


def halve_interval(begin: Array, width: Array, top: int) -> None:
    """Replace the interval in row ``top`` of a stack by its two halves, the left one above.

    Parameters
    ----------
    begin, width
        Begins and widths of the intervals.
    """
    half = 0.5 * width[top]
    begin[top + 1], width[top + 1] = begin[top], half
    begin[top], width[top] = begin[top] + half, half


def first_above(g: Array) -> float:
    """First x in [0, 1] at which the polynomial with Bernstein coefficients ``g`` exceeds zero, or `NEVER`."""
    size = g.shape[0]
    stack = np.empty((_DEPTH, size))
    begin = np.empty(_DEPTH)
    width = np.empty(_DEPTH)
    for k in range(size):
        stack[0, k] = g[k]
    begin[0], width[0] = 0.0, 1.0
    top = 0
    while top >= 0:
        possible = False
        for k in range(size):
            possible = possible or not stack[top, k] <= 0.0
        if not possible:
            top -= 1
            continue
        if stack[top, 0] > 0.0 or width[top] < NARROWEST or top + 2 >= _DEPTH:
            return float(begin[top])
        halve_top(stack, top)
        halve_interval(begin, width, top)
        top += 1
    return NEVER


def first_all_above(g: Array) -> float:
    """First x in [0, 1] at which all polynomials with Bernstein coefficients ``g``, shape (k, size), exceed zero.

    Returns `NEVER` when there is none. A stretch shorter than 1e-15 on which they do may be missed.
    """
    count, size = g.shape[0], g.shape[1]
    stack = np.empty((count, _DEPTH, size))
    begin = np.empty(_DEPTH)
    width = np.empty(_DEPTH)
    for k in range(count):
        for b in range(size):
            stack[k, 0, b] = g[k, b]
    begin[0], width[0] = 0.0, 1.0
    top = 0
    while top >= 0:
        possible, holds = True, True
        for k in range(count):
            above, number = False, True
            for b in range(size):
                above = above or stack[k, top, b] > 0.0
                number = number and stack[k, top, b] == stack[k, top, b]
            possible = possible and above and number
            holds = holds and stack[k, top, 0] > 0.0
        if holds:
            return float(begin[top])
        if not possible:
            top -= 1
            continue
        if width[top] < NARROWEST or top + 2 >= _DEPTH:
            at_end = True
            for k in range(count):
                at_end = at_end and stack[k, top, size - 1] > 0.0
            if at_end:
                return float(begin[top])
            top -= 1
            continue
        for k in range(count):
            halve_top(stack[k], top)
        halve_interval(begin, width, top)
        top += 1
    return NEVER


def smallest_value(g: Array, below: float) -> tuple[float, float]:
    """Smallest value of a Bernstein polynomial on [0, 1] if it is less than ``below``, and where.

    Returns ``(below, NEVER)`` when it is proved not to be, and (NaN, 0) where a coefficient is not finite. The
    value is exact to `FINEST` of its size.

    Parameters
    ----------
    g
        Bernstein coefficients, shape (degree + 1,).
    """
    size = g.shape[0]
    stack = np.empty((_DEPTH, size))
    begin = np.empty(_DEPTH)
    width = np.empty(_DEPTH)
    for k in range(size):
        stack[0, k] = g[k]
        # Of these no half would ever be left out.
        if not np.isfinite(g[k]):
            return np.nan, 0.0
    begin[0], width[0] = 0.0, 1.0
    top = 0
    best, where = below, NEVER
    while top >= 0:
        if stack[top, 0] < best:
            best, where = stack[top, 0], begin[top]
        if stack[top, size - 1] < best:
            best, where = stack[top, size - 1], begin[top] + width[top]
        least, possible = best - FINEST * abs(best), False
        for k in range(size):
            possible = possible or not stack[top, k] >= least
        if not possible or width[top] < NARROWEST_MINIMUM or top + 2 >= _DEPTH:
            top -= 1
            continue
        halve_top(stack, top)
        halve_interval(begin, width, top)
        top += 1
    return best, where


def part_from(g: Array, x: float) -> Array:
    """Bernstein coefficients, on [x, 1], of the polynomial with coefficients ``g``; the first is its value at x.

    Parameters
    ----------
    x
        Where the part begins (de Casteljau).
    """
    rest, work = np.empty(g.shape[0]), np.empty(g.shape[0])
    for k in range(g.shape[0]):
        work[k] = g[k]
    for size in range(g.shape[0] - 1, 0, -1):
        rest[size] = work[size]
        for k in range(size):
            work[k] += x * (work[k + 1] - work[k])
    rest[0] = work[0]
    return rest


def add_row(found: Array, count: int, x: float, i: int, j: int) -> int:
    """Store (x, i, j) behind ``count`` rows of ``found``, shape (room, 3), if it fits; returns the new count."""
    if count < found.shape[0]:
        found[count, 0], found[count, 1], found[count, 2] = x, i, j
    return count + 1


def all_rows(search: Callable[[Array], int], columns: int) -> Array:
    """All rows of a search.

    Parameters
    ----------
    search
        Fills an array with the rows that fit, and returns their total number.
    columns
        Length of a row.
    """
    room = 16
    while True:
        found = np.empty((room, columns))
        count = search(found)
        if count <= room:
            return found[:count]
        room = count
