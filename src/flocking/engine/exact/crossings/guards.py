"""Certified roots on a segment: when a pair first crosses a distance, and how close a pair comes.

Squared distances on a segment are polynomials of degree 14. In Bernstein form they lie between their
smallest and largest coefficient, so halving the interval either proves that there is no crossing or
closes in on the first one. Nothing between two samples can be missed.
"""

from __future__ import annotations

from math import comb

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import Indices
from flocking.engine.exact.crossings.nearby_pairs import BASE, NearbyPairs, all_pairs
from flocking.engine.kernels.bernstein import (
    NEVER,
    add_row,
    all_rows,
    first_above,
    part_from,
    smallest_value,
)
from flocking.engine.kernels.displacements import closer_in_row
from flocking.formula.native.functions import native, native_apart
from flocking.model.checks import Array
from flocking.model.graphs.connectivity import Links

DIP = 0.25
"""A squared distance that falls below this share of the smaller one at the ends is a dip: half the distance."""


FAR = 1e3
"""Share of the square of a border above which squares of distances have too few digits of it."""

ROUNDED_SQUARES = 32.0 * float(np.finfo(np.float64).eps)
"""Share of the largest of their coefficients by which rounding changes values of squared distances at most."""

_PRODUCT = np.array([[comb(7, a) * comb(7, b) / comb(14, a + b) for b in range(8)] for a in range(8)])
_RETRIES = 20
"""Number of times a crossing is sought further on if the velocities disagree. Each time passes a place at which a
polynomial of degree 14 rises through zero, of which there are at most 7.
"""


def squared_distance(B: Array, i: int, j: int, out: Array) -> None:
    """Bernstein coefficients ``out``, shape (15,), of the squared distance of agents i and j; B has shape (8, N, m)."""
    for a in range(15):
        out[a] = 0.0
    for a in range(8):
        for b in range(8):
            dot = 0.0
            for k in range(B.shape[2]):
                dot += (B[a, j, k] - B[a, i, k]) * (B[b, j, k] - B[b, i, k])
            out[a + b] += _PRODUCT[a, b] * dot


def _first_above_from(g: Array, x: float) -> float:
    """First place in [x, 1] at which the polynomial with Bernstein coefficients ``g`` exceeds zero, or `NEVER`."""
    found = first_above(part_from(g, x))
    return x + found * (1.0 - x) if found <= 1.0 else NEVER


def _moving_so(square: Array, x: float, B: Array, P: Array, i: int, j: int, sign: float) -> float:
    """First place from ``x`` on at which ``square`` is above zero and the pair moves apart, or, by ``sign``, closer."""
    rate = np.zeros(15)
    for a in range(8):
        for b in range(8):
            dot = 0.0
            for k in range(B.shape[2]):
                dot += (B[a, j, k] - B[a, i, k]) * (P[b, j, k] - P[b, i, k])
            rate[a + b] += _PRODUCT[a, b] * sign * dot
    for _ in range(_RETRIES):
        if x > 1.0 or part_from(rate, x)[0] >= 0.0:
            return x
        x = _first_above_from(rate, x)
        if x > 1.0 or part_from(square, x)[0] > 0.0:
            return x
        x = _first_above_from(square, x)
    return NEVER


def on_border(relative: Array, square: Array, border: float, x: float, sign: float) -> float:
    """Where a pair is at a border, from the place ``x`` at which its squared distance is, up to rounding.

    Squares of distances far above the border leave few digits of it. By the distance itself, which has more, the place
    is found again; it stays where that leads no nearer, or to where the pair moves the other way.

    Parameters
    ----------
    relative
        Bernstein coefficients of the vector between the two, shape (8, m).
    square
        Those of what its square exceeds that of the border by, or less, shape (15,).
    border
        The border; positive.
    x
        The place.
    sign
        1 where the two come to the border from below, -1 from above.
    """
    largest = 0.0
    for k in range(15):
        largest = max(largest, abs(square[k]))
    if not largest > FAR * border * border:
        return x
    axis, found, missed = np.empty(8), x, np.inf
    for _ in range(_RETRIES):
        apart2, along = 0.0, 0.0
        for k in range(relative.shape[1]):
            for a in range(8):
                axis[a] = relative[a, k]
            rest = part_from(axis, x)
            apart2 += rest[0] ** 2
            if x < 1.0:
                along += rest[0] * 7.0 * (rest[1] - rest[0]) / (1.0 - x)
        apart = np.sqrt(apart2)
        if not abs(border - apart) < missed or not sign * along > 0.0:
            break
        found, missed = x, abs(border - apart)
        rate = along / apart
        # No further than rounding of the squares may have moved the place.
        most = ROUNDED_SQUARES * largest / (border * abs(rate))
        x = min(max(x + min(max((border - apart) / rate, -most), most), 0.0), 1.0)
    return found


