"""Samples of the agents of a rank and of its copies; those of copies are taken here too, since draws are counted."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import AnyArray, Array, Reals
from flocking.engine.fixed_step.threads import Workers
from flocking.engine.lammps.ranks import Ranks
from flocking.engine.tiles.held.messages import SampleStore, Taking
from flocking.engine.tiles.neighbours.neighbour_lists import WIDTH
from flocking.model.law import Scenario


class RankSampleStore(SampleStore):
    """Samples of the agents of this rank, in whole tiles, and behind them of copies of agents of other ranks.

    Noise is a function of seed, agent and number of the sample, and both ranks have the same true state of an agent
    when it takes one: no sample is ever sent, except with an agent that changes ranks and to new copies.

    Parameters
    ----------
    scenario, agents, n, dtype, memory_limit, workers
        As for `SampleStore`, of the agents of this rank.
    ranks
        The ranks.
    """

    def __init__(
        self, scenario: Scenario, agents: Reals, n: int, dtype: type[np.float32] | type[np.float64],
        memory_limit: float, workers: Workers, ranks: Ranks,
    ) -> None:  # fmt: skip
        self._ranks, self._first = ranks, len(agents)
        # One rank may have no room where others do.
        ranks.agree(lambda: SampleStore.__init__(self, scenario, agents, n, dtype, memory_limit, workers))

    @property
    def filled(self) -> NDArray[np.bool_]:
        """The places at which there are agents or copies."""
        found = np.ones(self.size, dtype=bool)
        found[self.n : self._first] = False
        return found

    def columns(self) -> AnyArray:
        """All that belongs to an agent, in a row for each agent of this rank."""
        n, m2, count = self.n, self.rows.shape[1], self.depth + 1
        tables = (self.rows, self.truth) if self.keeps_truth else (self.rows,)
        parts = [x.reshape(count, self.size, m2)[:, :n].transpose(1, 0, 2).reshape(n, count * m2) for x in tables]
        errors = self.errors[:, : self.n].T if self.correlated else np.zeros((self.n, 0))
        return np.concatenate([*parts, errors], axis=1).astype(np.float64)

    @property
    def width(self) -> int:
        """Number of columns of `columns`."""
        m2 = self.rows.shape[1]
        return int(m2 * ((self.depth + 1) * (2 if self.keeps_truth else 1) + (1 if self.correlated else 0)))

    def hold(self, columns: AnyArray, n: int, first: int) -> None:
        """Hold other agents and copies. Collective.

        Parameters
        ----------
        columns
            A row of `columns` for each place.
        n
            Number of agents of this rank.
        first
            The place of the first copy.
        """
        both, m2 = self.keeps_truth, self.rows.shape[1]
        self.n, self._first, self.size = n, first, len(columns)
        self._ranks.agree(self.check_room)
        width = m2 * (self.depth + 1)
        self._rooms.clear()
        self.rows = self._by_place(columns[:, :width])
        self.truth = self._by_place(columns[:, width : 2 * width]) if both else self.rows
        if self.correlated:
            self.errors = np.ascontiguousarray(columns[:, 2 * width if both else width :].T)

    def _by_place(self, columns: AnyArray) -> Reals:
        """Samples in the order of `rows`, from those of each agent side by side."""
        m2 = self.rows.shape[1]
        found = columns.reshape(self.size, self.depth + 1, m2).transpose(1, 0, 2).reshape(-1, m2)
        return np.ascontiguousarray(found.astype(self.rows.dtype))

    def _taken(self, taking: Taking) -> Array:
        """Take samples of the agents, then of the copies, whose number is no whole number of tiles."""
        most = np.zeros(2)
        for places in (slice(0, self._first), slice(self._first, self.size)):
            part, count = self._part(taking, places), places.stop - places.start
            if not count:
                continue
            most = np.maximum(most, super()._taken(part))
            taking.target[places] = part.target[:count]
            if self.correlated:
                taking.errors[:, places] = part.errors[:, :count]
        return most

    def _part(self, taking: Taking, places: slice) -> Taking:
        """Some places of the arguments, filled up to whole tiles with agents that take no samples."""
        count = places.stop - places.start
        size = -(-count // WIDTH) * WIDTH

        def cut(x: AnyArray) -> AnyArray:
            if len(x) != self.size:
                return x
            if count == size:
                return x[places]
            found = np.zeros((size, *x.shape[1:]), x.dtype)
            found[:count] = x[places]
            return found

        marked, agents, target, ids, numbers, errors, memory, sizes = taking
        of_errors = np.ascontiguousarray(cut(errors.T).T) if self.correlated else errors
        return Taking(
            cut(marked), cut(agents), cut(target), cut(ids), cut(numbers), of_errors, cut(memory), sizes
        )  # fmt: skip

    def _largest(self, off: Array) -> Array:
        return self._ranks.reduced(off, np.zeros(0))[0]
