"""What an agent knows of the others in one call of its controller: copied, checked, and linked by the graphs."""

from __future__ import annotations

import math
from typing import NamedTuple

from flocking.arrays import Array, Indices, Links
from flocking.engine.kernels.displacements import nearest_difference
from flocking.formula.native.functions import native

NOT_FINITE, NO_AGENT, TWICE, NO_STAMP = 1, 2, 3, 4
"""Faults of what is known of the others: a number that is not finite, an agent that is not, one given twice, a stamp
that is not finite or in the future."""

CLOSED, FIXED = 1.0, 2.0
"""Kinds of graphs in the native rules: links of a start at the radius itself, and links that never change."""


class Own(NamedTuple):
    """What the agent knows of itself.

    Parameters
    ----------
    t
        Now.
    q, p
        Its position and velocity, shape (m,).
    """

    t: float
    q: Array
    p: Array


class Others(NamedTuple):
    """What it knows of the others.

    Parameters
    ----------
    who
        Their numbers, shape (k,).
    q, p
        Their positions and velocities, shape (k, m).
    stamps
        When these were measured, shape (k,); empty where no age counts.
    """

    who: Indices
    q: Array
    p: Array
    stamps: Array


class LinkMemory(NamedTuple):
    """Links before and after a call.

    Parameters
    ----------
    links, after
        Which agents are linked, shape (graphs, agents).
    started
        Whether there was a call before.
    """

    links: Links
    after: Links
    started: bool


class CallRules(NamedTuple):
    """What is the same in all calls.

    Parameters
    ----------
    rules
        Of each graph the distances at which links appear and break, and its kind, shape (graphs, 3).
    lengths
        Length after which each axis repeats, 0 where it does not, shape (m,).
    relative
        Whether the others are given relative to the agent.
    expires
        Age from which what is known is not used.
    """

    rules: Array
    lengths: Array
    relative: bool
    expires: float


class Room(NamedTuple):
    """Arrays that calls fill.

    Parameters
    ----------
    marks
        Number of the last call that named each agent, shape (agents,).
    r
        Distances of the others; -1 for those whose age is too great, shape (agents + 1,).
    sensed
        Rows of the linked agents, of each graph after those of the one before.
    """

    marks: Indices
    r: Array
    sensed: Indices


@native
def known_and_linked(  # type: ignore[no-untyped-def]
    call, relative, started, own, moving, who, places, speeds, lengths, rules, links, after, marks, Q, V, r, sensed,
    offsets, t, stamps, expires,
):  # fmt: skip
    """Copy and check what is known, and find the linked agents of every graph; returns a fault, 0 for none.

    Arguments are the fields of the classes of this module: given as such they would make a call a third slower.

    Parameters
    ----------
    call
        Number of the call.
    own, moving
        Position and velocity of the agent.
    who, places, speeds, stamps
        Fields of `Others`.
    relative, rules, lengths, expires
        Fields of `CallRules`.
    started, links, after
        Fields of `LinkMemory`.
    marks, r, sensed
        Fields of `Room`.
    Q, V
        Take positions and velocities of the agent and of the others, shape (k + 1, m).
    offsets
        Takes where the linked agents of each graph begin in ``sensed``.
    t
        Now.
    """
    others, room = Others(who, places, speeds, stamps), Room(marks, r, sensed)
    fixed = CallRules(rules, lengths, relative, expires)
    fault = take_known(call, Own(t, own, moving), others, fixed, room, Q, V)
    if fault == 0:
        find_linked(others, LinkMemory(links, after, started), fixed, room, offsets)
    return fault


def take_known(call: int, own: Own, others: Others, fixed: CallRules, room: Room, Q: Array, V: Array) -> int:
    """Copy and check what is known; returns a fault, 0 for none.

    Parameters
    ----------
    call, Q, V
        As for `known_and_linked`.
    own, others, fixed
        What is known.
    room
        Filled.
    """
    m, n = own.q.shape[0], room.marks.shape[0]
    for c in range(m):
        if own.q[c] - own.q[c] != 0.0 or own.p[c] - own.p[c] != 0.0:
            return NOT_FINITE
        Q[0, c] = own.q[c]
        V[0, c] = own.p[c]
    for e in range(others.who.shape[0]):
        j = others.who[e]
        if others.stamps.shape[0] > 0:
            stamp = others.stamps[e]
            if not stamp <= own.t or stamp - stamp != 0.0:
                return NO_STAMP
            if not own.t - stamp < fixed.expires:
                # Too old to be used; no distance is -1.
                room.r[e] = -1.0
                continue
        if j < 0 or j >= n:
            return NO_AGENT
        if room.marks[j] == call:
            return TWICE
        room.marks[j] = call
        square = 0.0
        for c in range(m):
            x = others.q[e, c] + (own.q[c] if fixed.relative else 0.0)
            v = others.p[e, c] + (own.p[c] if fixed.relative else 0.0)
            if x - x != 0.0 or v - v != 0.0:
                return NOT_FINITE
            Q[e + 1, c] = x
            V[e + 1, c] = v
            d = x - own.q[c]
            if fixed.lengths[c] > 0.0:
                d = nearest_difference(d, fixed.lengths[c])
            square += d * d
        room.r[e] = math.sqrt(square)
    return 0


def find_linked(others: Others, memory: LinkMemory, fixed: CallRules, room: Room, offsets: Indices) -> None:
    """Find the linked agents of every graph.

    Parameters
    ----------
    others, fixed
        What is known.
    memory, room
        The links after the call, and the rows of linked agents, are filled.
    offsets
        As for `known_and_linked`.
    """
    total, rules = 0, fixed.rules
    for g in range(rules.shape[0]):
        offsets[g] = total
        for j in range(room.marks.shape[0]):
            memory.after[g, j] = memory.links[g, j] and rules[g, 2] == FIXED
        for e in range(others.who.shape[0]):
            j, r = others.who[e], room.r[e]
            if r < 0.0:
                continue
            old = memory.links[g, j]
            if rules[g, 2] == FIXED:
                linked = old
            else:
                level = rules[g, 1] if old or not memory.started else rules[g, 0]
                linked = r < level or (rules[g, 2] == CLOSED and r == level)
            if linked:
                room.sensed[total] = e + 1
                total += 1
                memory.after[g, j] = True
    offsets[rules.shape[0]] = total
