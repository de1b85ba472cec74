"""Links as tables of numbers of agents, in which form they travel with the agents."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Numbers32
from flocking.engine.fixed_step.threads import Workers
from flocking.engine.tiles.neighbours.neighbour_lists import LINKED, NUMBER, WIDTH, TileLists
from flocking.formula.native.functions import native


@native
def _count(first_tile, last_tile, n, rows, first, count, out):  # type: ignore[no-untyped-def]
    """Number of linked neighbours of every agent."""
    for tile in range(first_tile, last_tile):
        for lane in range(min(WIDTH, n - tile * WIDTH)):
            k = np.int64(0)
            for row in range(first[tile], first[tile] + count[tile]):
                if rows[row, lane] > NUMBER:
                    k += 1
            out[tile * WIDTH + lane] = k


@native
def _write(first_tile, last_tile, n, ids, rows, first, count, table):  # type: ignore[no-untyped-def]
    """Numbers of the linked neighbours of every agent, plus one, then zeros."""
    for tile in range(first_tile, last_tile):
        for lane in range(min(WIDTH, n - tile * WIDTH)):
            i, k = tile * WIDTH + lane, 0
            for row in range(first[tile], first[tile] + count[tile]):
                entry = rows[row, lane]
                if entry > NUMBER:
                    table[i, k] = ids[np.int64(entry & NUMBER)] + 1
                    k += 1
            for rest in range(k, table.shape[1]):
                table[i, rest] = 0


@native
def _mark(first_tile, last_tile, n, ids, table, rows, first, count, lost):  # type: ignore[no-untyped-def]
    """Link the listed pairs of a table; report a linked pair that is not listed."""
    for tile in range(first_tile, last_tile):
        for lane in range(min(WIDTH, n - tile * WIDTH)):
            i = tile * WIDTH + lane
            for k in range(table.shape[1]):
                requested = table[i, k]
                if requested == 0:
                    break
                here = False
                for row in range(first[tile], first[tile] + count[tile]):
                    if ids[np.int64(rows[row, lane] & NUMBER)] + 1 == requested:
                        rows[row, lane] |= LINKED
                        here = True
                if not here:
                    lost[0] = ids[i]
                    lost[1] = requested - 1


def most_links(lists: TileLists, n: int, workers: Workers) -> int:
    """Largest number of linked neighbours of an agent.

    Parameters
    ----------
    lists
        Neighbour lists with links.
    n
        Number of agents.
    workers
        Threads to use.
    """
    out = np.zeros(max(n, 1), np.int32)
    workers.each(_count, len(lists.count), n, lists.rows, lists.first, lists.count, out)
    return int(out.max())


def link_table(lists: TileLists, n: int, ids: Numbers32, width: int, workers: Workers) -> Numbers32:
    """Numbers of the linked neighbours of every agent, plus one and filled with zeros, shape (n, width).

    Parameters
    ----------
    lists
        Neighbour lists with links.
    n
        Number of agents.
    ids
        Number of the agent at each index, copies included.
    width
        At least what `most_links` gives.
    workers
        Threads to use.
    """
    table = np.zeros((n, max(width, 1)), np.int32)
    workers.each(_write, len(lists.count), n, ids, lists.rows, lists.first, lists.count, table)
    return table


def mark_links(lists: TileLists, n: int, ids: Numbers32, table: Numbers32, workers: Workers) -> tuple[int, int] | None:
    """Set the links of a table in new neighbour lists; the numbers of a linked pair that is not listed, or None.

    Parameters
    ----------
    lists
        Neighbour lists without links.
    n, ids, workers
        As for `link_table`.
    table
        What `link_table` gave, in the order of the agents now.
    """
    lost = np.full(2, -1, np.int64)
    workers.each(_mark, len(lists.count), n, ids, table, lists.rows, lists.first, lists.count, lost)
    return (int(lost[0]), int(lost[1])) if lost[0] >= 0 else None