def places_and_pairs(rows: Array) -> tuple[Array, NDArray[np.int64]]:
    """Places, shape (k,), and pairs, shape (k, 2), of rows (place, i, j).

    Parameters
    ----------
    rows
        The rows, shape (k, 3).
    """
    return rows[:, 0].copy(), rows[:, 1:].astype(np.int64)


def crossings(
    B: Array, far: Array, near: Links, active: Links, enter: Array, leave: Array, directed: bool, slack: float, P: Array
) -> tuple[Array, NDArray[np.int64]]:
    """First crossing of every pair that crosses its distance on the segment.

    Parameters
    ----------
    B
        Bernstein coefficients of the positions, shape (8, N, m).
    far
        See `flocking.engine.adaptive_steps.segment.Motion`.
    near
        Matrix (N, N): pairs that are within their distance now. They cross by rising above ``leave``, the
        others by falling below ``enter``.
    active
        Matrix (N, N): pairs that are watched at all.
    enter, leave
        Distances per sensing agent, shape (N,).
    directed
        Whether (i, j) and (j, i) cross on their own.
    slack
        Overshoot in distance that counts as a crossing; covers rounding.
    P
        Bernstein coefficients of the velocities, shape (8, N, m), or (8, 0, m) where the agents have none. A pair
        that crosses by the positions while its velocities point the other way has crossed by the error of the
        positions alone, and does so only where its velocities agree.

    Returns
    -------
    tuple
        Crossing positions in [0, 1], shape (k,), and ordered pairs, shape (k, 2).
    """
    given = B, far, near, active, enter, leave, directed, slack, P, all_pairs(B.shape[1])
    return places_and_pairs(all_rows(lambda found: int(find_crossings(*given, found)), 3))


@native_apart
def find_crossings(
    B: Array, far: Array, near: Links, active: Links, enter: Array, leave: Array, directed: bool, slack: float,
    P: Array, nearby: NearbyPairs, found: Array,
) -> int:  # fmt: skip
    """Fill the rows (place, i, j) of `crossings`, as many as fit; returns their total number.

    Parameters
    ----------
    B, far, near, active, enter, leave, directed, slack, P
        As for `crossings`.
    nearby
        Pairs that are looked at.
    found
        The rows, shape (room, 3).
    """
    n = B.shape[1]
    count = 0
    square, relative = np.empty(15), np.empty((8, B.shape[2]))
    for i in range(n):
        for e in range(nearby.starts[i], nearby.starts[i + 1]):
            j = nearby.partners[e]
            if (j < i and not directed) or not active[i, j]:
                continue
            level = leave[i] if near[i, j] else enter[i]
            if level == np.inf or (level <= 0.0 and not near[i, j]):
                continue
            d2 = 0.0
            for k in range(B.shape[2]):
                d2 += (B[0, j, k] - B[0, i, k]) ** 2
            excursion = far[i] + far[j] + slack
            if near[i, j]:
                if level > excursion and d2 < (level - excursion) ** 2:
                    continue
            elif d2 > (level + excursion) ** 2:
                continue
            squared_distance(B, i, j, square)
            border = (level + slack) ** 2 if near[i, j] else max(level - slack, 0.0) ** 2
            for k in range(15):
                square[k] = square[k] - border if near[i, j] else border - square[k]
            x = first_above(square)
            if x <= 1.0 and P.shape[1]:
                x = _moving_so(square, x, B, P, i, j, 1.0 if near[i, j] else -1.0)
            if x <= 1.0 and border > 0.0:
                for a in range(8):
                    for k in range(B.shape[2]):
                        relative[a, k] = B[a, j, k] - B[a, i, k]
                x = on_border(relative, square, np.sqrt(border), x, 1.0 if near[i, j] else -1.0)
            if x <= 1.0:
                count = add_row(found, count, x, i, j)
    return count


