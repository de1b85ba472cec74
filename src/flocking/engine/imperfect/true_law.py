"""The declared law on the true state, for the ledger beside the forces that act."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from functools import cached_property
from typing import Self

import numpy as np

from flocking.arrays import Array, Indices, Links
from flocking.engine.imperfect.powers import LawInForce
from flocking.engine.kernels.codegen import compiled_kernels
from flocking.engine.kernels.law_kernels import LawKernels, Pairs, Slots, free_pairs
from flocking.engine.kernels.layout import Layout
from flocking.engine.kernels.pieces import FREE, limits
from flocking.errors import NotFinite
from flocking.model.graphs.connectivity import linked_pairs
from flocking.model.law import Law, Scenario
from flocking.model.terms.poles_under_errors import FLOOR
from flocking.model.terms.potential_reach import energy_jump, inner_edge


def check_forces(force: Array, time: float, agents: Indices, scenario: Scenario) -> None:
    """Refuse to go on under a ``force`` of ``agents``, shape (agents, m), that is infinite or NaN.

    Parameters
    ----------
    time
        The scenario's time.
    scenario
        The scenario, which may state why.

    Raises
    ------
    NotFinite
        When one is.
    """
    if (bad := np.flatnonzero(~np.isfinite(force).all(axis=1))).size:
        cause = f": {why}. {FLOOR}" if (why := scenario.unbounded_forces) else "."
        raise NotFinite(f"A force is infinite or NaN{cause}", time=time, agents=(int(agents[bad[0]]),))


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
        self._judge_radii()
        self.rates = np.empty(3)
        self._masses = np.broadcast_to(np.asarray(scenario.agents.masses, dtype=np.float64), self.n)

    def renumbered(self, scenario: Scenario) -> Self | None:
        """The same kernels for a scenario whose law has other numbers; None if more changed.

        Parameters
        ----------
        scenario
            The scenario, of the same agents.
        """
        layout = Layout(scenario.law, scenario.energy, scenario.agents, scenario.space)
        if not layout.same_kernels(self.layout):
            return None
        found = copy(self)
        found.scenario, found.law, found.layout = scenario, scenario.law, layout
        found._judge_radii()
        return found

    def _judge_radii(self) -> None:
        """Find where links break at an infinite energy, and where pieces of formulas meet at a radius.

        A pair is linked below its radius and has the energy of there, wherever rounding places it as its link switches.
        """
        graphs = self.law.graphs
        self.barriers = [self.law.has_barrier(graph) for graph in graphs]
        spans, self.rows = [FREE], np.zeros((len(graphs), self.n), dtype=np.int32)
        for number, graph in enumerate(graphs):
            borders = [x for t in self.law.pair_terms if self.law.graph_number(t) == number for x in t.kinks()]
            radii = np.broadcast_to(np.asarray(graph.break_radius, dtype=np.float64), self.n)
            for radius in np.unique(radii[np.isfinite(radii)]).tolist() if borders else ():
                edge = inner_edge(borders, radius)
                shape = self.kernels.shape(f"shape{number}")
                if edge == radius or shape is None:
                    continue
                inside = sorted({x for x in borders if x < edge})
                numbers = self.layout.values(self.scenario.agents, self.n, self.scenario.start.t)
                last = limits([*inside, radius], shape, numbers)[-1]
                self.rows[number, radii == radius] = len(spans)
                spans.append((-np.inf, last[1], -np.inf, last[3]))
        self.spans = np.array(spans)

    def ledger_end(self, time: float) -> float:
        """When a ledger of a law that is in force from a ``time`` on ends: at once where a potential jumps, or never.

        Pairs that come across a jump are not located here, so that what they lose or gain by it is not counted.
        """
        graphs, number = self.law.graphs, self.law.graph_number
        jump = energy_jump((term, graphs[number(term)]) for term in self.law.pair_terms)
        return np.inf if jump is None else time

    def take_parameters(self, t: float) -> None:
        """Take the gains that are in force from the scenario's time ``t`` on."""
        self.slots = Slots(*self.layout.values(self.scenario.agents, self.n, t))

    @cached_property
    def _addresses(self) -> tuple[int, int, int]:
        """Addresses of the compiled forces on the true state, of the flow of agents of order 1, and of the frame."""
        module, moving = self.kernels.module, self.order == 2 and self.scenario.energy.frame != "lab"
        flow = int(module.flow.address) if self.order == 1 else 0
        return int(module.control.address), flow, int(module.frame.address) if moving else 0

    def pairs(self, links: Links, met: Sequence[tuple[Indices, Indices]] = ()) -> Pairs:
        """Ordered pairs of linked agents, graph by graph, then agents and the obstacles that they have met.

        Parameters
        ----------
        links
            Links of each graph, shape (graphs, N, N).
        met
            Agents within range of obstacles, and the obstacles, of every group of obstacles.
        """
        found = free_pairs([*map(linked_pairs, links), *met])
        of_graphs = found.offsets[: len(links) + 1]
        graph = np.repeat(np.arange(len(links)), np.diff(of_graphs))
        found.pieces[: of_graphs[-1]] = self.rows[graph, found.senders[: of_graphs[-1]]]
        return found._replace(spans=self.spans)

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

    def frame(self, t: float, p: Array) -> Array:
        """Velocity of the frame of the energy, shape (m,).

        Parameters
        ----------
        t, p
            The scenario's time, and the true velocities, shape (N, m).
        """
        energy = self.scenario.energy
        if energy.leader is not None:
            return np.asarray(energy.leader.at(t)[1])
        if energy.frame == "lab":
            return np.zeros(self.m)
        return np.asarray(self._masses @ p / self._masses.sum())

    def powers_of(self, t: float, q: Array, p: Array, differences: Array, pairs: Pairs) -> Array:
        """Powers of differences of forces in the ledger, shape (differences,); exactly zero of one that is zero.

        Of agents of order 2 the sum of d_i . (p_i - frame), of order 1, whose forces are velocities, that of
        d_i . dH/dq_i.

        Parameters
        ----------
        t, q, p
            The scenario's time, and the true positions and velocities, shape (N, m).
        differences
            The differences d, shape (differences, N, m).
        pairs
            Pairs linked in truth.
        """
        if self.order == 2:
            found: Array = (differences * (p - self.frame(t, p))).sum(axis=(1, 2))
            return found
        u, none, rates = np.zeros((self.n, self.m)), np.zeros((self.n, self.m)), self.rates
        self.kernels.control(t, q, none, pairs, self.slots, self.functionals, u, rates)

        def flow(velocity: Array) -> float:
            self.kernels.module.flow(t, q, none, *pairs, *self.slots, self.functionals, velocity, rates)
            return float(rates[2])

        # Beside -u . d, the rate of a gradient flow, storage changes at a rate that is linear in the velocity.
        at_rest = flow(none)
        rows = np.ascontiguousarray(differences)
        return np.array([flow(d) - at_rest - float((u * d).sum()) if d.any() else 0.0 for d in rows])

    def in_force(self, pairs: Pairs) -> LawInForce:
        """The law as native functions take it.

        Parameters
        ----------
        pairs
            Pairs linked in truth.
        """
        return LawInForce(*self._addresses, self.order, pairs, self.slots, self.functionals)
