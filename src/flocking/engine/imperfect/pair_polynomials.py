"""Distances of pairs whose agents move on polynomials, image by image, and how close they come.

A squared distance is a polynomial of twice the degree of the motion. In Bernstein form it lies between its smallest and
largest coefficient, so halving the interval proves that there is no crossing, or closes in on the first one. In space
that repeats every image that can come near within the interval has a polynomial of its own.
"""

from __future__ import annotations

import math
from functools import lru_cache
from math import comb
from typing import NamedTuple

import numpy as np

from flocking.arrays import Array, Links, Numbers
from flocking.engine.kernels.bernstein import smallest_value
from flocking.engine.kernels.displacements import closer_in_row, nearest_difference
from flocking.engine.runs.run import Closest
from flocking.errors import SimulationError
from flocking.formula.native.functions import native_apart
from flocking.model.space import Space

ROUNDING = 1e-13
"""Overshoot that counts as a crossing, relative to the distance and to the size of the coordinates: some hundred
units of rounding, so that a pair which sits on its level does not switch to and fro."""

MOST_IMAGES = 10**6
"""Images of one pair that are looked at within one piece: in the plane some 500 lengths of a box each way, far more
than agents that react to each other cross between two ticks."""


class Paths(NamedTuple):
    """How agents move, and their space.

    Parameters
    ----------
    S
        Taylor coefficients of the positions about now, shape (degree + 1, N, m).
    lengths
        Length after which each axis repeats, infinite where it does not, shape (m,).
    table
        What `conversion` gives.
    now
        The scenario's time.
    """

    S: Array
    lengths: Array
    table: Array
    now: float


def paths_in(space: Space, S: Array, now: float) -> Paths:
    """Paths in a ``space`` from time ``now`` on, from the Taylor coefficients ``S`` of the positions."""
    lengths = np.array(space.lengths or (np.inf,) * S.shape[2], dtype=np.float64)
    return Paths(S, lengths, conversion(S.shape[0] - 1), now)


@lru_cache
def conversion(degree: int) -> Array:
    """Matrix from power coefficients on [0, 1] to Bernstein coefficients, for squared distances of motions.

    Parameters
    ----------
    degree
        Degree of the motion.
    """
    n = 2 * degree
    table = [[comb(i, k) / comb(n, k) if k <= i else 0.0 for k in range(n + 1)] for i in range(n + 1)]
    return np.array(table)


def nearest_offset(paths: Paths, i: int, j: int, nearest: Array) -> float:
    """Put the displacement of agent ``j`` from agent ``i`` into ``nearest``, shape (m,); its length.

    Parameters
    ----------
    paths
        How they move.
    """
    total = 0.0
    for k in range(nearest.shape[0]):
        difference = paths.S[0, j, k] - paths.S[0, i, k]
        if paths.lengths[k] < np.inf:
            difference = nearest_difference(difference, paths.lengths[k])
        nearest[k] = difference
        total += difference**2
    return float(np.sqrt(total))


def reach_within(paths: Paths, i: int, j: int, span: float) -> float:
    """By how much at most the distance of two agents changes within ``span``.

    Parameters
    ----------
    paths
        How they move.
    """
    reach, scale = 0.0, 1.0
    for a in range(1, paths.S.shape[0]):
        total = 0.0
        for k in range(paths.S.shape[2]):
            total += (paths.S[a, j, k] - paths.S[a, i, k]) ** 2
        scale *= span
        reach += np.sqrt(total) * scale
    return reach


def excursion(paths: Paths, i: int, span: float) -> float:
    """How far at most agent ``i`` moves within ``span``.

    Parameters
    ----------
    paths
        How agents move.
    """
    far, scale = 0.0, 1.0
    for a in range(1, paths.S.shape[0]):
        total = 0.0
        for k in range(paths.S.shape[2]):
            total += paths.S[a, i, k] ** 2
        scale *= span
        far += np.sqrt(total) * scale
    return far


def count_images(paths: Paths, within: float, counts: Numbers) -> int:
    """How many images of an agent there are that can be nearer than ``within``, by number along each axis.

    Parameters
    ----------
    paths
        How agents move.
    within
        A distance.
    counts
        Takes how many lengths each way such images lie from the nearest one, shape (m,).
    """
    images = 1
    for k in range(counts.shape[0]):
        counts[k] = 0
        if paths.lengths[k] < np.inf:
            # A component of the nearest displacement is at most half a length: n lengths further it is n - 1/2 or more.
            counts[k] = math.floor(min(within / paths.lengths[k] + 0.5, float(MOST_IMAGES)))
        images *= 2 * counts[k] + 1
        if images > MOST_IMAGES:
            return MOST_IMAGES + 1
    return images


def image_offset(paths: Paths, nearest: Array, counts: Numbers, image: int, offset: Array) -> float:
    """Put the displacement to an image into ``offset``, shape (m,); its length.

    Parameters
    ----------
    paths
        How agents move.
    nearest
        The displacement to the nearest image, shape (m,).
    counts
        What `count_images` filled.
    image
        Number of the image; the nearest one is in the middle.
    """
    left, total = image, 0.0
    for k in range(nearest.shape[0]):
        choices = 2 * counts[k] + 1
        cell = left % choices - counts[k]
        left = left // choices
        offset[k] = nearest[k] + cell * paths.lengths[k] if cell != 0 else nearest[k]
        total += offset[k] ** 2
    return float(np.sqrt(total))


