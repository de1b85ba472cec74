"""Numbers of the agents in lists of neighbours, and how far apart in memory neighbours are."""

from __future__ import annotations

import numpy as np

from flocking.engine.tiles.neighbours.listed_pairs import tile_pairs
from flocking.engine.tiles.neighbours.neighbour_lists import NUMBER, WIDTH, TileLists
from flocking.engine.tiles.simd.vectors import gather, load, store
from flocking.formula.native.functions import native

LOOKED_AT = 32
"""Tiles whose neighbours are looked at: their median is that of all within a few tiles, for a millisecond's work."""

MARGIN = 1.25
"""Ratio of the distance at which samples are fetched to that of the last neighbour of a typical tile: rows of cells
differ by less in length, and twice as far would do as well."""


@native
def take_senders(first_tile, last_tile, rows, first, count, ids, senders, used):  # type: ignore[no-untyped-def]
    """Put the number of the agent that each entry of a list stands for beside the entry, and no sample used of it.

    Parameters
    ----------
    first_tile, last_tile
        Range of tiles, without the last.
    rows, first, count
        The lists, see `TileLists`; ``rows`` in one axis.
    ids
        Number of the agent at each place.
    senders
        Takes the numbers, in the order of ``rows``; what belongs to no row of a list is not set.
    used
        Takes 0 for each entry, in the same order.
    """
    for tile in range(first_tile, last_tile):
        for row in range(first[tile], first[tile] + count[tile]):
            found = gather(ids, load(rows, row * 16) & np.uint32(NUMBER))
            store(senders, row * 16, found)
            store(used, row * 16, found ^ found)


def tiles_ahead(lists: TileLists, n: int) -> int:
    """Number of tiles by which samples should be fetched before the tile that they belong to, at least 1.

    Agents are in the order of cells: most tiles use samples of agents up to one or two rows of cells later. What is
    fetched so many tiles before is there when the first of its neighbours uses it.

    Parameters
    ----------
    lists
        Lists of neighbours.
    n
        Number of agents.
    """
    tiles = len(lists.count)
    last = []
    for tile in range(0, tiles, max(1, tiles // LOOKED_AT)):
        _, j = tile_pairs(lists, [tile], n)
        if len(j):
            last.append(int(j.max()) // WIDTH - tile)
    return max(1, int(MARGIN * float(np.median(last))) + 1) if last else 1


assert WIDTH == 16, "these functions go through the agents of a tile"
