"""The declared law on delayed knowledge: forces of all agents, and the powers of the ledger beside them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Self

import numpy as np

from flocking.arrays import Array, Indices, Links
from flocking.engine.adaptive_steps.limit_crossings import HeldNumbers
from flocking.engine.adaptive_steps.state_vectors import component_tolerances, further_columns, joined
from flocking.engine.fixed_step.supported_bodies import is_point
from flocking.engine.imperfect.messages.leader_slots import leader_slots
from flocking.engine.imperfect.true_law import TrueLaw
from flocking.engine.kernels.codegen import body_kernels, known_kernels
from flocking.engine.kernels.law_kernels import Pairs
from flocking.model.law import Scenario
from flocking.model.state import State


class DelayedLaw(TrueLaw):
    """A law on delayed knowledge and on the true state.

    Parameters
    ----------
    scenario
        The law, the energy and the agents.
    """

    def __init__(self, scenario: Scenario) -> None:
        body, (n, m) = scenario.agents, scenario.start.q.shape
        self.held = HeldNumbers(body, n, m, scenario.tolerance, scenario.start.t)
        self.held.draw(0.0)
        self._leaders = leader_slots(scenario)
        super().__init__(scenario)
        self._known = known_kernels(self.layout if self._leaders is None else self._leaders.layout, self.m, 0)
        self._damping = np.broadcast_to(np.asarray(body.damping, dtype=np.float64), self.n)
        self._neighbours = self.pairs(np.zeros((len(self.law.graphs), self.n, self.n), dtype=bool))
        self._times = np.zeros(0)
        self.widths = body.widths(m)
        self._bodies = None if is_point(body) else body_kernels(self.layout, m)

    def take_parameters(self, t: float) -> None:
        """Take the gains that are in force from the scenario's time ``t`` on, beside what is held between events."""
        super().take_parameters(t)
        self.slots = self.slots._replace(A=self.held.below(self.slots.A))
        if self._leaders is not None:
            self._leaders.take_parameters(t)

    def renumbered(self, scenario: Scenario) -> Self | None:
        """As `TrueLaw.renumbered`, with parameters of its own where leaders are known by messages."""
        found = super().renumbered(scenario)
        if found is None or self._leaders is None:
            return found
        found._leaders = leader_slots(scenario)
        assert found._leaders is not None
        return found if found._leaders.layout.same_kernels(self._leaders.layout) else None

    def put_held(self) -> None:
        """Write the numbers held between events where the kernels read them."""
        self.held.put(self.slots.A)

    def joined(self, state: State) -> Array:
        """State vector of a state: positions, velocities of agents of order 2, further columns.

        Parameters
        ----------
        state
            The state.
        """
        return joined(state, self.order, self.widths)

    def further(self, y: Array) -> dict[str, Array]:
        """Further columns of a state vector ``y`` by name, shape (N, width) each."""
        return further_columns(y, self.order * self.n * self.m, self.n, self.widths)

    def tolerances(self, state: State) -> Array:
        """Absolute error tolerance of each component of the state vector, from the size of the group at ``state``."""
        return component_tolerances(state, self.order, self.widths, self.scenario)

    def relink(self, known_links: Links, met: Sequence[tuple[Indices, Indices]] = ()) -> None:
        """Take ``known_links``, by what agents know, shape (graphs, N, N), for the forces from now on.

        Parameters
        ----------
        met
            Agents within range of obstacles, and the obstacles, of every group of obstacles.
        """
        self._neighbours = self.pairs(known_links, met)
        self._times = np.zeros(len(self.linked[0]))

    @property
    def linked(self) -> tuple[Indices, Indices]:
        """The agent of each pair that knows, and the one that is known, by the links that agents know."""
        end = self._neighbours.offsets[len(self.law.graphs)]
        return self._neighbours.senders[:end], self._neighbours.sensed[:end]

    @property
    def offsets(self) -> Indices:
        """Where the pairs of each graph begin in `linked`, and where the last ones end."""
        return self._neighbours.offsets[: len(self.law.graphs) + 1]

    def forces(self, t: float, own: Array, known: Array, leaders: Sequence[Array] = ()) -> Array:
        """Forces of all agents, shape (N, m); of agents of order 1 their velocities.

        Parameters
        ----------
        t
            The scenario's time.
        own, known
            What each agent knows of itself, shape (N, 2 m), and of its neighbours, in the order of `linked`, shape
            (pairs, 2 m).
        leaders
            Motion of each leader as every agent knows it, shape (3, m, N), where they know it by messages.
        """
        slots = self.slots
        if self._leaders is not None:
            self._leaders.put(leaders)
            slots = self._leaders.slots
        q, p, m = np.ascontiguousarray(own[:, : self.m]), np.ascontiguousarray(own[:, self.m :]), self.m
        rows = np.ascontiguousarray(known[:, None])
        u = np.zeros((self.n, m))
        self._known.control(t, q, p, *self._neighbours, *slots, self.functionals, self._times, rows, u, self.rates)
        return u

    def slope(self, t: float, y: Array, force: Array) -> Array:
        """Slope of a state vector under a force.

        Parameters
        ----------
        t, y
            The scenario's time, and the true state vector.
        force
            What `forces` gives.
        """
        if self._bodies is not None:
            found = np.empty(len(y))
            self._bodies.move(t, y, *self.slots, force, found)
            return found
        if self.order == 1:
            return force.ravel()
        p = y[self.n * self.m :].reshape(self.n, self.m)
        rate = (force - self._damping[:, None] * p) / self._masses[:, None]
        return np.concatenate([p.ravel(), rate.ravel()])

    def acting(self, t: float, y: Array, force: Array) -> Array:
        """The force on point masses that would move as the bodies do, shape (N, m); of order 1 their velocities.

        Parameters
        ----------
        t, y, force
            As for `slope`.
        """
        if self._bodies is None:
            return force
        count, shape = self.n * self.m, (self.n, self.m)
        slope = self.slope(t, y, force)
        if self.order == 1:
            return slope[:count].reshape(shape)
        p, rate = y[count : 2 * count].reshape(shape), slope[count : 2 * count].reshape(shape)
        return np.asarray(self._masses[:, None] * rate + self._damping[:, None] * p)

    def limit_signs(self, t: float, y: Array, force: Array) -> Array:
        """Expressions that are positive where limits of the bodies begin and end to act, shape (limits, 2, N).

        Parameters
        ----------
        t, y, force
            As for `slope`.
        """
        assert self._bodies is not None
        found = np.empty(2 * len(self.held.limits) * self.n)
        self._bodies.limit_signs(t, y, *self.slots, force, found)
        return found.reshape(-1, 2, self.n)

    def power(self, t: float, q: Array, p: Array, force: Array, pairs: Pairs) -> Array:
        """Work, dissipation, supply and departure, shape (4,), see `flocking.engine.imperfect.powers.POWERS`.

        Parameters
        ----------
        t, q, p
            The scenario's time, and the true positions and velocities, shape (N, m); those of agents of order 1 are
            what acts.
        force
            The force that acts, see `acting`.
        pairs
            Pairs linked in truth.
        """
        u, rates = np.zeros((self.n, self.m)), self.rates
        seen = p if self.order == 2 else np.zeros_like(p)
        self.kernels.control(t, q, seen, pairs, self.slots, self.functionals, u, rates)
        lost, supplied = float(rates[1]), float(rates[2])
        if self.order == 2:
            return np.array([(force * p).sum(), lost, supplied, ((force - u) * (p - self.frame(t, p))).sum()])
        # Beside the law's own flow, -lost + supplied, storage changes at the rate of the velocity that acts.
        departed = lost - supplied - float((u * force).sum())
        self.kernels.module.flow(t, q, seen, *pairs, *self.slots, self.functionals, force, rates)
        return np.array([(force * force).sum(), lost, supplied, departed + float(rates[2])])
