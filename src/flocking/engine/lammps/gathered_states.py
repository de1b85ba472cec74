"""Forces, energies and powers of a law on gathered states, by the kernels of the exact engine."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flocking.arrays import Array, Forces, Indices
from flocking.engine.kernels.codegen import compiled_kernels
from flocking.engine.kernels.law_kernels import LawKernels, Slots, free_pairs
from flocking.engine.kernels.layout import Layout
from flocking.engine.kernels.motion_source import RATES
from flocking.engine.kernels.obstacle_distances import ObstacleDistances
from flocking.engine.lammps.neighbours import near_pairs, radius_of
from flocking.model.law import Scenario
from flocking.model.state import State


class LawOnStates:
    """The law of a scenario with the gains at its start.

    Parameters
    ----------
    scenario
        The law, its agents and its energy.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._layout = Layout(scenario.law, scenario.energy, scenario.agents, scenario.space)
        self._slots = self._layout.values(scenario.agents, scenario.start.n, scenario.start.t)
        self._obstacle_distances = ObstacleDistances(scenario.law)

    def pairs(self, state: State) -> list[tuple[Indices, Indices]]:
        """Ordered pairs of agents linked under each graph of the law."""
        scenario = self._scenario
        return [near_pairs(state.q, radius_of(g), scenario.space) for g in scenario.law.graphs]

    def evaluated(
        self, state: State, pairs: Sequence[tuple[Indices, Indices]]
    ) -> tuple[Forces, Array, tuple[float, float, float]]:
        """Forces, shape (N, m), the powers of `RATES`, and the energies of links, of body terms and of motion.

        Parameters
        ----------
        pairs
            The pairs linked under each graph.
        """
        kernels = LawKernels(compiled_kernels(self._layout, state.dimension), self._scenario.agents.order)
        n, acting = state.n, free_pairs([*pairs, *self._obstacle_distances.met(state.q, state.t)])
        functionals = np.zeros((len(self._scenario.law.graphs), n))
        motion = (state.t, np.ascontiguousarray(state.q), np.ascontiguousarray(state.p))
        given = (*motion, acting, Slots(*self._slots), functionals)
        u, powers = np.empty((n, state.dimension)), np.empty(len(RATES))
        kernels.control(*given, u, powers)
        return u, powers, kernels.energies(*given)


def velocities(scenario: Scenario, state: State) -> Array:
    """Velocities of agents in a state, shape (N, m): the control for agents of order 1.

    Parameters
    ----------
    scenario
        The law and its agents.
    state
        The state.
    """
    if scenario.agents.order == 2:
        return state.p
    law = LawOnStates(scenario)
    still = State(state.q, np.zeros_like(state.q), state.t)
    return law.evaluated(still, law.pairs(still))[0]
