"""Lower bound on the number of pairs within reach, from the numbers of agents in cells."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from flocking.arrays import Reals
from flocking.engine.fixed_step.certain_pairs import ENTRY_BYTES, certain_pairs
from flocking.engine.tiles.neighbours.neighbour_lists import TooManyNeighboursError
from flocking.model.space import OPEN, Space

BALL_SHARE = {1: 2.0 / 3.0, 2: np.pi / 9.0, 3: 4.0 / 3.0 * np.pi / 27.0}
"""Fraction of a cell and its neighbours that lies within one width of a point, by dimension."""


GROWTH = 1.1
"""Growth of the estimate beyond which the bound is computed again."""


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

    def check(
        self, crowding: float, q: Reals, reaches: Callable[[], Sequence[float]], space: Space = OPEN
    ) -> None:  # fmt: skip
        """Check that lists may fit; a new bound is computed only if the estimated number of pairs has grown.

        Parameters
        ----------
        crowding
            Estimate of the sort, see `Sorter.sort`.
        q
            Positions, shape (N, m).
        reaches
            Returns the distance within which every agent lists another, for each graph.
        space
            Where axes repeat, images of the positions in its box are counted.

        Raises
        ------
        TooManyNeighboursError
            If the lists of a graph would exceed the limit.
        """
        expected = ENTRY_BYTES * expected_pairs(crowding, *q.shape)
        if expected < max(0.5 * self._limit, GROWTH * self._passed):
            return
        places = q.astype(np.float64) if space.is_open else space.wrapped(q.astype(np.float64))
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
