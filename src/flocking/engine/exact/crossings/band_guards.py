"""Pairs that come within the error of the distance at which they would switch, certified on a segment."""

from __future__ import annotations

import numpy as np

from flocking.engine.exact.crossings.guards import squared_distance
from flocking.engine.exact.crossings.nearby_pairs import NearbyPairs, all_pairs
from flocking.engine.kernels.bernstein import NEVER, all_rows, first_above, part_from, smallest_value
from flocking.formula.native.functions import native, native_apart
from flocking.model.checks import Array
from flocking.model.graphs.connectivity import Links

BOUND_ROUNDING = 1e-12
"""Relative margin of the bounds on distances from the mean: above the rounding of a mean of thousands of positions."""


def pair_error(nodes: Array, floor: float, i: int, j: int) -> float:
    """Error of the distance of two agents: the largest difference of their errors at the nodes, shape (k, N, m).

    Parameters
    ----------
    nodes
        Errors of the positions at the nodes.
    floor
        Error that is always added.
    """
    most = 0.0
    for k in range(nodes.shape[0]):
        square = 0.0
        for c in range(nodes.shape[2]):
            square += (nodes[k, j, c] - nodes[k, i, c]) ** 2
        most = max(most, square)
    return float(np.sqrt(most) + floor)


def within_error(
    B: Array, far: Array, near: Links, active: Links, enter: Array, leave: Array, directed: bool,
    nodes: Array, most: float, floor: float, nearby: NearbyPairs | None = None,
) -> Array:  # fmt: skip
    """Pairs that come within the error of the distance at which they would switch.

    Parameters
    ----------
    B
        Bernstein coefficients of the positions, shape (8, N, m).
    far
        See `flocking.engine.adaptive_steps.segment.Motion`.
    near, active, enter, leave, directed
        As for `flocking.engine.exact.crossings.guards.crossings`.
    nodes
        Errors of the positions at some times, shape (k, N, m).
    most
        Bound on the error of any distance.
    floor
        Error of a distance that is there in any case.
    nearby
        Pairs that are looked at; all when absent.

    Returns
    -------
    Array
        Rows: the pair, where on the segment it comes closest to switching, how close, its error, and 1 where it
        is within the error at the end; shape (k, 6).
    """
    given = B, far, near, active, enter, leave, directed, nodes, most, floor, nearby or all_pairs(B.shape[1])
    return all_rows(lambda found: int(find_within_error(*given, found)), 6)


@native_apart
def find_within_error(
    B: Array, far: Array, near: Links, active: Links, enter: Array, leave: Array, directed: bool,
    nodes: Array, most: float, floor: float, nearby: NearbyPairs, found: Array,
) -> int:  # fmt: skip
    """Fill the rows of `within_error`, as many as fit; returns their total number.

    Parameters
    ----------
    B, far, near, active, enter, leave, directed, nodes, most, floor
        As for `within_error`.
    nearby
        Pairs that are looked at.
    found
        The rows, shape (room, 6).
    """
    n = B.shape[1]
    count = 0
    square = np.empty(15)
    for i in range(n):
        for e in range(nearby.starts[i], nearby.starts[i + 1]):
            j = nearby.partners[e]
            if (j < i and not directed) or not active[i, j]:
                continue
            inside = near[i, j]
            level = leave[i] if inside else enter[i]
            if level == np.inf or (level <= 0.0 and not inside):
                continue
            d2 = 0.0
            for k in range(B.shape[2]):
                d2 += (B[0, j, k] - B[0, i, k]) ** 2
            excursion = far[i] + far[j] + most
            if inside:
                if level > excursion and d2 < (level - excursion) ** 2:
                    continue
            elif d2 > (level + excursion) ** 2:
                continue
            error = pair_error(nodes, floor, i, j)
            squared_distance(B, i, j, square)
            # Inside, the largest distance is sought: the smallest value of what has the other sign.
            sign = -1.0 if inside else 1.0
            border = max(level - error, 0.0) if inside else level + error
            for k in range(15):
                square[k] *= sign
            value, x = smallest_value(square, sign * border * border)
            if x <= 1.0:
                if count < found.shape[0]:
                    found[count, 0], found[count, 1], found[count, 2] = i, j, x
                    found[count, 3] = sign * (np.sqrt(max(sign * value, 0.0)) - level)
                    found[count, 4] = error
                    found[count, 5] = 1.0 if square[14] < sign * border * border else 0.0
                count += 1
    return count


@native
def first_beyond(B: Array, i: int, j: int, distance: float, outward: bool) -> float:
    """First position in [0, 1] at which two agents are further apart than a distance, or closer; or `NEVER`.

    Parameters
    ----------
    B
        Bernstein coefficients of the positions, shape (8, N, m).
    outward
        Whether the states further apart are sought, or the closer ones.
    """
    square = np.empty(15)
    squared_distance(B, i, j, square)
    level = max(distance, 0.0) ** 2
    for k in range(15):
        square[k] = square[k] - level if outward else level - square[k]
    return float(first_above(square))


@native
def closest_after(B: Array, i: int, j: int, level: float, inside: bool, x: float) -> tuple[float, float]:
    """Least distance of a pair from a level after position ``x``, and where.

    Parameters
    ----------
    B
        Bernstein coefficients of the positions, shape (8, N, m).
    inside
        Whether the pair is closer than the level, so that it would have to move apart.
    level
        The distance.
    """
    square = np.empty(15)
    squared_distance(B, i, j, square)
    rest = part_from(square, x)
    sign = -1.0 if inside else 1.0
    for k in range(15):
        rest[k] *= sign
    value, where = smallest_value(rest, np.inf)
    return sign * (np.sqrt(max(sign * value, 0.0)) - level), x + where * (1.0 - x)


