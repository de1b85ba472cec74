"""Which agents are within range of obstacles, and when that changes while they move on polynomials."""

from __future__ import annotations

import heapq
import math
from typing import NamedTuple

import numpy as np

from flocking.arrays import Array, Indices, Links
from flocking.engine.imperfect.pair_polynomials import ROUNDING
from flocking.engine.kernels.obstacle_crossings import first_crossings, place_slack, speed_bound
from flocking.engine.kernels.obstacle_distances import ObstacleDistances
from flocking.engine.runs.run import SwitchRow, is_tangential
from flocking.formula.compiled import Reading
from flocking.model.law import Law


class RangeCrossing(NamedTuple):
    """When an agent comes within range of an obstacle, or leaves it.

    Parameters
    ----------
    seconds
        When, since the start.
    agent, group, obstacle
        The agent, the number of the group of obstacles, and that of the obstacle within it.
    """

    seconds: float
    agent: int
    group: int
    obstacle: int


class ObstacleRanges(ObstacleDistances):
    """Agents within range of obstacles, and the next change of that for every agent and obstacle.

    Parameters
    ----------
    law
        The law.
    q, t
        Positions and time at the start.

    Attributes
    ----------
    near
        Which agents are within range of which obstacles, of every group, shape (N, K) each.
    ranges
        The range of every group.
    ends
        When the motion of every agent changes next, in seconds from the start, shape (N,).
    due
        Heap of the crossings until then, at most one for an agent and an obstacle.
    """

    def __init__(self, law: Law, q: Array, t: float) -> None:
        super().__init__(law)
        self._reading = Reading()
        self.ranges = [level.distance for level in self.levels if level.kind == "obstacle"]
        self.near: list[Links] = self.within_ranges(q, t)
        self.ends = np.zeros(len(q))
        self.due: list[RangeCrossing] = []

    @property
    def pairs(self) -> list[tuple[Indices, Indices]]:
        """Agents within range of an obstacle, and the obstacles, of every group."""
        return [(i, o) for i, o in map(np.nonzero, self.near)]

    def within_ranges(self, q: Array, t: float) -> list[Links]:
        """Which points are within range of which obstacles, of every group, shape (points, K) each.

        Parameters
        ----------
        q, t
            The points, shape (points, m), and the scenario's time.
        """
        with self._reading:
            return [self.within(level, q, t) for level in self._ranges]

    def within_range_by(self, q: Array, t: float, agents: Indices) -> list[tuple[Indices, Indices]]:
        """Agents within range of an obstacle by the positions that they assume, and the obstacles, of every group.

        Parameters
        ----------
        q
            Positions that ``agents`` assume, shape (agents, m).
        t
            The scenario's time.
        """
        with self._reading:
            return [(agents[i], o) for i, o in super().met(q, t)]

    def watch(self, base: float, seconds: float, S: Array, agents: Indices) -> None:
        """Find the next crossings of ``agents``, whose motion goes on until `ends`.

        Parameters
        ----------
        base
            The scenario's time at the start.
        seconds
            Now, since the start.
        S
            Taylor coefficients of the positions about now, shape (degree + 1, N, m).
        """
        if not self.groups or not agents.size:
            return
        gone = set(agents.tolist())
        self.due = [x for x in self.due if x.agent not in gone]
        heapq.heapify(self.due)
        for group, there in enumerate(self.near):
            who, which = (x.ravel() for x in np.broadcast_arrays(agents[:, None], np.arange(there.shape[1])))
            self._find(base, seconds, S, group, (who, which))

    def cross(self, base: float, S: Array) -> RangeCrossing:
        """Cross the next range, and find the crossing after it of the same two.

        Parameters
        ----------
        base
            The scenario's time at the start.
        S
            Taylor coefficients of the positions about that moment, shape (degree + 1, N, m).
        """
        found = heapq.heappop(self.due)
        there = self.near[found.group]
        there[found.agent, found.obstacle] = not there[found.agent, found.obstacle]
        pair = np.array([found.agent]), np.array([found.obstacle])
        self._find(base, found.seconds, S, found.group, pair)
        return found

    def record(self, t: float, agent: int, group: int, obstacle: int, motion: tuple[Array, Array]) -> SwitchRow:
        """The row of a crossing in the table of switches; errors of its time and speed are not known.

        Parameters
        ----------
        t
            The scenario's time.
        agent, group, obstacle
            As for `RangeCrossing`.
        motion
            Position and velocity of the agent, shape (m,) each.
        """
        q, p = motion
        speed, number = self.speed(group, t, q, p, obstacle), self.groups[group].numbers[obstacle]
        slow = is_tangential(speed, float(np.linalg.norm(p)))
        return t, agent, number, "obstacle", group, speed, slow, math.nan, math.nan

    def _find(self, base: float, seconds: float, S: Array, group: int, pairs: tuple[Indices, Indices]) -> None:
        """Put the first crossing of every pair (agent, obstacle) of a group into the heap."""
        agents, obstacles = pairs
        span = self.ends[agents] - seconds
        ahead = span > 0.0
        agents, obstacles, span = agents[ahead], obstacles[ahead], span[ahead]
        if not len(agents):
            return
        powers = span[:, None] ** np.arange(len(S))
        paths = np.einsum("ba,ka,akx->kbx", _bernstein(len(S) - 1), powers, S[:, agents])
        until = base + seconds + float(span.max())
        fastest = np.array([speed_bound(x, base + seconds, until) for x in self.groups[group].obstacles])
        sign = np.where(self.near[group][agents, obstacles], 1.0, -1.0)
        level = self.ranges[group]
        moved = span * fastest[obstacles]
        excursion = np.sqrt(((paths - paths[:, :1]) ** 2).sum(axis=2).max(axis=1))
        longest = float(span.max())
        located = place_slack((excursion + moved) * longest / span, until, longest)
        border = level + sign * np.maximum(ROUNDING * max(level, float(np.abs(S[0]).max())), located)

        def above(points: Array, x: Array, which: Indices) -> Array:
            times = base + seconds + span[which] * x
            return np.asarray(sign[which] * (self.clearance(group, points, times, obstacles[which]) - border[which]))

        with self._reading:
            when = first_crossings(above, np.ascontiguousarray(paths), moved)
        for k in np.flatnonzero(when <= 1.0).tolist():
            at = float(seconds + span[k] * when[k])
            heapq.heappush(self.due, RangeCrossing(at, int(agents[k]), group, int(obstacles[k])))


def _bernstein(degree: int) -> Array:
    """Matrix from power coefficients on [0, 1] to Bernstein coefficients of the same degree."""
    from math import comb

    rows = range(degree + 1)
    return np.array([[comb(i, k) / comb(degree, k) if k <= i else 0.0 for k in rows] for i in rows])
