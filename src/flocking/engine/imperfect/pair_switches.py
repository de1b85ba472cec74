"""Every crossing of a level by the distances of pairs whose agents move on polynomials: when links switch."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flocking.arrays import Array, Links, Numbers
from flocking.engine.imperfect.pair_polynomials import (
    MOST_IMAGES,
    ROUNDING,
    Paths,
    count_images,
    image_offset,
    nearest_offset,
    reach_within,
    squared_distance,
    too_many_images,
)
from flocking.engine.kernels.bernstein import NEVER, all_rows, first_above, part_from
from flocking.formula.native.functions import native_apart

MOST_CROSSINGS = 20
"""Crossings of one level by one image of a pair within one piece: a polynomial of degree 18 has no more."""


def first_beyond(square: Array, level: float, inside: bool, x: float) -> float:
    """First place from ``x`` on at which a pair leaves, or comes within, a distance; `NEVER` if it does not.

    Parameters
    ----------
    square
        Bernstein coefficients of the squared distance.
    level
        The distance.
    inside
        Whether the pair is within it.
    """
    g = np.empty(square.shape[0])
    for k in range(square.shape[0]):
        g[k] = square[k] - level * level if inside else level * level - square[k]
    found = first_above(part_from(g, x))
    return NEVER if found > 1.0 else x + found * (1.0 - x)


class TwoPaths(NamedTuple):
    """Two paths whose distance is watched.

    Parameters
    ----------
    i, j
        Their numbers.
    span
        For how long from now on.
    distance
        Their distance now, that of the nearest images.
    reach
        By how much at most it changes.
    """

    i: int
    j: int
    span: float
    distance: float
    reach: float


class WatchedLink(NamedTuple):
    """A link between the agents of two paths.

    Parameters
    ----------
    inside
        Whether they are linked now.
    close, far
        Distances at which the link appears and breaks.
    s, o, graph
        The agent that senses, the one that is sensed, and the graph.
    """

    inside: bool
    close: float
    far: float
    s: int
    o: int
    graph: int


def add_switches(
    paths: Paths, two: TwoPaths, nearest: Array, link: WatchedLink, size: float, found: Array, total: int
) -> int:
    """Add rows (time, s, o, graph) of all switches of one link; how many rows there are, or -1 for too many images.

    Parameters
    ----------
    paths, two, link
        How agents move from now on, and the paths and the link that are looked at.
    nearest
        What `nearest_offset` gives.
    size
        Size of the coordinates, for rounding.
    found, total
        Takes the rows, shape (room, 4), and how many there are before.
    """
    i, j, span, reach = two.i, two.j, two.span, two.reach
    inside, close, far = link.inside, link.close, link.far
    slack = ROUNDING * ((far if far < np.inf else close) + size)
    border = far if inside else close
    if not two.distance - reach - 2.0 * slack <= border <= two.distance + reach + 2.0 * slack:
        return total
    m = paths.S.shape[2]
    square, offset, counts = np.empty(2 * paths.S.shape[0] - 1), np.empty(m), np.empty(m, np.int64)
    images = count_images(paths, close + reach + 2.0 * slack, counts)
    if images > MOST_IMAGES:
        return -1
    linked, known, x, switches = images // 2, -1, 0.0, 0
    while x < 1.0 and switches < MOST_CROSSINGS * images:
        level = far + slack if inside else max(close - slack, 0.0)
        if level == np.inf or (level <= 0.0 and not inside):
            break
        when, which = NEVER, 0
        for image in range(linked if inside else 0, linked + 1 if inside else images):
            away = image_offset(paths, nearest, counts, image, offset)
            if not inside and away - reach > level:
                continue
            if known != image:
                squared_distance(paths, i, j, offset, span, square)
                known = image
            place = first_beyond(square, level, inside, x)
            if place < when:
                when, which = place, image
        if when > 1.0:
            break
        x, inside, linked = when, not inside, which
        if total < found.shape[0]:
            found[total, 0], found[total, 1] = x * span, link.s
            found[total, 2], found[total, 3] = link.o, link.graph
        total += 1
        switches += 1
    return total


@native_apart
def find_pair_events(
    paths: Paths, length: Array, changed: Links, near: Links, ways: Numbers, enter: Array, leave: Array, size: float,
    found: Array,
) -> int:  # fmt: skip
    """Fill rows (time, i, j, graph) of all switches of the pairs of changed agents until either one's piece ends.

    A pair that is linked is so with its nearest image, for its distance is less than half a length, until that image
    leaves; then it may come within the distance by any image.

    Parameters
    ----------
    paths
        How agents move from now on.
    length
        How long each agent's piece goes on from now, shape (N,).
    changed
        Whose piece begins now, shape (N,).
    near
        Links of each graph, shape (graphs, N, N).
    ways
        Of each graph: 0 where its links never change, 1 where both agents of a pair sense each other, so that (i, j)
        with i < j stands for both, 2 where they may differ; shape (graphs,).
    enter, leave
        Distances of each graph and sensing agent, shape (graphs, N).
    size
        Size of the coordinates, for rounding.
    found
        Takes the rows, shape (room, 4).

    Returns
    -------
    int
        How many rows there are, those included for which there was no room; -1 if a pair has too many images.
    """
    n, graphs = paths.S.shape[1], near.shape[0]
    nearest = np.empty(paths.S.shape[2])
    total = 0
    for i in range(n):
        for j in range(i + 1, n):
            if not (changed[i] or changed[j]):
                continue
            span = min(length[i], length[j])
            distance, reach = nearest_offset(paths, i, j, nearest), reach_within(paths, i, j, span)
            two = TwoPaths(i, j, span, distance, reach)
            for graph in range(graphs):
                for way in range(ways[graph]):
                    s = i if way == 0 else j
                    o = j if way == 0 else i
                    link = WatchedLink(near[graph, s, o], enter[graph, s], leave[graph, s], s, o, graph)
                    total = add_switches(paths, two, nearest, link, size, found, total)
                    if total < 0:
                        return -1
    return total


def radial_speed(d: Sequence[float], w: Sequence[float]) -> tuple[float, float]:
    """How fast the distance of two agents grows, and their relative speed: summed up as native functions do.

    Parameters
    ----------
    d, w
        Displacement and relative velocity.
    """
    distance = math.sqrt(sum(x * x for x in d))
    speed = sum(x * y for x, y in zip(d, w, strict=True)) / distance if distance else 0.0
    return speed, math.sqrt(sum(y * y for y in w))


def pair_events(
    paths: Paths, length: Array, changed: Links, near: Links, ways: Numbers, enter: Array, leave: Array, size: float
) -> Array:
    """Rows (time, i, j, graph) of all switches that `find_pair_events` finds, in order of time.

    Parameters
    ----------
    paths, length, changed, near, ways, enter, leave, size
        As for `find_pair_events`.

    Raises
    ------
    SimulationError
        When agents cross a periodic box too often within one piece.
    """

    def rows_in(found: Array) -> int:
        count = int(find_pair_events(paths, length, changed, near, ways, enter, leave, size, found))
        if count < 0:
            raise too_many_images(paths.now)
        return count

    rows = all_rows(rows_in, 4)
    return rows[np.lexsort(rows.T[::-1])]
