"""How bodies change while forces are held: the rates that they declare, compiled, and the limits that act."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flocking.arrays import Array
from flocking.engine.adaptive_steps.limit_crossings import HeldNumbers
from flocking.engine.adaptive_steps.state_vectors import component_tolerances, further_columns, joined, place_of
from flocking.engine.kernels.codegen import compiled_kernels
from flocking.engine.kernels.law_kernels import CompiledLaw, LawKernels, Slots, free_pairs, stages
from flocking.engine.kernels.layout import Layout
from flocking.engine.kernels.motion_source import RATES
from flocking.model.graphs.distance_graphs import Fixed
from flocking.model.law import Law, Scenario
from flocking.model.state import State
from flocking.model.terms.body_terms import BodyTerm
from flocking.model.terms.pair_terms import Value
from flocking.model.terms.symbols import BodySymbols

if TYPE_CHECKING:
    import sympy

_START = np.zeros(1), np.zeros((1, 1))
"""Nodes and weights of a method whose only stage is at its start."""


@dataclass(frozen=True, eq=False)
class HeldForces(BodyTerm):
    """A force of each agent that does not depend on anything: what agents hold between two ticks.

    Parameters
    ----------
    forces
        The forces, shape (N, m).
    """

    forces: Array

    @property
    def parameters(self) -> dict[str, Value]:
        """The force along each axis, shape (N,) each."""
        return {f"force_{k}": axis for k, axis in enumerate(self.forces.T)}

    @property
    def structure(self) -> tuple[object, ...]:
        """The number of axes."""
        return ("HeldForces", self.forces.shape[1])

    def force(self, x: BodySymbols) -> Sequence[sympy.Expr]:
        """The parameters."""
        return [x.parameter(name) for name in self.parameters]


class HeldBodies:
    """The right-hand side of the state vector [q, p, further columns, departed, work, dissipated, supplied].

    The equations are those of `flocking.engine.exact` under a law whose forces are the held ones: bodies do not act on
    each other. Work and departure are those of the held forces; they are not integrated to a tolerance.

    Parameters
    ----------
    scenario
        What the agents are, the start and the energy.

    Attributes
    ----------
    size
        Numbers of the columns of all agents.
    limits
        Which limits act, and what is set by the clock.
    """

    def __init__(self, scenario: Scenario) -> None:
        bodies, start = scenario.agents, scenario.start
        self.n, self.m = start.q.shape
        self.order, self._base = bodies.order, start.t
        self.widths = bodies.widths(self.m)
        self.size = self.n * (self.order * self.m + sum(self.widths.values()))
        held = HeldForces(np.zeros((self.n, self.m)))
        layout = Layout(Law(Fixed(self.n, ()), (held,)), scenario.energy, bodies)
        self._kernels = LawKernels(compiled_kernels(layout, self.m), self.order)
        self.departs = self._kernels.departs
        self.limits = HeldNumbers(bodies, self.n, self.m, scenario.tolerance, self._base)
        slots = Slots(*layout.values(bodies, self.n, self._base))
        self._slots = slots._replace(A=self.limits.below(slots.A))
        self._force_rows = [int(layout.slot("term0", name)[1:]) for name in held.parameters]
        none = np.zeros(0, dtype=np.int64)
        self._pairs = free_pairs([(none, none)])
        self._functionals = np.ones((1, self.n))
        self.tolerances = self._tolerances(start, scenario)

    @property
    def _law(self) -> CompiledLaw:
        return self._kernels.in_force(self.n, self.m, self._pairs, self._slots, self._functionals)

    def _tolerances(self, start: State, scenario: Scenario) -> Array:
        """Absolute error tolerance of each component: infinite for those of the ledger, which is computed otherwise."""
        found = component_tolerances(start, self.order, self.widths, scenario)
        return np.concatenate([found, np.full(int(self.departs) + len(RATES), np.inf)])

    def hold(self, force: Array) -> None:
        """Let a ``force`` of each agent act from now on, shape (N, m); of agents of order 1 the desired velocity."""
        self._slots.A[self._force_rows] = force.T

    def put_limits(self) -> None:
        """Write the numbers held between events where the kernels read them."""
        self.limits.put(self._slots.A)

    def vector(self, state: State) -> Array:
        """State vector of a state."""
        return self.widened(joined(state, self.order, self.widths))

    def widened(self, columns: Array) -> Array:
        """State vector of the ``columns`` of all agents, shape (size,), with zeros for what is integrated beside."""
        return np.concatenate([columns, np.zeros(int(self.departs) + len(RATES))])

    def further(self, y: Array) -> dict[str, Array]:
        """Further columns of a state vector ``y`` by name, shape (N, width) each."""
        found = further_columns(y, self.order * self.n * self.m, self.n, self.widths)
        return {name: values.copy() for name, values in found.items()}

    def place_of(self, column: str) -> int:
        """Place of the first number of a ``column`` in state vectors, see `state_vectors.place_of`."""
        return place_of(column, self.order, self.n, self.m, self.widths)

    def slope(self, t: float, y: Array) -> Array:
        """dy/dt of a state vector ``y``, ``t`` seconds from the start."""
        dy = np.zeros_like(y)
        nodes, weights = _START
        stages(self._law, nodes, weights, 0, 1, -1, t + self._base, y, 0.0, dy[None], np.empty_like(y))
        return dy

    def stages(
        self, first: int, last: int, state_stage: int, t: float, y: Array, h: float, K: Array, nodes: Array,
        weights: Array,
    ) -> Array:  # fmt: skip
        """Slopes at stages of a Runge-Kutta step, and the state at the stage ``state_stage``.

        Parameters
        ----------
        first, last
            Slopes are computed at the stages ``first`` to ``last - 1``; those before are known.
        t, y, h
            Where the step begins, and its length.
        K
            Takes the slopes, one stage in each row.
        nodes, weights
            The method, see `flocking.engine.kernels.law_kernels.stages`.
        """
        found = np.empty(len(y))
        stages(self._law, nodes, weights, first, last, state_stage, t + self._base, y, h, K, found)
        return found

    def signs(self, t: float, y: Array) -> Array:
        """Where limits begin and end to act at a state vector ``y``, see `HeldNumbers`, shape (limits, 2, N)."""
        return self._kernels.limit_signs(t + self._base, y, self._law, len(self.limits.limits))

    def departed(self, t: float, y: Array) -> float:
        """Power that bodies of order 2 add to that of the held forces and of their damping, at a state vector ``y``."""
        return float(self.slope(t, y)[self.size]) if self.departs else 0.0