def _farthest(B: Array, i: int, j: int, square: Array, best: float) -> tuple[float, float]:
    """Largest squared distance of two points on the segment, where it is more than ``best``, and where; or `NEVER`."""
    hull = 0.0
    for a in range(B.shape[0]):
        d2 = 0.0
        for k in range(B.shape[2]):
            d2 += (B[a, j, k] - B[a, i, k]) ** 2
        hull = max(hull, d2)
    # The curve lies in the hull of its coefficients.
    if hull <= best:
        return best, NEVER
    squared_distance(B, i, j, square)
    possible = False
    for k in range(15):
        possible = possible or not square[k] <= best
        square[k] *= -1.0
    if not possible:
        return best, NEVER
    value, x = smallest_value(square, -best)
    return -value, x


def _farthest_from_mean(B: Array, far: Array) -> Array:
    """Bound on the distance of each agent from the mean of the group on the segment, shape (N,)."""
    n, m = B.shape[1], B.shape[2]
    away, mean = np.empty(n), np.zeros(m)
    for k in range(m):
        for i in range(n):
            mean[k] += B[0, i, k] / n
    for i in range(n):
        square = 0.0
        for k in range(m):
            square += (B[0, i, k] - mean[k]) ** 2
        away[i] = (far[i] + np.sqrt(square)) * (1.0 + BOUND_ROUNDING)
    return away


@native
def diameter(B: Array, far: Array, least: float) -> tuple[float, float, int, int]:
    """Largest distance of two points on the segment where it is more than ``least``: value, where, which.

    Parameters
    ----------
    B
        Bernstein coefficients of the points, shape (8, N, m).
    far
        See `flocking.engine.adaptive_steps.segment.Motion`.
    """
    best, where, one, two = max(least, -1.0) * abs(least), NEVER, -1, -1
    square = np.empty(15)
    away, most = _farthest_from_mean(B, far), 0.0
    for i in range(B.shape[1]):
        most = max(most, away[i])
    for i in range(B.shape[1]):
        if (away[i] + most) ** 2 <= best:
            continue
        for j in range(i + 1, B.shape[1]):
            if (away[i] + away[j]) ** 2 <= best:
                continue
            value, x = _farthest(B, i, j, square, best)
            if x <= 1.0:
                best, where, one, two = value, x, i, j
    return np.sqrt(max(best, 0.0)), where, one, two


@native
def find_fastest(
    P: Array, moving: Array, shares: Array, goal: Array, speed: float, spread: float, relative: float, rows: Array
) -> None:
    """Largest speed, distance of a velocity from the mean one, and speed relative to a goal, on the segment.

    Parameters
    ----------
    P
        Bernstein coefficients of the velocities, shape (8, N, m).
    moving
        Velocity that these are relative to, shape (m,).
    shares
        Weights of the mean, shape (N,).
    goal
        Constant velocity, shape (m,).
    speed, spread, relative
        What each of the three is looked for above; what is infinite is not looked for.
    rows
        Takes a row for each: value, where in [0, 1] or `NEVER`, and whose; shape (3, 3).
    """
    count, n, m = P.shape[0], P.shape[1], P.shape[2]
    axes, middles, pair = np.empty((count, m, n)), np.zeros((3, count, m)), np.empty((count, 2, m))
    for a in range(count):
        for k in range(m):
            for i in range(n):
                axes[a, k, i] = P[a, i, k] + moving[k]
                middles[1, a, k] += shares[i] * axes[a, k, i]
            middles[2, a, k] = goal[k]
    square, hulls, squares = np.empty(15), np.empty(n), np.empty(n)
    for row in range(3):
        least = speed if row == 0 else spread if row == 1 else relative
        best, where, which = max(least, -1.0) * abs(least), NEVER, -1
        if least < np.inf:
            _fill_hulls(axes, middles[row], hulls, squares)
            for i in range(n):
                if hulls[i] <= best:
                    continue
                for a in range(count):
                    for k in range(m):
                        pair[a, 0, k], pair[a, 1, k] = middles[row, a, k], axes[a, k, i]
                value, x = _farthest(pair, 0, 1, square, best)
                if x <= 1.0:
                    best, where, which = value, x, i
        rows[row, 0], rows[row, 1], rows[row, 2] = np.sqrt(max(best, 0.0)), where, which


def _fill_hulls(axes: Array, middle: Array, hulls: Array, squares: Array) -> None:
    """Bounds on the squared distances of points from another one on the segment, by loops over vectors.

    Parameters
    ----------
    axes
        Bernstein coefficients of the points, shape (8, m, N).
    middle
        Those of the other point, shape (8, m).
    hulls, squares
        Takes the bounds, and room for as many numbers, shape (N,).
    """
    n = hulls.shape[0]
    for i in range(n):
        hulls[i] = 0.0
    for a in range(axes.shape[0]):
        for i in range(n):
            squares[i] = 0.0
        for k in range(axes.shape[1]):
            for i in range(n):
                squares[i] += (axes[a, k, i] - middle[a, k]) ** 2
        for i in range(n):
            hulls[i] = max(hulls[i], squares[i])
