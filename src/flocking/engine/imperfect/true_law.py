"""The declared law on the true state, for the ledger beside the forces that act."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from flocking.arrays import Array, Indices, Links
from flocking.engine.imperfect.powers import LawInForce, Powers, node_powers
from flocking.engine.kernels.codegen import compiled_kernels
from flocking.engine.kernels.law_kernels import LawKernels, Pairs, Slots, free_pairs
from flocking.engine.kernels.layout import Layout
from flocking.model.law import Law, Scenario


class TrueLaw:
    """A law on the true state.

    Parameters
    ----------
    scenario
        The law, the energy and the agents.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        self.law: Law = scenario.law
        self.n, self.m = scenario.start.q.shape
        self.order = scenario.agents.order
        self.layout = Layout(self.law, scenario.energy, scenario.agents, scenario.space)
        self.kernels = LawKernels(compiled_kernels(self.layout, self.m), self.order)
        self.take_parameters(scenario.start.t)
        self.functionals = np.ones((len(self.law.graphs), self.n))
        self.barriers = [self.law.has_barrier(graph) for graph in self.law.graphs]
        self.rates = np.empty(3)

    def take_parameters(self, t: float) -> None:
        """Take the gains that are in force from the scenario's time ``t`` on."""
        self.slots = Slots(*self.layout.values(self.scenario.agents, self.n, t))

    @cached_property
    def _addresses(self) -> tuple[int, int]:
        """Addresses of the compiled forces on the true state, and of the flow of agents of order 1."""
        module = self.kernels.module
        return int(module.control.address), int(module.flow.address) if self.order == 1 else 0

    def pairs(self, links: Links, met: Sequence[tuple[Indices, Indices]] = ()) -> Pairs:
        """Ordered pairs of linked agents, graph by graph, then agents and the obstacles that they have met.

        Parameters
        ----------
        links
            Links of each graph, shape (graphs, N, N).
        met
            Agents within range of obstacles, and the obstacles, of every group of obstacles.
        """
        return free_pairs([*((i, j) for i, j in map(np.nonzero, links)), *met])

    def energy(self, t: float, q: Array, p: Array, pairs: Pairs, linked: int) -> tuple[float, float]:
        """Energy and kinetic energy of the true state.

        Parameters
        ----------
        t, q, p
            The scenario's time, and the true positions and velocities, shape (N, m).
        pairs, linked
            Pairs linked in truth, and how many ordered pairs of them are those of the law's graph.
        """
        p = p if self.order == 2 else np.zeros_like(p)
        stored, bodies, kinetic = self.kernels.energies(t, q, p, pairs, self.slots, self.functionals)
        apart = 0.5 * (self.n * (self.n - 1) - linked) * self.scenario.energy.unlinked
        return stored + bodies + kinetic + apart, kinetic

    def powers(self, t: float, S: Array, forces: Array, pairs: Pairs) -> Powers:
        """Powers of the ledger as functions of the time since ``t``.

        Parameters
        ----------
        t
            The scenario's time about which the polynomials are.
        S
            Taylor coefficients of the positions, shape (degree + 1, N, m).
        forces
            Taylor coefficients of the forces that act, shape (terms, N, m); of agents of order 1 their velocities.
        pairs
            Pairs linked in truth.
        """
        law = LawInForce(*self._addresses, self.order, pairs, self.slots, self.functionals)

        def at(times: Array) -> Array:
            found = np.empty((len(times), 4))
            node_powers(law, t, S, forces, times, self._frames(t, times, S), found)
            return found

        return at

    def _frames(self, t: float, times: Array, S: Array) -> Array:
        """Velocity of the frame of the energy, shape (times, m)."""
        energy = self.scenario.energy
        if energy.leader is not None:
            return np.ascontiguousarray(energy.leader.along(t + times)[1])
        if energy.frame == "lab":
            return np.zeros((len(times), self.m))
        masses = np.broadcast_to(np.asarray(self.scenario.agents.masses, dtype=np.float64), self.n)
        mean = np.einsum("i,aik->ak", masses / masses.sum(), S)
        powers = np.arange(1, len(S))
        return np.asarray((times[:, None] ** (powers - 1) * powers) @ mean[1:])
