"""Motion under logged forces, in closed form: exponentials where something is damped or lags, and no series."""

from __future__ import annotations

import math
from bisect import bisect_left
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from flocking.arrays import Array
from flocking.engine.runs.message_log import MessageLog
from flocking.model.bodies.actuators import APPLIED, Lagged, Limited
from flocking.model.bodies.body import Body
from flocking.model.bodies.chained_bodies import WrappedBody
from flocking.model.bodies.disturbances import Disturbed
from flocking.model.bodies.mixtures import Mixture
from flocking.model.law import Scenario
from flocking.model.world.control import Held
from flocking.model.world.times import NANOSECOND, PER_SECOND

MOST_INTERVALS = 4096
"""Matrices that are stored, one for each length of an interval: ticks repeat few lengths, and the store is bounded."""


class Piece(NamedTuple):
    """An agent when something about its force changes.

    Parameters
    ----------
    q, p
        Position and velocity, shape (m,).
    force
        What acts from then on, or what a lagged force tends to, shape (m,).
    beside, lag
        What acts beside a lagged force, and that force; zero where nothing lags.
    """

    q: Array
    p: Array
    force: Array
    beside: Array
    lag: Array


class ForcedMotion:
    """Where every agent is under the forces of a log.

    Parameters
    ----------
    scenario
        Start, bodies and control; its control is held.
    log
        The forces, and when they were computed.
    """

    error = 0.0
    """By how much errors of the run's steps may move agents: both motions are in closed form."""
    shifts = (0.0, 0.0)
    """By how much rounded times of changes may move positions and velocities: all are whole nanoseconds."""

    def __init__(self, scenario: Scenario, log: MessageLog) -> None:
        assert isinstance(scenario.control, Held)
        bodies, start = scenario.agents, scenario.start
        self.n, self.m = start.q.shape
        self.order = bodies.order
        self.masses = np.broadcast_to(np.asarray(bodies.masses, dtype=np.float64), self.n)
        self.damping = np.broadcast_to(np.asarray(bodies.damping, dtype=np.float64), self.n)
        latency = scenario.control.latencies(self.n).tolist()
        self.begins: list[list[int]] = [[0] for _ in range(self.n)]
        """Nanoseconds at which each agent's forces begin to act."""
        self.rows: list[list[int]] = [[-1] for _ in range(self.n)]
        """Acts of the log whose forces these are; -1 for none."""
        none, lagged = np.zeros(self.m), start.columns.get(APPLIED, np.zeros_like(start.q))
        self._held = np.broadcast_to(np.asarray(scenario.control.period, dtype=np.float64), self.n)
        self._chains = [_chain_of(bodies, agent) for agent in range(self.n)]
        """What stands between the desired force of each agent and its motion, the outermost first."""
        parts = {id(x): x for chain in self._chains for x in chain}.values()
        self._forces = [none] * self.n
        """The force that each agent computed last and that has begun to act."""
        self._lagged = any(isinstance(x, Lagged) for x in parts)
        self._pieces: list[list[Piece]] = [
            [Piece(q, p, *self._given(i, none, 0, p), lagged[i])]
            for i, (q, p) in enumerate(zip(start.q, start.p, strict=True))
        ]
        changes: list[tuple[int, int, int]] = [
            (instant + latency[agent], agent, row) for row, (instant, agent, _) in enumerate(log.ticks.tolist())
        ]
        last = scenario.t_end - start.t
        for period in {round(x.period * PER_SECOND) for x in parts if isinstance(x, Disturbed)}:
            for at in range(period, math.ceil(last * PER_SECOND) + 1, period):
                changes += [(at, agent, -1) for agent in range(self.n)]
        for at, agent, row in sorted(changes):
            self._change(at, agent, row, none if row < 0 else log.forces[row])

    def _change(self, at: int, agent: int, row: int, force: Array) -> None:
        """Let a force begin to act, or keep the one that acts under other gusts."""
        q, p, lag = self._moved(agent, at * NANOSECOND, at)
        if row < 0:
            row = self.rows[agent][-1]
            force = self._forces[agent]
        self._forces[agent] = force
        piece = Piece(q, p, *self._given(agent, force, at, p), lag)
        if self.begins[agent][-1] == at and at > 0:
            # Two changes at one instant: the first one never acts.
            self.rows[agent][-1], self._pieces[agent][-1] = row, piece
            return
        self.begins[agent].append(at)
        self.rows[agent].append(row)
        self._pieces[agent].append(piece)

    def _given(self, agent: int, force: Array, at: int, p: Array) -> tuple[Array, Array]:
        """What acts from an instant on, or what a lagged force tends to, and what acts beside the latter.

        Parameters
        ----------
        p
            The velocity at the instant.
        """
        found, beside, behind, speeds = force, np.zeros(self.m), False, []
        for part in self._chains[agent]:
            if isinstance(part, Disturbed):
                number = at // round(part.period * PER_SECOND)
                strength = float(np.broadcast_to(np.asarray(part.sigma, dtype=np.float64), self.n)[agent])
                gust = strength * part.gust(number, self.n, self.m)[agent]
                found, beside = (found, beside + gust) if behind else (found + gust, beside)
            elif isinstance(part, Limited):
                if part.force is not None:
                    found = self._limited(agent, found, part.force, part.shape)
                if part.speed is not None:
                    speeds.append(part.speed)
            behind = behind or isinstance(part, Lagged)
        for speed in reversed(speeds):
            if self.order == 1:
                found = self._limited(agent, found, speed, "ball")
            else:
                found = self._slowed(agent, found, speed, p)
        return found, beside

    def _slowed(self, agent: int, force: Array, most: float | Array, p: Array) -> Array:
        """The force that acts instead of one under which the agent would be too fast when the next one begins.

        It leads to the velocity in the same direction that is as large as the largest speed, or as what damping leaves
        of a larger one.
        """
        limit = float(np.broadcast_to(np.asarray(most, dtype=np.float64), self.n)[agent])
        none, span = np.zeros(self.m), float(self._held[agent])
        free, last = (self._pushed(agent, Piece(none, p, u, none, none), span)[1] for u in (none, force))
        allowed, speed = max(limit, math.hypot(*free)), math.hypot(*last)
        if speed <= allowed:
            return force
        one = self._pushed(agent, Piece(none, none, none + 1.0, none, none), span)[1]
        return (last / speed * allowed - free) / one

    def _limited(self, agent: int, force: Array, most: float | Array, shape: str) -> Array:
        limit = float(np.broadcast_to(np.asarray(most, dtype=np.float64), self.n)[agent])
        if shape == "box":
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
        q, p, _ = self._moved(agent, seconds, instant)
        return q, p

    def acting(self, seconds: float) -> tuple[Array, Array]:
        """The force that acts on each agent, its velocity where it is of order 1, and the lagged force, shape (N, m).

        Parameters
        ----------
        seconds
            Time since the start.
        """
        found, lags = np.empty((self.n, self.m)), np.empty((self.n, self.m))
        for agent in range(self.n):
            piece = self._pieces[agent][self.piece(agent, seconds / NANOSECOND)]
            lags[agent] = self._moved(agent, seconds, None)[2]
            found[agent] = lags[agent] + piece.beside if self._lagged else piece.force
        return found, lags

    def _moved(self, agent: int, seconds: float, instant: float | None) -> tuple[Array, Array, Array]:
        """Position, velocity and lagged force of an agent."""
        k = self.piece(agent, seconds / NANOSECOND if instant is None else instant)
        begin = self._pieces[agent][k]
        s = seconds - self.begins[agent][k] * NANOSECOND
        if self._lagged:
            return self._lagging(agent, begin, s)
        return (*self._pushed(agent, begin, s), begin.lag)

    def _lagging(self, agent: int, begin: Piece, s: float) -> tuple[Array, Array, Array]:
        """Position, velocity and lagged force after a time: first at the largest rate of the force, then free."""
        tau, most = self._lag_of(agent)
        far = math.hypot(*(begin.force - begin.lag))
        if far > most * tau:
            until = min(s, far / most - tau)
            slope = (begin.force - begin.lag) / far * most
            begin = self._linear(agent, begin, until, slope)
            s -= until
        last = self._linear(agent, begin, s, None)
        return last.q, last.p, last.lag

    def _lag_of(self, agent: int) -> tuple[float, float]:
        """Time constant of an agent's lag, and its largest rate."""
        tau, most = math.inf, math.inf
        for part in self._chains[agent]:
            if isinstance(part, Lagged):
                tau = float(np.broadcast_to(np.asarray(part.time_constant, dtype=np.float64), self.n)[agent])
            if isinstance(part, Limited) and part.rate is not None:
                most = min(most, float(np.broadcast_to(np.asarray(part.rate, dtype=np.float64), self.n)[agent]))
        return tau, most

    def _linear(self, agent: int, begin: Piece, s: float, slope: Array | None) -> Piece:
        """An agent after a time: its lagged force changes at the rate ``slope``, or tends to what it is given."""
        tau = math.inf if slope is not None else self._lag_of(agent)[0]
        body = float(self.masses[agent]), float(self.damping[agent])
        change = _change_within(s, tau, body if self.order == 2 else None)
        given = begin.force if slope is None else slope
        q, p, lag = change @ np.array([begin.q, begin.p, begin.lag, given, begin.beside])
        return Piece(q, p if self.order == 2 else lag + begin.beside, begin.force, begin.beside, lag)

    def _pushed(self, agent: int, begin: Piece, s: float) -> tuple[Array, Array]:
        """Position and velocity after a time under a constant force."""
        q, p, force = begin.q, begin.p, begin.force
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


