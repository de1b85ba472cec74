"""Neighbour lists of links that never change."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Numbers, Numbers32
from flocking.engine.fixed_step.threads import Workers
from flocking.engine.tiles.neighbours.neighbour_lists import LINKED, WIDTH, TileLists
from flocking.formula.native.functions import native


@native
def _fixed(first_tile, last_tile, n, ids, place, offsets, neighbours, rows, first, count):  # type: ignore[no-untyped-def]
    for tile in range(first_tile, last_tile):
        for lane in range(WIDTH):
            i = tile * WIDTH + lane
            k = 0
            if i < n:
                for at in range(offsets[ids[i]], offsets[ids[i] + 1]):
                    rows[first[tile] + k, lane] = np.uint32(place[neighbours[at]]) | LINKED
                    k += 1
            for rest in range(k, count[tile]):
                rows[first[tile] + rest, lane] = np.uint32(i)


def fixed_lists(
    ids: Numbers32, place: Numbers32, offsets: Numbers, neighbours: Numbers32, workers: Workers, n: int
) -> TileLists:
    """Neighbour lists of a fixed graph.

    Parameters
    ----------
    ids
        Identity of the agent at each index, shape (n or more,).
    place
        Index of each identity, shape (N,).
    offsets, neighbours
        Sensed identities of identity i are ``neighbours[offsets[i] : offsets[i + 1]]``.
    workers
        Threads to use.
    n
        Number of agents in the arrays.
    """
    tiles = (n + WIDTH - 1) // WIDTH
    degree = np.zeros(tiles * WIDTH, np.int64)
    degree[:n] = np.diff(offsets)[ids[:n]]
    count = degree.reshape(tiles, WIDTH).max(axis=1).astype(np.int32)
    first = (np.cumsum(count) - count).astype(np.int64)
    lists = TileLists(np.empty((max(int(count.sum()), 1), WIDTH), np.uint32), first, count)
    workers.each(_fixed, tiles, n, ids, place, offsets, neighbours, lists.rows, first, count)
    return lists


def complete_lists(n: int) -> TileLists:
    """Neighbour lists of the complete graph: all tiles share one list of all agents.

    An agent in its own list is padding, and so is every agent in the list of a lane without an agent; therefore the
    last tile has a list of its own if it is not full. Memory grows with N, not with its square.

    Parameters
    ----------
    n
        Number of agents.
    """
    tiles = (n + WIDTH - 1) // WIDTH
    everyone = np.repeat(np.arange(n, dtype=np.uint32)[:, None] | LINKED, WIDTH, axis=1)
    first = np.zeros(tiles, np.int64)
    if n % WIDTH:
        last = everyone.copy()
        last[:, n % WIDTH :] = np.arange(n, tiles * WIDTH, dtype=np.uint32)
        everyone = np.concatenate([everyone, last])
        first[-1] = n
    return TileLists(everyone, first, np.full(tiles, n, np.int32))