def squared_distance(paths: Paths, i: int, j: int, offset: Array, span: float, square: Array) -> None:
    """Bernstein coefficients on [0, 1] of the squared distance of two agents over ``span``.

    Parameters
    ----------
    paths
        How agents move.
    offset
        Displacement to the image of the second one now, shape (m,).
    square
        Where the coefficients go, shape (2 degree + 1,).
    """
    S, table = paths.S, paths.table
    degree, terms, scale = S.shape[0] - 1, square.shape[0], 1.0
    power = np.empty(terms)
    for a in range(terms):
        power[a] = 0.0
    for a in range(degree + 1):
        for b in range(degree + 1):
            dot = 0.0
            for k in range(S.shape[2]):
                left = offset[k] if a == 0 else S[a, j, k] - S[a, i, k]
                right = offset[k] if b == 0 else S[b, j, k] - S[b, i, k]
                dot += left * right
            power[a + b] += dot
    for a in range(terms):
        power[a] *= scale
        scale *= span
    for a in range(terms):
        square[a] = 0.0
        for b in range(a + 1):
            square[a] += table[a, b] * power[b]


@native_apart
def find_closest(paths: Paths, span: float, linked: Links, closest: Array) -> int:
    """Put the closest linked and unlinked pair in place of those so far, where they come closer.

    Parameters
    ----------
    paths
        How agents move from the beginning of an interval on.
    span
        Its length.
    linked
        Links during it, shape (N, N).
    closest
        Rows (squared distance, time since the beginning, i, j) of the closest linked and unlinked pair so far.

    Returns
    -------
    int
        0; -1 if a pair has too many images.
    """
    n, m = paths.S.shape[1], paths.S.shape[2]
    square, nearest, offset = np.empty(2 * paths.S.shape[0] - 1), np.empty(m), np.empty(m)
    counts, is_open = np.empty(m, np.int64), True
    axes, far, squares = np.empty((m, n)), np.empty(n), np.empty(n)
    for k in range(m):
        is_open = is_open and paths.lengths[k] == np.inf
    for i in range(n):
        far[i] = excursion(paths, i, span) * (1.0 + ROUNDING)
        for k in range(m):
            axes[k, i] = paths.S[0, i, k]
    for i in range(n):
        most = np.sqrt(closest[0, 0]) * (1.0 + ROUNDING)
        either = max(most, np.sqrt(closest[1, 0]) * (1.0 + ROUNDING))
        if is_open and closer_in_row(axes, far, linked, i, most, either, squares) == 0:
            continue
        for j in range(i + 1, n):
            kind = 0 if linked[i, j] or linked[j, i] else 1
            distance, reach = nearest_offset(paths, i, j, nearest), reach_within(paths, i, j, span)
            if distance - reach > np.sqrt(closest[kind, 0]) * (1.0 + ROUNDING):
                continue
            images = count_images(paths, min(distance, np.sqrt(closest[kind, 0])) + 2.0 * reach, counts)
            if images > MOST_IMAGES:
                return -1
            for image in range(images):
                away = image_offset(paths, nearest, counts, image, offset)
                if away - reach > np.sqrt(closest[kind, 0]) * (1.0 + ROUNDING):
                    continue
                squared_distance(paths, i, j, offset, span, square)
                least, where = smallest_value(square, closest[kind, 0])
                if where <= 1.0 and least < closest[kind, 0]:
                    closest[kind, 0], closest[kind, 1] = max(least, 0.0), where * span
                    closest[kind, 2], closest[kind, 3] = i, j
    return 0


def too_many_images(time: float) -> SimulationError:
    """The error for a pair that passes too many images of each other."""
    return SimulationError(
        f"Two agents pass more than {MOST_IMAGES} images of each other before their forces change. Such speeds have no "
        "meaning in so small a box: check the law and the period of Held, or enlarge Periodic.lengths.",
        time=time,
    )


def closest_pairs(paths: Paths, span: float, linked: Links, begin: float, so_far: Array) -> Array:
    """The closest linked and unlinked pair: those so far, or of an interval, rows (squared distance, time, i, j).

    Parameters
    ----------
    paths, span, linked
        As for `find_closest`.
    begin
        Time at which the interval begins.
    so_far
        Rows of those so far.

    Raises
    ------
    SimulationError
        When agents cross a periodic box too often within the interval.
    """
    found = so_far.copy()
    if find_closest(paths, span, linked, found) < 0:
        raise too_many_images(paths.now)
    found[:, 1] += np.where(found[:, 0] != so_far[:, 0], begin, 0.0)
    return found


def as_closest(paths: Paths, rows: Array, base: float, *, rounding_alone: bool) -> tuple[Closest, Closest]:
    """The closest linked and unlinked pair, with errors of rounding where there are no others.

    Parameters
    ----------
    paths
        How agents move.
    rows
        What `closest_pairs` gives.
    base
        When the scenario begins.
    rounding_alone
        Whether positions have no error but rounding.
    """
    size = ROUNDING * float(np.abs(paths.S[0]).max()) if rounding_alone else math.nan
    linked, free = (
        Closest(math.sqrt(d), base + t, (int(i), int(j)), size) if np.isfinite(d) else Closest()
        for d, t, i, j in rows.tolist()
    )
    return linked, free
