"""Connected components (flocks) of a link matrix."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import Indices
from flocking.arrays import Links as Links

SMALL = 300
"""Largest group whose components are found by a plain loop, which is faster there than to import SciPy's graphs."""

WORD = 64
"""Bits of a word, and the largest group whose sets of agents are words."""

MOST_DRAWS = 100_000
"""Largest number of draws until a random graph, or that of a random start, is connected."""

MOST_PAIRS = 4 * 10**8
"""Largest number of pairs evaluated in these draws; for many agents there are fewer draws."""

MOST_CONNECTED = 10_000
"""Largest number of agents of which all pairs are drawn or evaluated."""


def most_draws(n: int) -> int:
    """How often a graph of ``n`` agents is drawn until it is connected."""
    return max(1, min(MOST_DRAWS, MOST_PAIRS // max(1, n * n)))


def linked_pairs(links: Links) -> tuple[Indices, Indices]:
    """Ordered pairs of a link matrix, row by row: the agents that sense, and those sensed.

    Parameters
    ----------
    links
        The matrix, shape (N, N), or (N, K) of agents and obstacles.
    """
    # NumPy looks for what is set in a matrix ten times as long as in a row.
    places, columns = np.flatnonzero(links), max(links.shape[1], 1)
    senders = places // columns
    return senders, places - senders * columns


def components(links: Links) -> NDArray[np.intp]:
    """Label of the weakly connected component of each agent, numbered by the first agent of each, from 0 on."""
    links = np.atleast_2d(np.asarray(links, dtype=bool))
    if len(links) > SMALL:
        from scipy.sparse import csr_array
        from scipy.sparse.csgraph import connected_components

        _, found = connected_components(csr_array(links.astype(np.int8)), directed=True, connection="weak")
        return np.asarray(found, dtype=np.intp)
    either = links | links.T
    labels = np.full(len(links), -1, dtype=np.intp)
    label = 0
    for agent in range(len(links)):
        if labels[agent] < 0:
            labels[_reached(either, agent)] = label
            label += 1
    return labels


def is_connected(links: Links) -> bool:
    """Whether all agents belong to one weakly connected component (Olfati-Saber, Definition 1)."""
    either = links | links.T
    if not 0 < len(either) <= WORD:
        return bool(_reached(either, 0).all())
    # Matrices of few agents are asked about many times a run: sets of agents are the bits of an integer.
    packed = np.zeros((len(either), WORD // 8), dtype=np.uint8)
    packed[:, : -(-len(either) // 8)] = np.packbits(either, axis=1, bitorder="little")
    rows = packed.view("<u8")[:, 0].tolist()
    reached = todo = 1
    while todo:
        agent = todo.bit_length() - 1
        found = rows[agent] & ~reached
        reached |= found
        todo = (todo ^ (1 << agent)) | found
    return reached.bit_count() == len(rows)


def _reached(either: Links, agent: int) -> Links:
    """The agents that paths of links lead to from one of them, itself included, shape (N,)."""
    reached = np.zeros(len(either), dtype=bool)
    reached[agent] = True
    frontier = reached
    while frontier.any():
        frontier = either[frontier].any(axis=0) & ~reached
        reached |= frontier
    return reached
