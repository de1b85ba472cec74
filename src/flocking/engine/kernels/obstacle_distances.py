"""Distances of agents from the obstacles of a law, and the distances at which its formulas change."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flocking.model.checks import Array
from flocking.model.graphs.connectivity import Links
from flocking.model.law import Law
from flocking.model.terms.avoidance import Avoid, ObstacleGroup, ObstacleTerm

Indices = NDArray[np.intp]

SPEED_STEP = 1e-6
"""Time on each side over which the speed of a crossing is a difference quotient: near the root of its rounding."""


@dataclass(frozen=True)
class Level:
    """A distance from the obstacles of one group at which something happens.

    Parameters
    ----------
    group
        Number of the group.
    kind
        ``"obstacle"`` at the range of the term, ``"rim"`` at a kink of its force below it.
    distance
        The distance.
    jumps
        Whether the force may jump there.
    """

    group: int
    kind: str
    distance: float
    jumps: bool = True


def _jumps_at(term: ObstacleTerm, distance: float) -> bool:
    """Whether the force of a term may jump at a kink: of `Avoid` only where its repulsion has one of its own."""
    return not isinstance(term, Avoid) or distance in term.repulsion.kinks()


class ObstacleDistances:
    """Distances of agents from the obstacles of a law, and the levels they cross."""

    def __init__(self, law: Law) -> None:
        self.groups: list[ObstacleGroup] = []
        self.levels: list[Level] = []
        for term in law.body_terms:
            if isinstance(term, ObstacleTerm):
                inner = sorted(d for d in term.kinks() if d < term.range)
                for group in term.groups:
                    number = len(self.groups)
                    self.levels.append(Level(number, "obstacle", term.range))
                    self.levels += [Level(number, "rim", x, _jumps_at(term, x)) for x in inner]
                    self.groups.append(group)
        self._distance = [g.obstacles[0].distance_function() for g in self.groups]
        self._rows = [np.array([v.values for v in g.rows.values()]) for g in self.groups]
        self._columns = [list(rows) for rows in self._rows]
        self._ranges = [level for level in self.levels if level.kind == "obstacle"]

    def distances(self, group: int, q: Array, t: float) -> Array:
        """Signed distances of all agents from the obstacles of a group, shape (N, K)."""
        n, count = len(q), len(self.groups[group].obstacles)
        points = np.repeat(q, count, axis=0)
        found = self.clearance(group, points, np.full(n * count, t), np.tile(np.arange(count), n))
        return found.reshape(n, count)

    def within(self, level: Level, q: Array, t: float) -> Links:
        """Which agents are closer than the level, shape (N, K); at the range itself closed, as printed."""
        distance = self.distances(level.group, q, t)
        return np.asarray(distance <= level.distance if level.kind == "obstacle" else distance < level.distance)

    def met(self, q: Array, t: float) -> list[tuple[Indices, Indices]]:
        """Agents within range of an obstacle, and the obstacles, of every group."""
        return [(i, o) for i, o in (np.nonzero(self.within(level, q, t)) for level in self._ranges)]

    def met_by_one(self, q: Array, t: float) -> list[Indices]:
        """Obstacles within whose range one agent at ``q``, shape (1, m), is, of every group."""
        found = []
        for level in self._ranges:
            count = len(self.groups[level.group].obstacles)
            points = q if count == 1 else q.repeat(count, axis=0)
            distance = self._distance[level.group](points, np.full(count, t), self._columns[level.group])
            found.append((distance <= level.distance).nonzero()[0])
        return found

    def clearance(self, group: int, points: Array, t: Array, obstacle: Indices) -> Array:
        """Signed distances of points, shape (k, m), at times ``t`` from one obstacle of a group each; shape (k,)."""
        return self._distance[group](points, t, list(self._rows[group][:, obstacle]))

    def speed(self, group: int, t: float, q: Array, p: Array, obstacle: int) -> float:
        """Rate at which the distance of one agent from one obstacle of a group grows.

        Parameters
        ----------
        q, p
            Position and velocity of the agent at time ``t``, shape (m,).
        """
        low, high = (
            self.clearance(group, (q + s * p)[None], np.array([t + s]), np.array([obstacle]))[0]
            for s in (-SPEED_STEP, SPEED_STEP)
        )
        return float(high - low) / (2 * SPEED_STEP)
