"""The declared law, twice: on what agents know, which gives the force, and on the true state, for the ledger."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from flocking.arrays import Array, Links
from flocking.engine.kernels.codegen import compiled_kernels, known_kernels
from flocking.engine.kernels.law_kernels import LawKernels, Pairs, Slots
from flocking.engine.kernels.layout import Layout
from flocking.engine.kernels.pieces import free_pieces
from flocking.engine.sampled.knowledge import Knowledge, Known
from flocking.engine.sampled.powers import LawInForce, Powers, node_powers
from flocking.model.law import Law, Scenario


class SampledLaw:
    """A law on what agents know and on the true state.

    Parameters
    ----------
    scenario
        The law, the energy and the agents.
    degree
        Degree in time of what agents know of their neighbours.
    """

    def __init__(self, scenario: Scenario, degree: int) -> None:
        self.scenario = scenario
        self.law: Law = scenario.law
        self.n, self.m = scenario.start.q.shape
        self.order = scenario.agents.order
        self.layout = Layout(self.law, scenario.energy, scenario.agents, scenario.space)
        self._kernels = LawKernels(compiled_kernels(self.layout, self.m), self.order)
        self._known = known_kernels(self.layout, self.m, degree)
        self.slots = Slots(*self.layout.values(scenario.agents, self.n, scenario.start.t))
        self._functionals = np.ones((len(self.law.graphs), self.n))
        self.barriers = [self.law.has_barrier(graph) for graph in self.law.graphs]
        self._rates = np.empty(3)

    @cached_property
    def _addresses(self) -> tuple[int, int]:
        """Addresses of the compiled forces on the true state, and of the flow of agents of order 1."""
        module = self._kernels.module
        return int(module.control.address), int(module.flow.address) if self.order == 1 else 0

    def forces(self, t: float, known: Known, knowledge: Knowledge) -> Array:
        """Forces of the agents that act now, from what each knows, shape (agents, m).

        Parameters
        ----------
        t
            The scenario's time.
        known, knowledge
            What they know, and their links.
        """
        q, p = np.zeros((self.n, self.m)), np.zeros((self.n, self.m))
        q[known.agents] = known.own[:, : self.m]
        if self.order == 2:
            p[known.agents] = known.own[:, self.m :]
        senders, sensed, offsets = knowledge.pairs(known)
        times, rows = known.polynomials(np.searchsorted(known.agents, senders), sensed, self.m)
        if self.order == 1:
            rows[:, :, self.m :] = 0.0
        u = np.zeros((self.n, self.m))
        start = self.scenario.start.t
        self._known.control(
            t, q, p, senders, sensed, offsets, *free_pieces(len(senders)), *self.slots, self._functionals,
            times + start, rows, u, self._rates,
        )  # fmt: skip
        return u[known.agents]

    def pairs(self, links: Links) -> Pairs:
        """Ordered pairs of linked agents, graph by graph.

        Parameters
        ----------
        links
            Links of each graph, shape (graphs, N, N).
        """
        found = [np.nonzero(matrix) for matrix in links]
        offsets = np.cumsum([0, *(len(i) for i, _ in found)])
        i, j = (np.concatenate(x).astype(np.int64) for x in zip(*found, strict=True))
        return Pairs(i, j, offsets, *free_pieces(len(i)))

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
        stored, bodies, kinetic = self._kernels.energies(t, q, p, pairs, self.slots, self._functionals)
        apart = 0.5 * (self.n * (self.n - 1) - linked) * self.scenario.energy.unlinked
        return stored + bodies + kinetic + apart, kinetic

    def powers(self, t: float, S: Array, force: Array, pairs: Pairs) -> Powers:
        """Powers of the ledger as functions of the time since ``t``.

        Parameters
        ----------
        t
            The scenario's time about which the polynomials are.
        S
            Taylor coefficients of the positions, shape (degree + 1, N, m).
        force
            The force that acts, shape (N, m); of agents of order 1 their velocity.
        pairs
            Pairs linked in truth.
        """
        law = LawInForce(*self._addresses, self.order, pairs, self.slots, self._functionals)

        def at(times: Array) -> Array:
            found = np.empty((len(times), 4))
            node_powers(law, t, S, force, times, self._frames(t, times, S), found)
            return found

        return at

    def _frames(self, t: float, times: Array, S: Array) -> Array:
        """Velocity of the frame of the energy, shape (times, m)."""
        energy = self.scenario.energy
        if energy.leader is not None:
            return np.array([energy.leader.at(t + s)[1] for s in times])
        if energy.frame == "lab":
            return np.zeros((len(times), self.m))
        masses = np.broadcast_to(np.asarray(self.scenario.agents.masses, dtype=np.float64), self.n)
        mean = np.einsum("i,aik->ak", masses / masses.sum(), S)
        powers = np.arange(1, len(S))
        return np.asarray((times[:, None] ** (powers - 1) * powers) @ mean[1:])
