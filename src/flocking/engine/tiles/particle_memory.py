"""The part of the particle arrays from which another session goes on with the same bits."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from flocking.engine.tiles.checkpoint_form import check_particles
from flocking.engine.tiles.particles.particle_arrays import ParticleArrays

FIELDS = {
    "X": "X", "ids": "ids", "each": "radii.each", "A": "parameters.A", "C": "displacement.velocity",
    "reference": "displacement.reference", "elapsed": "displacement.elapsed", "bound": "displacement.bound",
    "skin": "displacement.skin", "rebuilds": "rebuilds", "lists": "lists", "top_speed": "top_speed",
    "_rounding": "displacement.rounding", "_first_links": "_first_links", "lost": "lost",
}  # fmt: skip
"""What is remembered, by its name in a checkpoint: where the particle arrays have it."""


def _owner(particles: ParticleArrays, place: str) -> tuple[object, str]:
    """The object that has what is remembered, and its name there."""
    *parts, name = place.split(".")
    owner: object = particles
    for part in parts:
        owner = getattr(owner, part)
    return owner, name


@dataclass
class ParticleMemory:
    """Copies of everything that fixes how the agents go on.

    Parameters
    ----------
    fields
        The copies by name.
    """

    fields: Mapping[str, object]

    @classmethod
    def of(cls, particles: ParticleArrays, *, copied: bool) -> ParticleMemory:
        """What fixes how ``particles`` goes on; not ``copied``, it changes as the agents go on."""
        fields: dict[str, object] = {name: getattr(*_owner(particles, place)) for name, place in FIELDS.items()}
        fields["rooms"] = [b.capacity for b in particles.builders]
        return cls(copy.deepcopy(fields) if copied else fields)

    def put_back(self, particles: ParticleArrays) -> None:
        """Make ``particles`` go on from here.

        Raises
        ------
        MalformedError
            When this is no memory of such agents.
        """
        checked = check_particles(self.fields, particles)
        for name, place in FIELDS.items():
            setattr(*_owner(particles, place), copy.deepcopy(self.fields[name]))
        if particles.obstacles is not None:
            particles.obstacles.used = np.inf
        for builder, capacity in zip(particles.builders, checked["rooms"], strict=True):
            builder.capacity, builder.spare = capacity.copy(), None
