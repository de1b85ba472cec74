"""Distances of pairs whose agents move on polynomials: every crossing of a level, and how close they come.

A squared distance is a polynomial of twice the degree of the motion. In Bernstein form it lies between its smallest and
largest coefficient, so halving the interval proves that there is no crossing, or closes in on the first one.
"""

from __future__ import annotations

from functools import lru_cache
from math import comb

import numpy as np

from flocking.arrays import Array, Links, Numbers
from flocking.engine.kernels.bernstein import all_rows, first_above, part_from, smallest_value
from flocking.formula.native.functions import native_apart

ROUNDING = 1e-13
"""Overshoot that counts as a crossing, relative to the distance and to the size of the coordinates: some hundred
units of rounding, so that a pair which sits on its level does not switch to and fro."""

MOST_CROSSINGS = 16
"""Crossings of one level by one pair within one piece: a polynomial of degree 14 has no more."""


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


def crossing_places(square: Array, near: bool, enter: float, leave: float, slack: float, places: Array) -> int:
    """Places in [0, 1] at which a pair switches, one after the other; how many there are.

    Parameters
    ----------
    square
        Bernstein coefficients of the squared distance.
    near
        Whether the pair is within its distance at the beginning.
    enter, leave
        Distances below which it comes within, and above which it leaves.
    slack
        Overshoot that counts as a crossing.
    places
        Takes the places, shape (MOST_CROSSINGS,).
    """
    size, count, x = square.shape[0], 0, 0.0
    g = np.empty(size)
    inside = near
    while count < MOST_CROSSINGS and x < 1.0:
        level = leave + slack if inside else max(enter - slack, 0.0)
        if level == np.inf or (level <= 0.0 and not inside):
            return count
        for k in range(size):
            g[k] = square[k] - level * level if inside else level * level - square[k]
        found = first_above(part_from(g, x))
        if found > 1.0:
            return count
        x = x + found * (1.0 - x)
        places[count] = x
        count += 1
        inside = not inside
    return count


def squared_distance(S: Array, i: int, j: int, span: float, table: Array, power: Array, square: Array) -> None:
    """Bernstein coefficients on [0, 1] of the squared distance of two agents over ``span``.

    Parameters
    ----------
    S
        Taylor coefficients of the positions, shape (degree + 1, N, m).
    table
        What `conversion` gives.
    power, square
        Room for the power coefficients, and where the others go, shape (2 degree + 1,).
    """
    degree, terms, scale = S.shape[0] - 1, power.shape[0], 1.0
    for a in range(terms):
        power[a] = 0.0
    for a in range(degree + 1):
        for b in range(degree + 1):
            dot = 0.0
            for k in range(S.shape[2]):
                dot += (S[a, j, k] - S[a, i, k]) * (S[b, j, k] - S[b, i, k])
            power[a + b] += dot
    for a in range(terms):
        power[a] *= scale
        scale *= span
    for a in range(terms):
        square[a] = 0.0
        for b in range(a + 1):
            square[a] += table[a, b] * power[b]


def distance_and_reach(S: Array, i: int, j: int, span: float) -> tuple[float, float]:
    """Distance of two agents now, and by how much at most it changes within ``span``.

    Parameters
    ----------
    S
        Taylor coefficients of the positions, shape (degree + 1, N, m).
    """
    distance, reach, scale = 0.0, 0.0, 1.0
    for a in range(S.shape[0]):
        total = 0.0
        for k in range(S.shape[2]):
            total += (S[a, j, k] - S[a, i, k]) ** 2
        if a == 0:
            distance = np.sqrt(total)
        else:
            scale *= span
            reach += np.sqrt(total) * scale
    return distance, reach


