"""The part of the particle arrays from which another session goes on with the same bits."""

from __future__ import annotations

import copy
from dataclasses import dataclass
from typing import Any

import numpy as np

from flocking.engine.tiles.checkpoint_form import check_particles
from flocking.engine.tiles.particle_arrays import ParticleArrays

FIELDS = (
    "X", "ids", "each", "A", "C", "reference", "elapsed", "bound", "skin", "rebuilds", "lists", "top_speed",
    "_rounding",
    "_first_links", "lost",
)  # fmt: skip


@dataclass
class ParticleMemory:
    """Copies of everything that fixes how the agents go on.

    Parameters
    ----------
    fields
        The copies by name.
    """

    fields: dict[str, Any]

    @classmethod
    def of(cls, particles: ParticleArrays, *, copied: bool) -> ParticleMemory:
        """What fixes how ``particles`` goes on; not ``copied``, it changes as the agents go on."""
        fields = {name: getattr(particles, name) for name in FIELDS}
        fields["rooms"] = [b.capacity for b in particles.builders]
        return cls(copy.deepcopy(fields) if copied else fields)

    def put_back(self, particles: ParticleArrays) -> None:
        """Make ``particles`` go on from here.

        Raises
        ------
        MalformedError
            When this is no memory of such agents.
        """
        check_particles(self.fields, particles)
        for name in FIELDS:
            setattr(particles, name, copy.deepcopy(self.fields[name]))
        if particles.obstacles is not None:
            particles.obstacles.used = np.inf
        for builder, capacity in zip(particles.builders, self.fields["rooms"], strict=True):
            builder.capacity, builder.spare = capacity.copy(), None
