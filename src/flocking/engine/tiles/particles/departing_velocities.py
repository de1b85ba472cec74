"""What velocities of agents of order 1 do beyond those of the law."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array, Reals
from flocking.engine.tiles.kernels.departure_kernel import departure_kernel
from flocking.engine.tiles.kernels.spec import KernelSpec
from flocking.engine.tiles.neighbours.neighbour_lists import WIDTH
from flocking.engine.tiles.particles.particle_arrays import ParticleArrays
from flocking.formula.native.functions import native


@native
def exceed(first, last, lawful, velocity, excess, n, found):  # type: ignore[no-untyped-def]
    """By tile, the sums of v . v and of u . (v - u), with the velocities v that act and u of the law.

    Parameters
    ----------
    first, last
        Range of tiles, without the last.
    n
        Number of agents.
    lawful
        The velocities of the law in the second half of each row, shape (size, 2m).
    velocity
        Those that act, shape (m, size).
    excess
        Takes v - u in the second half of each row, shape (size, 2m); no rows for none.
    found
        Takes the sums, shape (tiles, 2).
    """
    m = velocity.shape[0]
    for tile in range(first, last):
        work, along = np.float64(0.0), np.float64(0.0)
        for i in range(tile * 16, tile * 16 + 16):
            for k in range(m):
                v, u = np.float64(velocity[k, i]), np.float64(lawful[i, m + k])
                if excess.shape[0] > 0:
                    excess[i, m + k] = v - u
                if i < n:
                    work += v * v
                    along += u * (v - u)
        found[tile, 0], found[tile, 1] = work, along


class DepartingVelocities:
    """Powers of the velocities of agents of order 1, beside those of the law.

    Parameters
    ----------
    spec
        Specification of the kernels of the law.
    """

    def __init__(self, spec: KernelSpec) -> None:
        self._kernel = departure_kernel(spec).depart
        self._excess: Reals = np.zeros((0, 0))

    def powers(self, particles: ParticleArrays, t: float, velocity: Reals) -> Array:
        """The sums of v . v and of dH/dq . (v - u) over the group, shape (2,), exactly zero where v is u.

        Parameters
        ----------
        particles
            The agents; the last pass over their present state left the velocities u of the law in the other array.
        t
            The time.
        velocity
            The velocities v that act, shape (m, size).
        """
        tiles, n, m = particles.tiles, particles.n, particles.m
        found, flows, rows = np.zeros((tiles, 2)), np.zeros(tiles), particles.successor[:0]
        if self._kernel is not None:
            if self._excess.shape != particles.agents.shape:
                self._excess = np.zeros_like(particles.agents)
            rows = self._excess
        particles.workers.each(exceed, tiles, particles.successor, velocity, rows, n, found)
        if self._kernel is not None:
            particles.refresh_copies(rows)
            means = particles.results.means.copy()
            if particles.spec.reads_means:
                particles.fill_means(rows.T[m:], means[m:])
            parameters = particles.parameters
            particles.workers.each(
                self._kernel, tiles, float(t), True, particles.agents, rows, n,
                *particles.graph_arguments(particles.lists), *particles.obstacle_arguments(t), parameters.P,
                parameters.A, particles.kernels.obstacle_rows, particles.ids, parameters.seeds, parameters.matrices,
                means, flows,
            )  # fmt: skip
        work, against = found.sum(axis=0)
        return particles.group_sum(np.array([work, flows.sum() - against]))


assert WIDTH == 16, "these functions go through the agents of a tile"