@native
def find_closest(
    B: Array, far: Array, linked: Links, nearby: NearbyPairs, best_linked: float, best_free: float, found: Array
) -> None:
    """Closest approach on the segment of a linked and of an unlinked pair, where closer than the best so far.

    Parameters
    ----------
    B
        Bernstein coefficients of the positions, shape (8, N, m).
    far
        See `flocking.engine.adaptive_steps.segment.Motion`.
    linked
        Links during the segment, shape (N, N).
    nearby
        Pairs that are looked at, unless others may be closer than the closest so far.
    best_linked, best_free
        Smallest distances of linked and of unlinked pairs so far.
    found
        Takes the rows (linked, free): squared distance, position in [0, 1] or `NEVER`, and the pair; shape (2, 4).
    """
    n = B.shape[1]
    for row in range(2):
        found[row, 0] = best_free**2 if row else best_linked**2
        found[row, 1], found[row, 2], found[row, 3] = NEVER, -1.0, -1.0
    square, reach = np.empty(15), np.sqrt(max(found[0, 0], found[1, 0]))
    # Linked pairs are all in the list.
    every_pair = best_free > nearby.bounds[BASE] or nearby.starts[n] == n * (n - 1)
    axes, squares = np.empty((B.shape[2], n)), np.empty(n)
    for i in range(n):
        for k in range(B.shape[2]):
            axes[k, i] = B[0, i, k]
    for i in range(n):
        if every_pair and closer_in_row(axes, far, linked, i, np.sqrt(found[0, 0]), reach, squares) == 0:
            continue
        first, last = (i + 1, n) if every_pair else (nearby.starts[i], nearby.starts[i + 1])
        for e in range(first, last):
            j = e if every_pair else nearby.partners[e]
            if j < i:
                continue
            d2 = 0.0
            for k in range(B.shape[2]):
                d2 += (B[0, j, k] - B[0, i, k]) ** 2
            if d2 > (reach + far[i] + far[j]) ** 2:
                continue
            row = 0 if (linked[i, j] or linked[j, i]) else 1
            if d2 > (np.sqrt(found[row, 0]) + far[i] + far[j]) ** 2:
                continue
            squared_distance(B, i, j, square)
            value, x = smallest_value(square, found[row, 0])
            if x <= 1.0:
                found[row, 0], found[row, 1], found[row, 2], found[row, 3] = max(value, 0.0), x, i, j
                reach = np.sqrt(max(found[0, 0], found[1, 0]))


def deepest_dip(B: Array, far: Array, senders: Indices, sensed: Indices) -> float:
    """Where on the segment a linked pair comes much closer than at both its ends, deepest first; or `NEVER`.

    A step that jumps over a close approach shows such a dip, as the force in between does not affect its ends.

    Parameters
    ----------
    far
        Bound on the displacement of each agent on the segment, shape (N,).
    senders, sensed
        The linked pairs, shape (K,) each.
    """
    return float(deepest_dip_of(B, far, senders, sensed, len(senders)))


@native_apart
def deepest_dip_of(B: Array, far: Array, senders: Indices, sensed: Indices, count: int) -> float:
    """As `deepest_dip`, for the first ``count`` of the pairs and bounds ``far``; for native functions."""
    deepest, where = DIP, NEVER
    square = np.empty(15)
    for e in range(count):
        i, j = senders[e], sensed[e]
        d2 = 0.0
        for k in range(B.shape[2]):
            d2 += (B[0, j, k] - B[0, i, k]) ** 2
        if 4.0 * (far[i] + far[j]) ** 2 < d2:
            continue
        squared_distance(B, i, j, square)
        ends = min(square[0], square[14])
        if ends <= 0.0:
            continue
        value, x = smallest_value(square, deepest * ends)
        if x <= 1.0:
            deepest, where = max(value, 0.0) / ends, x
    return where
