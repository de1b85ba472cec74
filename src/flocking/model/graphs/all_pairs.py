"""The complete graph: every agent senses every other at any distance, with no list of pairs to store."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from flocking.model.checks import Array
from flocking.model.graphs.connectivity import Links
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.parts.registration import register_part


@register_part("complete")
@dataclass(frozen=True)
class Complete(Graph):
    """All agents are neighbours at all distances, however many there are.

    `Fixed.complete` has the same links as a list of pairs for a given number of agents. This graph stores none, so that
    large groups need no memory for their links.
    """

    moves: bool = field(default=False, init=False, repr=False)

    @property
    def appear_radius(self) -> float:
        """No link ever appears."""
        return 0.0

    @property
    def break_radius(self) -> float:
        """No link ever breaks."""
        return np.inf

    def initial(self, q: Array) -> Links:
        """All pairs, for all positions ``q``."""
        return np.asarray(~np.eye(len(q), dtype=bool))

    def among(self, distance: Array) -> Links:
        """All pairs, for all values of ``distance``."""
        return self.initial(distance)
