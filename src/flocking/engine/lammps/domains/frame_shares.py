"""Frames divided among the ranks by the numbers of agents, so that each rank writes whole chunks on disk."""

from __future__ import annotations

import numpy as np

from flocking.arrays import AnyArray, Array, Numbers32
from flocking.engine.lammps.domains.messages import sent
from flocking.engine.lammps.ranks import Ranks


class FrameShares:
    """Who writes which agents of a frame.

    Parameters
    ----------
    ranks
        The ranks.
    n
        Number of agents of all.
    agents
        Agents of a chunk.
    """

    def __init__(self, ranks: Ranks, n: int, agents: int) -> None:
        chunks = -(-n // agents)
        self._ranks = ranks
        self._first = np.minimum([agents * (chunks * rank // ranks.size) for rank in range(ranks.size + 1)], n)

    def collected(self, ids: Numbers32, rows: AnyArray) -> tuple[int, Array]:
        """The number of the first agent that this rank writes, and the rows of its agents in order. Collective.

        Parameters
        ----------
        ids, rows
            Numbers and rows of the agents that this rank moves.
        """
        to = np.searchsorted(self._first[1:], ids, side="right")
        # Short numbers are sorted by counting.
        order = np.argsort(to.astype(np.uint16), kind="stable")
        numbered = np.concatenate([ids[order, None].astype(np.float64), rows[order]], axis=1)
        received, _ = sent(self._ranks.comm, to[order], numbered)
        first, end = (int(x) for x in self._first[self._ranks.rank : self._ranks.rank + 2])
        found = np.empty((end - first, rows.shape[1]))
        found[received[:, 0].astype(np.int64) - first] = received[:, 1:]
        return first, found
