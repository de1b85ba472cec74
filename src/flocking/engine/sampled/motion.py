"""Motion under a constant force: one polynomial in time for each agent, from the last change of its force on."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flocking.arrays import Array, Indices
from flocking.engine.imperfect.taylor_series import shifted
from flocking.model.world.times import NANOSECOND, Instants

if TYPE_CHECKING:
    from flocking.model.bodies.body import Body

DAMPED_DEGREE = 7
"""Degree of the polynomial of a damped agent."""

DAMPED_SHARE = 1.0 / 32.0
"""Longest piece of a damped agent over its time constant m/k: (1/32)**8/8! = 2e-17 bounds what the polynomial leaves
out, relative to the change of the velocity."""

LONGEST_PIECE = 1 << 62
"""Nanoseconds of a piece that has no end of its own."""


class Motion:
    """Positions as polynomials in the time since each agent's piece began.

    Parameters
    ----------
    q, p
        Positions and velocities at the start, shape (N, m).
    body
        Masses, damping and order of the agents.

    Attributes
    ----------
    begin
        When each piece began, in nanoseconds from the start, shape (N,).
    coefficients
        Taylor coefficients of the positions, shape (degree + 1, N, m).
    force
        The force that acts, shape (N, m); of agents of order 1 their velocity.
    """

    def __init__(self, q: Array, p: Array, body: Body) -> None:
        n = len(q)
        self.order = body.order
        self.masses = np.broadcast_to(np.asarray(body.masses, dtype=np.float64), n)[:, None]
        self.rate = np.broadcast_to(np.asarray(body.damping, dtype=np.float64), n)[:, None] / self.masses
        damped = self.order == 2 and bool(self.rate.any())
        self.degree = 1 if self.order == 1 else DAMPED_DEGREE if damped else 2
        self.begin: Instants = np.zeros(n, dtype=np.int64)
        self.longest = np.full(n, LONGEST_PIECE, dtype=np.int64)
        if damped:
            with np.errstate(divide="ignore"):
                pieces = DAMPED_SHARE / self.rate[:, 0] / NANOSECOND
            self.longest = np.maximum(np.minimum(np.floor(pieces), float(LONGEST_PIECE)), 1.0).astype(np.int64)
        self.coefficients = np.zeros((self.degree + 1, *q.shape))
        self.force = np.zeros(q.shape)
        self._restart(np.arange(n), np.asarray(q, dtype=np.float64), np.asarray(p, dtype=np.float64))

    def piece(self, agents: Indices, q: Array, p: Array, force: Array) -> Array:
        """Taylor coefficients of the motion of ``agents``, shape (degree + 1, agents, m).

        Parameters
        ----------
        q, p
            Positions and velocities at the beginning, shape (agents, m).
        force
            The force that acts, shape (agents, m).
        """
        C = np.empty((self.degree + 1, *q.shape))
        C[0] = q
        if self.order == 1:
            C[1] = force
            return C
        C[1] = p
        rate = self.rate[agents]
        C[2] = 0.5 * (force / self.masses[agents] - rate * p)
        for k in range(3, self.degree + 1):
            C[k] = -rate / k * C[k - 1]
        return C

    def _restart(self, agents: Indices, q: Array, p: Array) -> None:
        """Take up new pieces of ``agents`` at positions and velocities, under the force that acts."""
        self.coefficients[:, agents] = self.piece(agents, q, p, self.force[agents])

    def ends(self) -> Instants:
        """When each agent's polynomial is no longer exact to rounding, in nanoseconds, shape (N,)."""
        return np.minimum(self.begin, LONGEST_PIECE - self.longest) + self.longest

    def shifted(self, time: float) -> Array:
        """Coefficients of the same polynomials about ``time`` seconds from the start, shape (degree + 1, N, m)."""
        return shifted(self.coefficients, np.asarray(time - self.begin * NANOSECOND)[:, None])

    def at(self, time: float, agents: Indices | slice = slice(None)) -> tuple[Array, Array]:
        """Positions and velocities of ``agents`` at ``time`` seconds from the start.

        Velocities of agents of order 1 are those with which they move.
        """
        s = (time - self.begin[agents] * NANOSECOND)[:, None]
        C = self.coefficients[:, agents]
        q, p = C[-1], self.degree * C[-1]
        for k in range(self.degree - 1, -1, -1):
            q = q * s + C[k]
            if k:
                p = p * s + k * C[k]
        return q, p

    def exert(self, time: int, agents: Indices, force: Array | None = None) -> None:
        """Begin new pieces of ``agents`` at ``time`` nanoseconds, under another force where one is given."""
        q, p = self.at(time * NANOSECOND, agents)
        self.begin[agents] = time
        if force is not None:
            self.force[agents] = force
        self._restart(agents, q, p)
