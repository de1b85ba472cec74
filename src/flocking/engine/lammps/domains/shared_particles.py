"""Sums, extremes and errors of a group whose agents are divided among ranks."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flocking.arrays import AnyArray, Array, Numbers32
from flocking.engine.lammps.ranks import Ranks
from flocking.engine.tiles.particles.particle_arrays import ParticleArrays


class SharedParticles(ParticleArrays):
    """Particle arrays whose numbers of the group are those of all ranks. All methods are collective.

    Attributes
    ----------
    ranks
        The ranks.
    notice
        A number of the first rank that all get with the results of the next pass; the largest is ``noticed``.
    """

    ranks: Ranks
    notice = noticed = 0.0
    _totals: Array = np.zeros(0)

    def _mean_velocity(self) -> Array:
        total: Array = self.group_sum(self.agents[: self.n, self.m :].sum(axis=0, dtype=np.float64)) / self.everyone
        return total

    def _largest_speed(self) -> float:
        n, m = self.n, self.m
        speeds = self.agents[:n, m:].astype(np.float64) - self._mean_velocity()
        with np.errstate(over="ignore"):
            return self.highest(float(np.sqrt((speeds**2).sum(axis=1).max(initial=0.0))))

    def highest(self, value: float) -> float:
        """The largest of a number of each rank; infinite if one is not a number."""
        return float(self.ranks.reduced(np.array([value if value == value else np.inf]), np.zeros(0))[0][0])

    def group_sum(self, values: Array) -> Array:
        """Sum over all ranks.

        Parameters
        ----------
        values
            Sums over the agents of this rank.
        """
        found: Array = self.ranks.reduced(np.zeros(0), values.ravel())[1].reshape(values.shape)
        return found

    def total_sums(self) -> Array:
        """The sums of the last pass over the tiles of all ranks."""
        return self._totals

    def displacement_bound(self) -> float:
        """Bound on the displacement of any agent of any rank since the rebuild, relative to the group."""
        return self.highest(super().displacement_bound())

    def read_tile_extremes(self) -> None:
        """Compute the extremes over the results of the tiles of all ranks."""
        super().read_tile_extremes()
        fast, near, broken = self.results.extremes
        sums = self.results.sums.sum(axis=0) if self.spec.ledger else np.zeros(0)
        found, self._totals = self.ranks.reduced(np.array([fast, -near, broken, self.notice]), sums)
        self.results.extremes[:] = found[0], -found[1], found[2]
        self.noticed = float(found[3])

    def _broken_pair(self) -> tuple[int, int] | None:
        own = super()._broken_pair() if self.tiles and self.results.tile_extremes[:, 2].max() > 0 else None
        return next((x for x in self.ranks.comm.allgather(own) if x is not None), None)

    def agreed_pair(self, square: float, pair: tuple[int, int] | None) -> tuple[int, int] | None:
        """The closest pair of all ranks.

        Parameters
        ----------
        square
            Smallest squared distance on this rank.
        pair
            Numbers of its agents.
        """
        found: tuple[float, tuple[int, int] | None] = min(self.ranks.comm.allgather((square, pair)), key=lambda x: x[0])
        return found[1]

    def agree(self, check: Callable[[], None]) -> None:
        """Make a check; an error of one rank is raised on all.

        Parameters
        ----------
        check
            Raises the error.
        """
        self.ranks.agree(check)

    def motions(self) -> tuple[Array, Array, Numbers32] | None:
        """Positions before the last step, displacements in it and numbers of all agents, on the first rank."""
        q, moved, _ = super().motions() or (np.zeros(0), np.zeros(0), np.zeros(0, np.int32))
        found = self.gathered(np.concatenate([q, moved], axis=1))
        return (
            None
            if found is None
            else (found[:, : self.m], found[:, self.m :], np.arange(self.everyone, dtype=np.int32))
        )

    def gathered(self, rows: AnyArray) -> Array | None:
        """Rows of numbers of all agents in the order of their numbers, on the first rank; None elsewhere.

        Parameters
        ----------
        rows
            Those of the agents of this rank, shape (n, columns).
        """
        numbered = np.concatenate([self.ids[: self.n, None].astype(np.float64), rows.astype(np.float64)], axis=1)
        found = self.ranks.gathered(np.ascontiguousarray(numbered))
        if found is None:
            return None
        out = np.empty((self.everyone, rows.shape[1]))
        out[found[:, 0].astype(np.int64)] = found[:, 1:]
        return out
