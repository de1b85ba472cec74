"""Lower bound on the number of pairs within reach, from the numbers of agents in cells."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

import numpy as np

from flocking.arrays import Reals
from flocking.engine.tiles.neighbours.neighbour_lists import TooManyNeighboursError

PARTS = {1: 32, 2: 8, 3: 5}
"""Ratio of the reach to the width of a box, by dimension: narrower boxes give a sharper bound and take longer."""


BALL_SHARE = {1: 2.0 / 3.0, 2: np.pi / 9.0, 3: 4.0 / 3.0 * np.pi / 27.0}
"""Fraction of a cell and its neighbours that lies within one width of a point, by dimension."""


NARROWER = 1e-6
"""Relative reduction of the width of boxes, above the rounding of the index of a box."""

GROWTH = 1.1
"""Growth of the estimate beyond which the bound is computed again."""

ENTRY_BYTES = 4.0
"""Memory of one neighbour in a list."""


class PairCountBound:
    """Checks before any search that neighbour lists fit into memory.

    Parameters
    ----------
    memory_limit
        Largest size of the lists of a graph in bytes.
    """

    def __init__(self, memory_limit: float) -> None:
        self._limit = memory_limit
        self._passed = 0.0

    def check(self, crowding: float, q: Reals, reaches: Callable[[], Sequence[float]]) -> None:
        """Check that lists may fit; a new bound is computed only if the estimated number of pairs has grown.

        Parameters
        ----------
        crowding
            Estimate of the sort, see `Sorter.sort`.
        q
            Positions, shape (N, m).
        reaches
            Returns the distance within which every agent lists another, for each graph.

        Raises
        ------
        TooManyNeighboursError
            If the lists of a graph would exceed the limit.
        """
        expected = ENTRY_BYTES * expected_pairs(crowding, *q.shape)
        if expected < max(0.5 * self._limit, GROWTH * self._passed):
            return
        places = q.astype(np.float64)
        for reach in reaches():
            least = ENTRY_BYTES * certain_pairs(places, reach) if reach > 0 else 0.0
            if least > self._limit:
                raise TooManyNeighboursError(least)
        self._passed = expected


def expected_pairs(crowding: float, n: int, m: int) -> float:
    """Estimated number of ordered pairs within reach if agents are spread evenly over each cell and its neighbours.

    Parameters
    ----------
    crowding
        Estimate of the sort, see `Sorter.sort`.
    n
        Number of agents.
    m
        Dimension of their space.
    """
    return float(BALL_SHARE[m] * 6.0**m * (crowding + n))


def certain_pairs(q: Reals, reach: float) -> float:
    """A lower bound on the number of ordered pairs within reach.

    Agents are counted in boxes narrower than the reach. All pairs of two boxes are within reach if the farthest
    corners of the boxes are.

    Parameters
    ----------
    q
        Positions, shape (N, m), with m at most 3.
    reach
        Distance below which two agents are a pair.
    """
    m = q.shape[1]
    parts = PARTS[m]
    # Rounding may put an agent into the next box, so boxes are slightly narrower than assumed.
    width = reach / parts * (1.0 - NARROWER)
    box = np.floor((q - q.min(axis=0)) / width).astype(np.int64)
    sizes = box.max(axis=0) + 2 * parts
    if float(np.prod(sizes.astype(float))) > 2.0**62:
        return 0.0
    strides = np.append(1, np.cumprod(sizes[:-1]))
    keys, counts = np.unique((box + parts) @ strides, return_counts=True)
    held = counts.astype(float)
    total = float((held * (held - 1.0)).sum())
    for offset in itertools.product(range(-parts, parts + 1), repeat=m):
        # Each unordered pair of boxes once.
        if offset <= (0,) * m or sum((abs(k) + 1) ** 2 for k in offset) > parts**2:
            continue
        neighbour_keys = keys + int(np.dot(offset, strides))
        found_at = np.minimum(np.searchsorted(keys, neighbour_keys), len(keys) - 1)
        total += 2.0 * float((held * held[found_at])[keys[found_at] == neighbour_keys].sum())
    return total
