"""The log of what agents used at a tick, from the marks that the control kernel writes beside the entries of its lists.

A mark is zero where the neighbour of an entry is not used; else it holds the number of the sample, counted from 1, with
the top bit set. Marks stand in the rows of the lists, tile after tile, also where tiles share one list.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import AnyArray, Indices, Numbers, Numbers32
from flocking.engine.runs.message_log import LEADER, LEADER_SENDER, OWN, PRESENT, USE_PARTS
from flocking.engine.tiles.neighbours.neighbour_lists import NUMBER, WIDTH, TileLists
from flocking.formula.native.functions import native

SAMPLE = np.uint32((1 << 31) - 1)
"""Bits of a mark with the number of the sample."""


class Marked(NamedTuple):
    """Marks of one graph and the lists beside which they stand.

    Parameters
    ----------
    rows, first, rooms
        The lists, see `TileLists`; ``rooms`` is the number of rows of each tile.
    marks
        The marks, shape (rows, 16).
    placed
        First row of the marks of each tile, shape (tiles,).
    """

    rows: NDArray[np.uint32]
    first: Numbers
    rooms: Numbers32
    marks: NDArray[np.uint32]
    placed: Numbers


@native
def _count(marked, ranks, ids, of_receivers, of_senders):  # type: ignore[no-untyped-def]
    """Count what each agent that acts uses, and how often each agent is used."""
    for tile in range(marked.rooms.shape[0]):
        for lane in range(WIDTH):
            i = tile * WIDTH + lane
            if ranks[i] < 0:
                continue
            for step in range(marked.rooms[tile]):
                if marked.marks[marked.placed[tile] + step, lane]:
                    j = np.int64(marked.rows[marked.first[tile] + step, lane] & NUMBER)
                    of_receivers[ranks[i]] += 1
                    of_senders[ids[j]] += 1


@native
def _sort(marked, messages, ranks, ids, next_, found):  # type: ignore[no-untyped-def]
    """Fill rows (rank of the receiver, sample) in order of the senders; ``next_`` is where those of each begin."""
    for tile in range(marked.rooms.shape[0]):
        for lane in range(WIDTH):
            i = tile * WIDTH + lane
            if ranks[i] < 0:
                continue
            for step in range(marked.rooms[tile]):
                mark = marked.marks[marked.placed[tile] + step, lane]
                if mark:
                    sender = ids[np.int64(marked.rows[marked.first[tile] + step, lane] & NUMBER)]
                    found[next_[sender], 0] = ranks[i]
                    found[next_[sender], 1] = np.int64(mark & SAMPLE) - 1 if messages else PRESENT
                    next_[sender] += 1


@native
def _fill(graph, found, of_senders, next_, uses):  # type: ignore[no-untyped-def]
    """Write entries of the log, of each receiver in order of the senders; ``next_`` is where its next one stands."""
    at = 0
    for sender in range(of_senders.shape[0]):
        for _ in range(of_senders[sender]):
            row = next_[found[at, 0]]
            uses[row, 0], uses[row, 1], uses[row, 2] = graph, sender, found[at, 1]
            next_[found[at, 0]] += 1
            at += 1


class UsedSamples:
    """Marks of the control kernel, and the entries of the log that follow from them.

    Parameters
    ----------
    messages
        Whether agents know each other by messages; else they use the present state.
    """

    def __init__(self, *, messages: bool) -> None:
        self._messages = messages
        self._marked: list[Marked] = []

    def arrays(self, lists: list[TileLists]) -> list[AnyArray]:
        """Marks of each graph with their places, as the kernel takes them, for these lists of neighbours."""
        before, self._marked = self._marked, []
        for number, each in enumerate(lists):
            placed = np.cumsum(each.count, dtype=np.int64) - each.count
            count = max(int(each.count.sum()), 1)
            old = before[number].marks if before else np.zeros((0, WIDTH), np.uint32)
            marks = old if len(old) == count else np.zeros((count, WIDTH), np.uint32)
            self._marked.append(Marked(each.rows, each.first, each.count, marks, placed))
        return [x for each in self._marked for x in (each.marks.reshape(-1), each.placed)]

    def entries(
        self, agents: Indices, places: Indices, ids: Numbers32, own: Numbers | None, leaders: Numbers | None
    ) -> tuple[Indices, NDArray[np.int64]]:
        """What some agents used when the kernel ran last.

        Parameters
        ----------
        agents, places
            Who acted, ascending, and where they stand in sorted order.
        ids
            Number of the agent at each place, shape (size,).
        own
            Numbers of the samples by which these agents know themselves; None where they know the truth.
        leaders
            Numbers of the samples by which they know leaders; None where they know them exactly.

        Returns
        -------
        tuple of arrays
            Number of entries of each agent, shape (agents,), and the entries, as in
            `flocking.engine.runs.message_log.MessageLog.uses`: of each agent that of the leaders, its own, and those of
            each graph in order of the senders.
        """
        graphs, everyone = len(self._marked), int(ids.max(initial=-1)) + 1
        ranks = np.full(len(ids), -1, np.int64)
        ranks[places] = np.arange(len(agents))
        of_receivers = np.zeros((graphs, len(agents)), np.int64)
        of_senders = np.zeros((graphs, everyone), np.int64)
        for number, marked in enumerate(self._marked):
            _count(marked, ranks, ids, of_receivers[number], of_senders[number])
        before = [
            np.stack([np.full(len(agents), kind), sender, number], axis=1)
            for kind, sender, number in ((LEADER, np.full(len(agents), LEADER_SENDER), leaders), (OWN, agents, own))
            if number is not None
        ]
        counts: Indices = of_receivers.sum(axis=0) + len(before)
        uses = np.empty((int(counts.sum()), len(USE_PARTS)), np.int64)
        next_ = np.cumsum(counts) - counts
        for rows in before:
            uses[next_] = rows
            next_ += 1
        for number, marked in enumerate(self._marked):
            of_all = of_senders[number]
            found = np.empty((int(of_all.sum()), 2), np.int64)
            _sort(marked, self._messages, ranks, ids, np.cumsum(of_all) - of_all, found)
            _fill(number, found, of_all, next_, uses)
        return counts, uses
