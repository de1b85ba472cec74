"""Pairs of agents read from neighbour lists, for checks and observables."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import Numbers, Reals
from flocking.engine.tiles.neighbours.neighbour_lists import LINKED, NUMBER, WIDTH, TileLists
from flocking.model.graphs.connectivity import Links
from flocking.model.space import OPEN, Space


def tile_pairs(lists: TileLists, tiles: Iterable[int], n: int, *, linked: bool = False) -> tuple[Numbers, Numbers]:
    """Indices of the ordered pairs in the lists of some tiles, or only of those that are marked as linked."""
    none = np.zeros(0, np.int64)
    found = [(none, none)]
    for tile in tiles:
        entries = lists.rows[lists.first[tile] : lists.first[tile] + lists.count[tile]]
        i = np.broadcast_to(tile * WIDTH + np.arange(WIDTH), entries.shape)
        j = (entries & NUMBER).astype(np.int64)
        keep = (i != j) & (i < n)
        if linked:
            keep &= entries > NUMBER
        found.append((i[keep], j[keep]))
    return np.concatenate([i for i, _ in found]), np.concatenate([j for _, j in found])


def listed_pairs(lists: TileLists, n: int, *, linked: bool = False) -> tuple[Numbers, Numbers]:
    """Indices of all ordered pairs in the lists, or only of the linked ones, sorted by the sensing agent."""
    tile = np.repeat(np.arange(len(lists.count)), lists.count)
    row = np.arange(len(tile)) - np.repeat(np.cumsum(lists.count) - lists.count, lists.count)
    entries = lists.rows[np.repeat(lists.first, lists.count) + row]
    i = np.broadcast_to(tile[:, None] * WIDTH + np.arange(WIDTH), entries.shape)
    j = (entries & NUMBER).astype(np.int64)
    chosen = (j != i) & (i < n)
    if linked:
        chosen &= entries > NUMBER
    i, j = i[chosen], j[chosen]
    ranks = np.lexsort((j, i))
    return i[ranks], j[ranks]


def nearest_pair_beyond(
    square: float, neighbour_lists: Sequence[TileLists | None], tiles: Iterable[int], positions: Reals, n: int,
    space: Space = OPEN,
) -> tuple[int, int]:  # fmt: skip
    """Indices of the nearest listed pair of some tiles at a squared distance of at least ``square``.

    Parameters
    ----------
    square
        The squared distance.
    neighbour_lists
        The lists of every graph.
    tiles
        The tiles.
    positions
        Positions, shape (m, size).
    n
        Number of agents.
    space
        Their space.
    """
    pairs = [tile_pairs(lists, tiles, n) for lists in neighbour_lists if lists is not None]
    i, j = (np.concatenate(x) for x in zip(*pairs, strict=True))
    squares = (space.displacement((positions[:, j] - positions[:, i]).T) ** 2).sum(axis=1)
    k = int(np.argmin(np.where(squares >= square, squares, np.inf)))
    return int(i[k]), int(j[k])


def remember_links(lists: TileLists, links: Links, ids: NDArray[np.int32]) -> None:
    """Set the link bits of neighbour lists.

    Parameters
    ----------
    links
        Link matrix by the numbers of the agents, shape (N, N).
    ids
        Number of the agent at each index, shape (size,).
    """
    tile = np.repeat(np.arange(len(lists.count)), lists.count)
    at = np.concatenate([np.arange(f, f + c) for f, c in zip(lists.first, lists.count, strict=True)]).astype(int)
    entries = lists.rows[at]
    i = ids[tile[:, None] * WIDTH + np.arange(WIDTH)]
    j = ids[(entries & NUMBER).astype(np.int64)]
    lists.rows[at] = np.where(links[i, j], entries | LINKED, entries & NUMBER)
