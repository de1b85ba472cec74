"""What the parts of the world of a scenario make of it together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from flocking.arrays import Links
from flocking.model.bodies.body import Body
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.graphs.seen_headings import links_of_graphs
from flocking.model.space import Space
from flocking.model.space_checks import sees_places
from flocking.model.state import State
from flocking.model.terms.body_terms import BodyTerm
from flocking.model.terms.pair_terms import PairTerm
from flocking.model.terms.poles_under_errors import unbounded_under
from flocking.model.world.control import Control
from flocking.model.world.information import Information


class LawInWorld(Protocol):
    """What is read of a law."""

    @property
    def symmetries(self) -> frozenset[str]:
        """Those that all its parts keep."""

    @property
    def graph(self) -> Graph:
        """Its graph."""

    @property
    def graphs(self) -> Sequence[Graph]:
        """Its graph and those of its terms."""

    @property
    def pair_terms(self) -> tuple[PairTerm, ...]:
        """Its terms about two agents."""

    @property
    def body_terms(self) -> tuple[BodyTerm, ...]:
        """Its terms about one agent."""


class InWorld(Protocol):
    """What is read of a scenario."""

    @property
    def law(self) -> LawInWorld:
        """Its law."""

    @property
    def start(self) -> State:
        """Its start."""

    @property
    def agents(self) -> Body:
        """What agents are."""

    @property
    def space(self) -> Space:
        """Their space."""

    @property
    def information(self) -> Information:
        """What they know."""

    @property
    def control(self) -> Control:
        """When they act."""


class ScenarioWorld:
    """Base of a scenario: what is not ideal about its world, and what remains of the symmetries of its law there."""

    @property
    def symmetries(self: InWorld) -> frozenset[str]:
        """Symmetries of the law that agents, space, information and control are known to keep; others may hold.

        What is drawn at random counts with the numbers drawn: another agent or axis has others.
        """
        parts = (self.agents, self.space, self.control)
        known = self.information.symmetries_under(self.control)
        return self.law.symmetries.intersection(known, *(part.symmetries for part in parts))

    @property
    def rest_frame(self: InWorld) -> str:
        """What agents know, and when they act, that makes the rest frame of the world physical; empty where it is not.

        Where it is, a group that moves, with its leaders, does not move as one at rest does. Bodies are not looked at.
        """
        known, terms = self.information, [t for t in self.law.body_terms if t.leader is not None]
        # Formulas are looked at only where something depends on it.
        pursued = not known.ideal and any(sees_places(term, self.start.dimension) for term in terms)
        found = [] if known.keeps_uniform_motion(self.control, pursued) else [known.summary]
        if "galilean" not in self.control.symmetries:
            found.append(self.control.summary)
        return "; ".join(found)

    @property
    def links_at_start(self: InWorld) -> Links:
        """Links of each graph at the start, shape (graphs, N, N): those that the start gives, else by positions."""
        return np.array(links_of_graphs(self.law.graphs, self.space, self.start, self.agents.headings))

    @property
    def unbounded_forces(self: InWorld) -> str:
        """Which potentials have poles that distances known with errors may come near to, in words; empty for none."""
        return unbounded_under(self.information.errors_of_positions, self.law.pair_terms, self.law.graph)

    @property
    def imperfections(self: InWorld) -> str:
        """What is not ideal about what agents are, what they know and when they act; empty in the ideal world."""
        found = [part.summary for part in (self.agents, self.information, self.control) if not part.ideal]
        return "; ".join(found)
