"""Detection of an unstable time step on many processes, from the same sample of agents as on one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import Reals
from flocking.engine.tiles.instability import SAMPLE, Instability

if TYPE_CHECKING:
    from flocking.engine.lammps.domains.particles import RankParticles
    from flocking.engine.tiles.particles.particle_arrays import ParticleArrays


class RankInstability(Instability):
    """As `Instability`, with the changes of velocity of agents of all ranks."""

    def _sampled(self, particles: ParticleArrays) -> NDArray[np.int32]:
        """Indices of the sampled agents that this rank has."""
        each = max(1, particles.everyone // SAMPLE)
        return np.flatnonzero(particles.ids[: particles.n] % each == 0).astype(np.int32)

    def _changes(self, particles: ParticleArrays) -> Reals:
        m, each = particles.m, max(1, particles.everyone // SAMPLE)
        found = np.zeros((-(-particles.everyone // each), m))
        at = particles.ids[self.places] // each
        found[at] = particles.agents[self.places, m:].astype(np.float64) - particles.successor[self.places, m:]
        return particles.group_sum(found)

    def _farthest(self, particles: ParticleArrays) -> float:
        ranks: RankParticles = particles  # type: ignore[assignment]  # sessions of this folder have no others
        return ranks.highest(float(np.abs(particles.agents[self.places, : particles.m]).max(initial=0.0)))