def _chain_of(body: Body, agent: int) -> list[WrappedBody]:
    """What stands between the desired force of an agent and its motion, the outermost first."""
    found: list[WrappedBody] = []
    while isinstance(body, WrappedBody | Mixture):
        if isinstance(body, Mixture):
            body = body.bodies[int(body.kinds[agent])]
        else:
            found.append(body)
            body = body.body
    return found


@lru_cache(maxsize=MOST_INTERVALS)
def _change_within(s: float, tau: float, body: tuple[float, float] | None) -> Array:
    """The matrix that leads an agent a time on, by the exponential of that of its linear equation, shape (3, 5).

    Parameters
    ----------
    s
        The time.
    tau
        Time constant of its lag; infinite where its force changes at a given rate.
    body
        Mass and damping; None where it has no velocity of its own.

    Returns
    -------
    array
        Position, velocity and lagged force from the same, from what the force tends to, or its rate, and from what acts
        beside it.
    """
    from scipy.linalg import expm

    rate = np.zeros((5, 5))
    if body is None:
        rate[0, [2, 4]] = 1.0
    else:
        mass, damping = body
        rate[0, 1] = 1.0
        rate[1, 1:] = [-damping / mass, 1.0 / mass, 0.0, 1.0 / mass]
    rate[2, 2:4] = [-1.0 / tau, 1.0 / tau] if tau < math.inf else [0.0, 1.0]
    return np.asarray(expm(rate * s)[:3])
