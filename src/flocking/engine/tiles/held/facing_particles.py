"""Particle arrays whose agents look along the headings of their bodies, which are no columns of the kernels."""

from __future__ import annotations

from collections.abc import Sequence

from flocking.engine.tiles.held.held_actuation import HeldActuation
from flocking.engine.tiles.neighbours.neighbour_lists import TileLists
from flocking.engine.tiles.particles.particle_arrays import ParticleArrays


class FacingParticles(ParticleArrays):
    """Particle arrays of points, with views along the headings of their bodies.

    Attributes
    ----------
    actuation
        What stands between the forces that agents compute and those that act; it has the headings. None for points.
    """

    actuation: HeldActuation | None = None

    def turn_views(self) -> None:
        """Take the headings at the time that is looked at."""
        super().turn_views()
        if self.actuation is None:
            return
        heading = self.actuation.heading if self.actuation.seen is None else self.actuation.seen[1]
        if heading is not None:
            self.radii.face(heading)

    def graph_arguments(self, lists: Sequence[TileLists | None]) -> list[object]:
        """As for all agents, with the views of now.

        Parameters
        ----------
        lists
            A list of each graph, which has been built.
        """
        self.turn_views()
        return super().graph_arguments(lists)

    def rebuild(self, step: float, skin: float | None = None) -> None:
        """As for all agents; views are sorted with them, before their headings are.

        Parameters
        ----------
        step, skin
            As for `ParticleArrays.rebuild`.
        """
        self.turn_views()
        super().rebuild(step, skin)