@native_apart
def find_pair_events(
    S: Array, length: Array, changed: Links, near: Links, ways: Numbers, enter: Array, leave: Array, table: Array,
    size: float, found: Array,
) -> int:  # fmt: skip
    """Fill rows (time, i, j, graph) of all switches of the pairs of changed agents until either one's piece ends.

    Parameters
    ----------
    S
        Taylor coefficients of the positions about now, shape (degree + 1, N, m).
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
    table
        What `conversion` gives.
    size
        Size of the coordinates, for rounding.
    found
        Takes the rows, shape (room, 4).

    Returns
    -------
    int
        How many rows there are, those included for which there was no room.
    """
    terms, n, graphs = 2 * S.shape[0] - 1, S.shape[1], near.shape[0]
    power, square, places = np.empty(terms), np.empty(terms), np.empty(MOST_CROSSINGS)
    count = 0
    for i in range(n):
        for j in range(i + 1, n):
            if not (changed[i] or changed[j]):
                continue
            span = min(length[i], length[j])
            distance, reach = distance_and_reach(S, i, j, span)
            known = False
            for graph in range(graphs):
                for way in range(ways[graph]):
                    s = i if way == 0 else j
                    o = j if way == 0 else i
                    close, far = enter[graph, s], leave[graph, s]
                    slack = ROUNDING * ((far if far < np.inf else close) + size)
                    level = far if near[graph, s, o] else close
                    if not distance - reach - 2.0 * slack <= level <= distance + reach + 2.0 * slack:
                        continue
                    if not known:
                        squared_distance(S, i, j, span, table, power, square)
                        known = True
                    switches = crossing_places(square, near[graph, s, o], close, far, slack, places)
                    for c in range(switches):
                        if count < found.shape[0]:
                            found[count, 0], found[count, 1] = places[c] * span, s
                            found[count, 2], found[count, 3] = o, graph
                        count += 1
    return count


@native_apart
def find_closest(S: Array, span: float, linked: Links, table: Array, closest: Array) -> None:
    """Put the closest linked and unlinked pair in place of those so far, where they come closer.

    Parameters
    ----------
    S
        Taylor coefficients of the positions about the beginning of an interval, shape (degree + 1, N, m).
    span
        Its length.
    linked
        Links during it, shape (N, N).
    table
        What `conversion` gives.
    closest
        Rows (squared distance, time since the beginning, i, j) of the closest linked and unlinked pair so far.
    """
    terms, n = 2 * S.shape[0] - 1, S.shape[1]
    power, square = np.empty(terms), np.empty(terms)
    for i in range(n):
        for j in range(i + 1, n):
            kind = 0 if linked[i, j] or linked[j, i] else 1
            distance, reach = distance_and_reach(S, i, j, span)
            if distance - reach > np.sqrt(closest[kind, 0]) * (1.0 + ROUNDING):
                continue
            squared_distance(S, i, j, span, table, power, square)
            least, where = smallest_value(square, closest[kind, 0])
            if where <= 1.0 and least < closest[kind, 0]:
                closest[kind, 0], closest[kind, 1] = max(least, 0.0), where * span
                closest[kind, 2], closest[kind, 3] = i, j


def pair_events(
    S: Array, length: Array, changed: Links, near: Links, ways: Numbers, levels: tuple[Array, Array], size: float
) -> Array:
    """Rows (time, i, j, graph) of all switches that `find_pair_events` finds, in order of time.

    Parameters
    ----------
    levels
        Distances at which links appear and break.
    S, length, changed, near, ways, size
        As for `find_pair_events`.
    """
    table = conversion(S.shape[0] - 1)
    rows = all_rows(lambda found: int(find_pair_events(S, length, changed, near, ways, *levels, table, size, found)), 4)
    return rows[np.lexsort(rows.T[::-1])]


def closest_pairs(S: Array, span: float, linked: Links, begin: float, so_far: Array) -> Array:
    """The closest linked and unlinked pair: those so far, or of an interval, rows (squared distance, time, i, j).

    Parameters
    ----------
    S, span, linked
        As for `find_closest`.
    begin
        Time at which the interval begins.
    so_far
        Rows of those so far.
    """
    found = so_far.copy()
    find_closest(S, span, linked, conversion(S.shape[0] - 1), found)
    found[:, 1] += np.where(found[:, 0] != so_far[:, 0], begin, 0.0)
    return found
