"""What typesetting needs of a law and of a scenario; the files of both may then ask for their pages."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from flocking.model.energy import Energy
from flocking.model.scenario_world import InWorld, LawInWorld
from flocking.model.terms.pair_terms import PairTerm, Term


class StatedLaw(LawInWorld, Protocol):
    """A law, see `flocking.model.law.Law`."""

    @property
    def terms(self) -> Sequence[Term]:
        """Its terms."""

    @property
    def distributed(self) -> bool:
        """Whether agents can compute it from local information."""

    @property
    def beyond_neighbours(self) -> tuple[str, ...]:
        """What an agent must know that its neighbours cannot send."""

    def graph_number(self, term: PairTerm) -> int:
        """Position of the graph of a ``term``."""


class StatedScenario(InWorld, Protocol):
    """A scenario, see `flocking.model.law.Scenario`."""

    @property
    def law(self) -> StatedLaw:
        """Its law."""

    @property
    def t_end(self) -> float:
        """Its end."""

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
