"""Neighbour lists of obstacles: those within range of a tile until agents or obstacles have moved by a margin.

The distance to an obstacle changes at most as fast as agent and obstacle move. If an obstacle is farther from the
centre of a tile than the sum of its range, the radius of the tile and a margin, it stays out of range until the
motion exceeds the margin.
"""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array, Numbers, Numbers32, Reals
from flocking.engine.kernels.obstacle_distances import ObstacleDistances
from flocking.engine.tiles.neighbours.neighbour_lists import WIDTH
from flocking.model.law import Law
from flocking.model.leaders_and_obstacles.leaders import Sink, Velocity

MOST_AT_ONCE = 2_000_000
"""Number of distances computed at once."""

MARGIN = 0.5
"""Margin as a fraction of the longest range."""


class ObstacleLists:
    """Lists of the obstacles of a law within range of each tile.

    Parameters
    ----------
    law
        The law.
    ranges
        Range of each group of obstacles.
    """

    def __init__(self, law: Law, ranges: list[float]) -> None:
        self.obstacle_distances = ObstacleDistances(law)
        self.ranges = ranges
        self.lists: list[tuple[Numbers, Numbers32]] = []
        self.used = np.inf
        self.margin = 0.0
        self.speed = 0.0
        for group in self.obstacle_distances.groups:
            for obstacle in group.obstacles:
                mover = obstacle.mover
                if mover is not None and type(mover) not in (Sink, Velocity):
                    # Its speed has no bound: every tile lists every obstacle.
                    self.speed = np.inf
                elif type(mover) is Velocity:
                    self.speed = max(self.speed, float(np.linalg.norm(mover.value)))

    def moved(self, distance: float, duration: float) -> None:
        """Account for motion of agents by at most ``distance`` within ``duration``."""
        self.used += distance + (0.0 if np.isinf(self.speed) else self.speed * duration)

    def require(self, q: Reals, tiles: int, t: float, stride: float) -> None:
        """Rebuild the lists if they may be invalid for positions ``q``, shape (m, 16 tiles).

        Parameters
        ----------
        stride
            Largest motion in a step.
        """
        if self.used <= self.margin:
            return
        self.margin = max(MARGIN * max(self.ranges), 10.0 * stride)
        boxes = q.reshape(len(q), tiles, WIDTH)
        low, high = boxes.min(axis=2).astype(np.float64), boxes.max(axis=2).astype(np.float64)
        centre, radius = 0.5 * (low + high).T, 0.5 * np.sqrt(((high - low) ** 2).sum(axis=0))
        self.lists = [self._near(g, centre, radius, t) for g in range(len(self.ranges))]
        self.used = 0.0

    def _near(self, group: int, centre: Array, radius: Array, t: float) -> tuple[Numbers, Numbers32]:
        tiles, count = len(centre), len(self.obstacle_distances.groups[group].obstacles)
        begin = np.zeros(tiles + 1, np.int64)
        found = [np.zeros(0, np.int32)]
        share = max(1, MOST_AT_ONCE // count)
        for first in range(0, tiles, share):
            part = slice(first, min(first + share, tiles))
            if np.isinf(self.speed):
                near = np.ones((part.stop - first, count), dtype=bool)
            else:
                reach = self.ranges[group] + radius[part, None] * (1 + 1e-9) + self.margin
                distance = self.obstacle_distances.distances(group, centre[part], t)
                near = ~(distance > reach)
            begin[first + 1 : part.stop + 1] = near.sum(axis=1)
            found.append(np.nonzero(near)[1].astype(np.int32))
        return np.cumsum(begin), np.concatenate(found)
