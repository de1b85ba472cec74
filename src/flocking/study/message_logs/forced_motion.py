"""Motion under logged forces, in closed form: exponentials where agents are damped, no polynomials of any engine."""

from __future__ import annotations

import math
from bisect import bisect_left

import numpy as np

from flocking.arrays import Array
from flocking.engine.runs.message_log import MessageLog
from flocking.model.bodies.actuators import Limited
from flocking.model.law import Scenario
from flocking.model.world.control import Held
from flocking.model.world.times import NANOSECOND


class ForcedMotion:
    """Where every agent is under the forces of a log.

    Parameters
    ----------
    scenario
        Start, bodies and control; its control is held.
    log
        The forces, and when they were computed.
    """

    def __init__(self, scenario: Scenario, log: MessageLog) -> None:
        assert isinstance(scenario.control, Held)
        bodies, start = scenario.agents, scenario.start
        self.n, self.m = start.q.shape
        self.order = bodies.order
        self._body = bodies
        self.masses = np.broadcast_to(np.asarray(bodies.masses, dtype=np.float64), self.n)
        self.damping = np.broadcast_to(np.asarray(bodies.damping, dtype=np.float64), self.n)
        latency = scenario.control.latency_in_nanoseconds
        self.begins: list[list[int]] = [[0] for _ in range(self.n)]
        """Nanoseconds at which each agent's forces begin to act."""
        self.rows: list[list[int]] = [[-1] for _ in range(self.n)]
        """Acts of the log whose forces these are; -1 for none."""
        none = np.zeros(self.m)
        self._pieces: list[list[tuple[Array, Array, Array]]] = [
            [(q, p, none)] for q, p in zip(start.q, start.p, strict=True)
        ]
        for row, (instant, agent, _) in enumerate(log.ticks.tolist()):
            at = instant + latency
            q, p = self.state(agent, at * NANOSECOND, at)
            self.begins[agent].append(at)
            self.rows[agent].append(row)
            self._pieces[agent].append((q, p, self.exerted(agent, log.forces[row])))

    def exerted(self, agent: int, force: Array) -> Array:
        """What an ``agent`` exerts of a ``force`` that it computed, shape (m,): a limit acts on what is held."""
        body = self._body
        if not isinstance(body, Limited):
            return force
        most = body.speed if self.order == 1 else body.force
        limit = float(np.broadcast_to(np.asarray(most, dtype=np.float64), self.n)[agent])
        if self.order == 2 and body.shape == "box":
            return np.array([min(max(float(x), -limit), limit) for x in force])
        length = math.hypot(*force)
        return force if length <= limit else force / length * limit

    def piece(self, agent: int, instant: float) -> int:
        """Which piece of an agent's motion it is on until an ``instant``, that nanosecond included."""
        return max(bisect_left(self.begins[agent], instant) - 1, 0)

    def state(self, agent: int, seconds: float, instant: float | None = None) -> tuple[Array, Array]:
        """Position and velocity of an agent before forces change at that time; of order 1 the velocity it moves with.

        Parameters
        ----------
        seconds
            Time since the start.
        instant
            The same in nanoseconds, where it is a whole number of them.
        """
        k = self.piece(agent, seconds / NANOSECOND if instant is None else instant)
        q, p, force = self._pieces[agent][k]
        s = seconds - self.begins[agent][k] * NANOSECOND
        if self.order == 1:
            return q + force * s, force
        mass, damping = self.masses[agent], self.damping[agent]
        if damping == 0.0:
            return q + p * s + 0.5 * force / mass * s * s, p + force / mass * s
        final, share = force / damping, -np.expm1(-damping * s / mass)
        return q + final * s + (p - final) * share * mass / damping, p + (final - p) * share

    def states(self, seconds: float, instant: float | None = None) -> tuple[Array, Array]:
        """Positions and velocities of all agents, shape (N, m) each; see `state`.

        Parameters
        ----------
        seconds, instant
            When.
        """
        both = [self.state(agent, seconds, instant) for agent in range(self.n)]
        return np.array([q for q, _ in both]), np.array([p for _, p in both])
