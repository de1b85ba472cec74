"""The declared law on delayed knowledge: forces of all agents, and the powers of the ledger beside them."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array, Indices, Links
from flocking.engine.imperfect.true_law import TrueLaw
from flocking.engine.kernels.codegen import known_kernels
from flocking.engine.kernels.law_kernels import Pairs
from flocking.model.law import Scenario


class DelayedLaw(TrueLaw):
    """A law on delayed knowledge and on the true state.

    Parameters
    ----------
    scenario
        The law, the energy and the agents.
    """

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(scenario)
        self._known = known_kernels(self.layout, self.m, 0)
        self._masses = np.broadcast_to(np.asarray(scenario.agents.masses, dtype=np.float64), self.n)
        self._damping = np.broadcast_to(np.asarray(scenario.agents.damping, dtype=np.float64), self.n)
        self._neighbours = self.pairs(np.zeros((len(self.law.graphs), self.n, self.n), dtype=bool))
        self._times = np.zeros(0)

    def relink(self, known_links: Links) -> None:
        """Take ``known_links``, by what agents know, shape (graphs, N, N), for the forces from now on."""
        self._neighbours = self.pairs(known_links)
        self._times = np.zeros(len(self._neighbours.senders))

    @property
    def linked(self) -> tuple[Indices, Indices]:
        """The agent of each pair that knows, and the one that is known, by the links that agents know."""
        return self._neighbours.senders, self._neighbours.sensed

    def forces(self, t: float, own: Array, known: Array) -> Array:
        """Forces of all agents, shape (N, m); of agents of order 1 their velocities.

        Parameters
        ----------
        t
            The scenario's time.
        own, known
            What each agent knows of itself, shape (N, 2 m), and of its neighbours, in the order of `linked`, shape
            (pairs, 2 m).
        """
        q, p, m = np.ascontiguousarray(own[:, : self.m]), np.ascontiguousarray(own[:, self.m :]), self.m
        rows = np.ascontiguousarray(known[:, None])
        u = np.zeros((self.n, m))
        self._known.control(t, q, p, *self._neighbours, *self.slots, self.functionals, self._times, rows, u, self.rates)
        return u

    def slope(self, force: Array, p: Array) -> Array:
        """Slope of the state vector under a force.

        Parameters
        ----------
        force
            What `forces` gives.
        p
            True velocities, shape (N, m).
        """
        if self.order == 1:
            return force.ravel()
        rate = (force - self._damping[:, None] * p) / self._masses[:, None]
        return np.concatenate([p.ravel(), rate.ravel()])

    def power(self, t: float, q: Array, p: Array, force: Array, pairs: Pairs) -> Array:
        """Work, dissipation, supply and departure, shape (4,), see `flocking.engine.imperfect.powers.POWERS`.

        Parameters
        ----------
        t, q, p
            The scenario's time, and the true positions and velocities, shape (N, m); those of agents of order 1 are
            what acts.
        force
            The force that acts.
        pairs
            Pairs linked in truth.
        """
        u, rates = np.zeros((self.n, self.m)), self.rates
        seen = p if self.order == 2 else np.zeros_like(p)
        self.kernels.control(t, q, seen, pairs, self.slots, self.functionals, u, rates)
        lost, supplied = float(rates[1]), float(rates[2])
        if self.order == 2:
            return np.array([(force * p).sum(), lost, supplied, ((force - u) * (p - self._frame(t, p))).sum()])
        # Beside the law's own flow, -lost + supplied, storage changes at the rate of the velocity that acts.
        departed = lost - supplied - float((u * force).sum())
        self.kernels.module.flow(t, q, seen, *pairs, *self.slots, self.functionals, force, rates)
        return np.array([(force * force).sum(), lost, supplied, departed + float(rates[2])])

    def _frame(self, t: float, p: Array) -> Array:
        """Velocity of the frame of the energy, shape (m,)."""
        energy = self.scenario.energy
        if energy.leader is not None:
            return np.asarray(energy.leader.at(t)[1])
        if energy.frame == "lab":
            return np.zeros(self.m)
        return np.asarray(self._masses @ p / self._masses.sum())
