"""Certified crossings of fields of view: distance and bearing at once, as signs of Bernstein polynomials.

With d = q_j - q_i, heading h, radius r and c the cosine of the half angle, j is seen when D = r^2 - |d|^2 >= 0 and
d.h >= c |d|. With L = d.h and Q = L^2 - c^2 |d|^2 the second is (L >= 0 and Q >= 0) for c >= 0, and
(L >= 0 or Q <= 0) for c < 0: first moments of being seen or lost are first moments at which some of these
polynomials are all positive.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flocking.engine.exact.crossings.guards import _PRODUCT, places_and_pairs, squared_distance
from flocking.engine.kernels.bernstein import _DEPTH, NARROWEST, NEVER, add_row, all_rows, halve_interval, halve_top
from flocking.formula.native.functions import native
from flocking.model.checks import Array
from flocking.model.graphs.connectivity import Links


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


def _polynomials(B: Array, i: int, j: int, heading: Array, c: float, out: Array) -> None:
    """Bernstein coefficients of |d|^2, L and Q, shape (3, 15)."""
    squared_distance(B, i, j, out[0])
    for b in range(15):
        out[1, b], out[2, b] = 0.0, 0.0
    ahead = np.zeros(8)
    for a in range(8):
        for k in range(B.shape[2]):
            ahead[a] += (B[a, j, k] - B[a, i, k]) * heading[k]
    for a in range(8):
        for b in range(8):
            out[1, a + b] += _PRODUCT[a, b] * ahead[a]
            out[2, a + b] += _PRODUCT[a, b] * ahead[a] * ahead[b]
    for a in range(15):
        out[2, a] -= c * c * out[0, a]


def _change(near: bool, square: Array, L: Array, Q: Array, c: float, radius: float, slack: float) -> float:
    """Position at which a seen pair is lost, or an unseen one is seen."""
    wide = 4.0 * radius * slack + slack * slack
    border = (radius + slack) ** 2 if near else max(radius - slack, 0.0) ** 2
    one, other, two, three = np.empty((1, 15)), np.empty((1, 15)), np.empty((2, 15)), np.empty((3, 15))
    if near:
        for k in range(15):
            one[0, k] = square[k] - border
            two[0, k], two[1, k] = -L[k] - slack, Q[k] - wide
            other[0, k] = -Q[k] - wide
        first = first_all_above(one)
        if c < 0.0:
            return min(first, first_all_above(two))
        for k in range(15):
            one[0, k] = two[0, k]
        return min(first, first_all_above(one), first_all_above(other))
    for k in range(15):
        three[0, k], three[1, k], three[2, k] = border - square[k], L[k] - slack, Q[k] - wide
        two[0, k], two[1, k] = three[0, k], three[1, k]
    if c >= 0.0:
        return first_all_above(three)
    first = first_all_above(two)
    for k in range(15):
        two[1, k] = -Q[k] - wide
    return min(first, first_all_above(two))


def view_crossings(
    B: Array, far: Array, near: Links, headings: Array, cosines: Array, radii: Array, slack: float
) -> tuple[Array, NDArray[np.int64]]:
    """First change of every ordered pair that is seen or lost on the segment.

    Parameters
    ----------
    B
        Bernstein coefficients of the positions, shape (8, N, m).
    far
        See `flocking.engine.adaptive_steps.segment.Motion`.
    near
        Matrix (N, N): pairs that are seen now.
    cosines, radii
        Cosine of the half angle and radius of each sensing agent, shape (N,).
    slack
        Overshoot in distance that counts as a crossing; covers rounding.

    Returns
    -------
    tuple
        Crossing positions in [0, 1], shape (k,), and ordered pairs, shape (k, 2).
    """
    given = B, far, near, headings, cosines, radii, slack
    return places_and_pairs(all_rows(lambda found: int(_view_crossings(*given, found)), 3))


@native
def _view_crossings(
    B: Array, far: Array, near: Links, headings: Array, cosines: Array, radii: Array, slack: float, found: Array
) -> int:
    n = B.shape[1]
    count = 0
    out = np.empty((3, 15))
    for i in range(n):
        for j in range(n):
            if i == j:
                continue
            if not near[i, j]:
                d2 = 0.0
                for k in range(B.shape[2]):
                    d2 += (B[0, j, k] - B[0, i, k]) ** 2
                if d2 > (radii[i] + far[i] + far[j] + slack) ** 2:
                    continue
            _polynomials(B, i, j, headings[i], cosines[i], out)
            x = _change(near[i, j], out[0], out[1], out[2], cosines[i], radii[i], slack)
            if x <= 1.0:
                count = add_row(found, count, x, i, j)
    return count
