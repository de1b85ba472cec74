"""The past of a group where every pair has a delay of its own: states, and switches of links, pair by pair."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flocking.arrays import Array, Indices, Links
from flocking.engine.imperfect.constant_views import add_view_changes
from flocking.engine.imperfect.link_rules import LinkRules
from flocking.engine.imperfect.pair_polynomials import ROUNDING, Paths, nearest_offset, reach_within
from flocking.engine.imperfect.pair_switches import TwoPaths, WatchedLink, add_switches
from flocking.engine.imperfect.turning_views import add_turning_changes
from flocking.engine.imperfect.view_switches import Looking
from flocking.formula.native.functions import native_apart


class Past(NamedTuple):
    """The steps of the past as arrays.

    Parameters
    ----------
    begins, ends
        Times of the steps in seconds from the start, shape (steps,).
    coefficients
        Bernstein coefficients of the state vectors, shape (steps, 8, size).
    binomials
        Those of the degree of a step, shape (8,).
    start
        Positions and velocities at the start, shape (N, 2 m); before it agents moved in straight lines.
    order
        Order of the agents.
    """

    begins: Array
    ends: Array
    coefficients: Array
    binomials: Array
    start: Array
    order: int


class Pieces(NamedTuple):
    """Positions from the earliest time that is read to the end of a step.

    Parameters
    ----------
    begins, ends
        Times of the pieces in seconds from the start, shape (pieces,).
    series
        Taylor coefficients about their beginnings, shape (pieces, 8, N, m).
    binomials
        Numbers of combinations, shape (8, 8).
    first, last
        Numbers of the first and the last piece that may be read of each other agent, see
        `flocking.engine.delayed.state_jumps.Windows`.
    """

    begins: Array
    ends: Array
    series: Array
    binomials: Array
    first: Indices
    last: Indices


class Looks(NamedTuple):
    """How agents look under a graph, if their links under it follow fields of view.

    Parameters
    ----------
    series
        Taylor coefficients of the vectors along which they look, about the beginning of each piece of `Pieces`, or of
        the last one alone, shape (pieces or 1, terms, N, m). One term is a unit vector that stays what it is. There are
        no entries where links follow distances.
    late
        Whether they know these as late as their positions, and there are those of all pieces.
    cosines, radii
        Cosine of the half angle and radius of each agent, shape (N,).
    """

    series: Array
    late: bool
    cosines: Array
    radii: Array


def step_at(ends: Array, seconds: float) -> int:
    """Number of the first step that ends at ``seconds`` or later, or of the last; for native functions."""
    low, high = 0, ends.shape[0] - 1
    while low < high:
        middle = (low + high) // 2
        if ends[middle] < seconds:
            low = middle + 1
        else:
            high = middle
    return low


@native_apart
def fill_states(
    past: Past, true: Array, seconds: float, agents: Indices, delays: Array, first: Indices, last: Indices, found: Array
) -> None:
    """Positions and velocities of ``agents``, each a time of its own ago.

    Parameters
    ----------
    past
        The past.
    true
        The true states now, shape (N, 2 m), which are known without delay.
    seconds
        Now, since the start.
    delays
        How long ago, shape (agents,).
    first, last
        Numbers of the first and the last step that may be read of each, see
        `flocking.engine.delayed.state_jumps.Windows`.
    found
        Takes the states, shape (agents, 2 m); velocities of agents of order 1 are 0.
    """
    n, m, steps, count = past.start.shape[0], past.start.shape[1] // 2, past.ends.shape[0], past.binomials.shape[0]
    weights = np.empty(count)
    for e in range(agents.shape[0]):
        j, at = agents[e], seconds - delays[e]
        if delays[e] == 0.0:
            for k in range(2 * m):
                found[e, k] = true[j, k]
            continue
        s = -1 if at <= 0.0 or steps == 0 else step_at(past.ends, at)
        if first.shape[0] > 0:
            s = min(max(s, first[e]), last[e])
        if s < 0:
            for k in range(m):
                found[e, k] = past.start[j, k] + at * past.start[j, m + k]
                found[e, m + k] = past.start[j, m + k]
        else:
            x = (at - past.begins[s]) / (past.ends[s] - past.begins[s])
            power = 1.0
            for a in range(count):
                weights[a] = past.binomials[a] * power
                power *= x
            power = 1.0
            for a in range(count):
                weights[count - 1 - a] *= power
                power *= 1.0 - x
            for k in range(m):
                q, p = 0.0, 0.0
                for a in range(count):
                    q += weights[a] * past.coefficients[s, a, j * m + k]
                    if past.order > 1:
                        p += weights[a] * past.coefficients[s, a, (n + j) * m + k]
                found[e, k], found[e, m + k] = q, p


def shifted_term(series: Array, binomials: Array, piece: int, agent: int, by: float, term: int, axis: int) -> float:
    """A Taylor coefficient about a later time of a piece; for native functions.

    Parameters
    ----------
    series, binomials
        See `Pieces`.
    piece, agent, by
        The numbers of the piece and of the agent, and how much later than its beginning.
    term, axis
        Which coefficient.
    """
    value, degree = 0.0, series.shape[1] - 1
    for b in range(degree - term + 1):
        power = degree - b
        value = value * by + binomials[power, term] * series[piece, power, agent, axis]
    return value


def shift_path(pieces: Pieces, piece: int, agent: int, by: float, S: Array, place: int) -> None:
    """Put Taylor coefficients of an agent about a later time of a piece into ``S[:, place]``; for native functions.

    Parameters
    ----------
    pieces, piece, agent
        The pieces, and the number of the piece and of the agent.
    by
        How much later than its beginning.
    S
        Takes the coefficients, shape (8, 2, m).
    place
        Where, 0 or 1.
    """
    for k in range(S.shape[2]):
        for a in range(S.shape[0]):
            S[a, place, k] = shifted_term(pieces.series, pieces.binomials, piece, agent, by, a, k)


class Moment(NamedTuple):
    """A time on a step, in seconds from the start, and the piece of its own motion that an agent knows then."""

    t: float
    own: int
    delay: float


def add_view_switches(
    paths: Paths, two: TwoPaths, looks: Looks, pieces: Pieces, now: Moment, look: Looking, near: bool, row: Array
) -> int:
    """Put the first change of whether another agent is in view into ``row``; how many there are. For native functions.

    Parameters
    ----------
    paths, two
        The paths of the two about now.
    looks, pieces, now
        How agents look, the motion, and now.
    look, near
        Who looks at whom, and whether that one is in view now.
    row
        Takes the change, shape (1, 4).
    """
    terms, m = looks.series.shape[1], looks.series.shape[3]
    H = np.empty((terms, m))
    piece, by = 0, 0.0
    if looks.late:
        piece, by = now.own, now.t - now.delay - pieces.begins[now.own]
    elif terms > 1:
        by = now.t - pieces.begins[pieces.begins.shape[0] - 1]
    for k in range(m):
        for a in range(terms):
            H[a, k] = shifted_term(looks.series, pieces.binomials, piece, look.s, by, a, k)
    if terms > 1:
        return add_turning_changes(paths, two, look, near, H, row, 0)
    return add_view_changes(paths, two, look, near, H[0], row, 0)


@native_apart
def find_first_switches(
    pieces: Pieces, tau: Array, begin: float, end: float, lengths: Array, table: Array,
    links: Links, rules: LinkRules, looks: Looks, size: float, found: Array,
) -> int:  # fmt: skip
    """Fill rows (time since the step began, i, j, graph) of the first switch of every link on a step.

    The motion of an agent as it knows itself and that of another one as it knows it have pieces of their own: each
    stretch on which both are one piece is looked at.

    Parameters
    ----------
    pieces
        Positions until the end of the step, the last piece.
    tau
        Delays, shape (N, N), see `flocking.model.world.information.Delayed`.
    begin, end
        The step.
    lengths, table
        See `flocking.engine.imperfect.pair_polynomials.Paths`.
    links
        Links by what agents know, shape (graphs, N, N).
    rules
        When links switch by distances.
    looks
        How agents look, for the links of one graph alone, in open space.
    size
        Size of the coordinates, for rounding.
    found
        Takes the rows, shape (room, 4).

    Returns
    -------
    int
        How many rows there are, those included for which there was no room; -1 if a pair has too many images.
    """
    n, m, graphs, newest = tau.shape[0], lengths.shape[0], links.shape[0], pieces.ends.shape[0] - 1
    S, nearest, row, switched = (
        np.empty((pieces.series.shape[1], 2, m)),
        np.empty(m),
        np.empty((1, 4)),
        np.empty(graphs),
    )
    paths = Paths(S, lengths, table, begin)
    total = 0
    for i in range(n):
        for j in range(n):
            if i == j:
                continue
            for graph in range(graphs):
                switched[graph] = 0.0
            t = begin
            own, known = step_at(pieces.ends, t - tau[i, i]), step_at(pieces.ends, t - tau[i, j])
            own_last, known_last = newest, newest
            if pieces.first.shape[0] > 0 and tau[i, i] > 0.0:
                own, own_last = max(own, pieces.first[i, i]), pieces.last[i, i]
            if pieces.first.shape[0] > 0 and tau[i, j] > 0.0:
                known, known_last = max(known, pieces.first[i, j]), pieces.last[i, j]
            own, known = min(own, own_last), min(known, known_last)
            while t < end:
                until = end
                if own < own_last:
                    until = min(until, pieces.ends[own] + tau[i, i])
                if known < known_last:
                    until = min(until, pieces.ends[known] + tau[i, j])
                if until > t:
                    shift_path(pieces, own, i, t - tau[i, i] - pieces.begins[own], S, 0)
                    shift_path(pieces, known, j, t - tau[i, j] - pieces.begins[known], S, 1)
                    distance, reach = nearest_offset(paths, 0, 1, nearest), reach_within(paths, 0, 1, until - t)
                    two = TwoPaths(0, 1, until - t, distance, reach)
                    for graph in range(graphs):
                        if rules.ways[graph] == 0 or switched[graph] > 0.0:
                            continue
                        if looks.series.shape[0]:
                            slack = ROUNDING * (looks.radii[i] + size)
                            look = Looking(i, j, looks.radii[i], looks.cosines[i], slack)
                            now, near = Moment(t, own, tau[i, i]), links[graph, i, j]
                            count = add_view_switches(paths, two, looks, pieces, now, look, near, row)
                        else:
                            appear, leave = rules.appear[graph, i], rules.break_[graph, i]
                            link = WatchedLink(links[graph, i, j], appear, leave, i, j, graph)
                            count = add_switches(paths, two, nearest, link, size, row, 0)
                        if count < 0:
                            return -1
                        if count > 0:
                            switched[graph] = 1.0
                            if total < found.shape[0]:
                                found[total, 0], found[total, 1] = t - begin + row[0, 0], i
                                found[total, 2], found[total, 3] = j, graph
                            total += 1
                if own < own_last and pieces.ends[own] + tau[i, i] <= until:
                    own += 1
                if known < known_last and pieces.ends[known] + tau[i, j] <= until:
                    known += 1
                t = max(t, until)
    return total
