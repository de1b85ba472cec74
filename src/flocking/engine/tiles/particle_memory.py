"""The part of the particle arrays that a session needs to continue bit for bit."""

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
    "skin": "displacement.skin", "rebuilds": "search.rebuilds", "lists": "lists", "top_speed": "top_speed",
    "_rounding": "displacement.rounding", "_first_links": "search.first_links", "lost": "lost",
}  # fmt: skip
"""Attribute of the particle arrays for each name in a checkpoint."""


def _owner(particles: ParticleArrays, place: str) -> tuple[object, str]:
    """The object with an attribute, and the name of the attribute."""
    *parts, name = place.split(".")
    owner: object = particles
    for part in parts:
        owner = getattr(owner, part)
    return owner, name


@dataclass
class ParticleMemory:
    """Copies of all arrays that determine how the agents continue.

    Parameters
    ----------
    fields
        The copies by name.
    """

    fields: Mapping[str, object]

    @classmethod
    def of(cls, particles: ParticleArrays, *, copied: bool) -> ParticleMemory:
        """The memory of ``particles``; if not ``copied``, it shares their arrays and changes with them."""
        fields: dict[str, object] = {name: getattr(*_owner(particles, place)) for name, place in FIELDS.items()}
        if len(particles.body_rows.further):
            fields["columns"] = particles.body_rows.further
        fields["rooms"] = [b.capacity for b in particles.search.builders]
        return cls(copy.deepcopy(fields) if copied else fields)

    def put_back(self, particles: ParticleArrays) -> None:
        """Restore the state of ``particles``.

        Raises
        ------
        MalformedError
            If this is not a valid memory of such agents.
        """
        checked = check_particles(self.fields, particles)
        for name, place in FIELDS.items():
            setattr(*_owner(particles, place), copy.deepcopy(self.fields[name]))
        if len(particles.body_rows.further):
            particles.body_rows.further = np.array(self.fields["columns"])
        particles.radii.look(particles.ids)
        if particles.obstacles is not None:
            particles.obstacles.used = np.inf
        for builder, capacity in zip(particles.search.builders, checked["rooms"], strict=True):
            builder.capacity, builder.spare = capacity.copy(), None
