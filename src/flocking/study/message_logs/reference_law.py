"""The declared law on what one agent takes itself and others to be, by plain code."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from flocking.arrays import Array
from flocking.engine.reference.control import Agent, control_of
from flocking.model.law import Law, Scenario
from flocking.model.world.times import NANOSECOND, PER_SECOND


class ReferenceLaw:
    """Forces of the law of a scenario, agent by agent.

    Parameters
    ----------
    scenario
        The law, the agents and the space.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.scenario, self.base, n = scenario, scenario.start.t, scenario.start.n
        self._m, self._order = scenario.start.q.shape[1], scenario.agents.order
        self._masses = np.broadcast_to(np.asarray(scenario.agents.masses, dtype=np.float64), n)
        self._damping = np.broadcast_to(np.asarray(scenario.agents.damping, dtype=np.float64), n)
        self.switches = sorted({s for term in scenario.law.body_terms for s in term.switch_times(self.base, np.inf)})
        """Times at which gains change."""

    def time(self, instant: int) -> float:
        """The scenario's time of an instant; gains that change at it have changed."""
        for at in self.switches:
            if round((at - self.base) * PER_SECOND) == instant:
                return at
        return self.base + instant * NANOSECOND

    def force(
        self, agent: int, own: tuple[Array, Array], others: Mapping[int, list[tuple[int, Array, Array]]], t: float,
        law: Law | None = None,
    ) -> Array:  # fmt: skip
        """The law's force on an agent from what it takes itself and others to be, shape (m,).

        Parameters
        ----------
        own
            Its position and velocity.
        others
            Neighbours by the number of the graph: who, position and velocity.
        t
            The scenario's time.
        law
            The law with leaders as the agent knows them; that of the scenario when absent.
        """
        law = self.scenario.law if law is None else law
        none = np.zeros(self._m)

        def seen(q: Array, p: Array, index: int) -> Agent:
            return Agent(q, none if self._order == 1 else p, index)

        lists = {
            graph: [seen(q, p, j) for j, q, p in others.get(number, [])] for number, graph in enumerate(law.graphs)
        }
        return control_of(
            law, seen(*own, agent), lists, t, mass=float(self._masses[agent]), damping=float(self._damping[agent]),
            space=self.scenario.space, headings=self.scenario.agents.headings,
        )  # fmt: skip
