"""What typesetting needs of a law and of a scenario; the files of both may then ask for their pages."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from flocking.model.bodies.body import Body
from flocking.model.energy import Energy
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.space import Space
from flocking.model.state import State
from flocking.model.terms.pair_terms import PairTerm, Term
from flocking.model.world.control import Control
from flocking.model.world.information import Information


class StatedLaw(Protocol):
    """A law, see `flocking.model.law.Law`."""

    @property
    def graph(self) -> Graph:
        """Its graph."""

    @property
    def terms(self) -> Sequence[Term]:
        """Its terms."""

    @property
    def graphs(self) -> tuple[Graph, ...]:
        """Its graph and those of its terms."""

    @property
    def distributed(self) -> bool:
        """Whether agents can compute it from local information."""

    @property
    def beyond_neighbours(self) -> tuple[str, ...]:
        """What an agent must know that its neighbours cannot send."""

    def graph_number(self, term: PairTerm) -> int:
        """Position of the graph of a ``term``."""


class StatedScenario(Protocol):
    """A scenario, see `flocking.model.law.Scenario`."""

    @property
    def law(self) -> StatedLaw:
        """Its law."""

    @property
    def start(self) -> State:
        """Its start."""

    @property
    def t_end(self) -> float:
        """Its end."""

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

    @property
    def energy(self) -> Energy:
        """Its energy."""

    @property
    def tolerance(self) -> float:
        """Its error tolerance."""

    @property
    def name(self) -> str:
        """Its name."""

    @property
    def seed(self) -> int | None:
        """Its seed."""

    @property
    def imperfections(self) -> str:
        """What is not ideal about its world."""
