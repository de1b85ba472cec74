"""Neighbour lists of obstacles: which the agents of a tile may meet while nobody has moved too far.

The distance to an obstacle changes no faster than agent and obstacle move. An obstacle that is farther from
the middle of a tile than its range, the tile's radius and a margin cannot be met until somebody has moved
by the margin.
"""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array, Numbers, Numbers32, Reals
from flocking.engine.kernels.obstacle_distances import ObstacleDistances
from flocking.engine.tiles.neighbours.neighbour_lists import WIDTH
from flocking.model.law import Law
from flocking.model.leaders_and_obstacles.leaders import Sink, Velocity

MOST_AT_ONCE = 2_000_000
"""Distances computed at once."""

MARGIN = 0.5
"""Margin as a fraction of the longest range."""


class ObstacleLists:
    """Lists of the obstacles of a law that each tile may meet.

    Parameters
    ----------
    law
        The law.
    ranges
        Range of each group of obstacles.
    """

    def __init__(self, law: Law, ranges: list[float]) -> None:
        self.encounters = ObstacleDistances(law)
        self.ranges = ranges
        self.lists: list[tuple[Numbers, Numbers32]] = []
        self.used = np.inf
        self.margin = 0.0
        self.speed = 0.0
        for group in self.encounters.groups:
            for obstacle in group.obstacles:
                mover = obstacle.mover
                if mover is not None and type(mover) not in (Sink, Velocity):
                    # Nothing bounds how fast it will move: every tile looks at every obstacle.
                    self.speed = np.inf
                elif type(mover) is Velocity:
                    self.speed = max(self.speed, float(np.linalg.norm(mover.value)))

    def moved(self, distance: float, duration: float) -> None:
        """Somebody may have moved by ``distance`` within ``duration``."""
        self.used += distance + (0.0 if np.isinf(self.speed) else self.speed * duration)

    def require(self, q: Reals, tiles: int, t: float, stride: float) -> None:
        """Make sure that the lists are valid for positions ``q``, shape (m, 16 tiles); ``stride``: length of a step."""
        if self.used <= self.margin:
            return
        self.margin = max(MARGIN * max(self.ranges), 10.0 * stride)
        boxes = q.reshape(len(q), tiles, WIDTH)
        low, high = boxes.min(axis=2).astype(np.float64), boxes.max(axis=2).astype(np.float64)
        centre, radius = 0.5 * (low + high).T, 0.5 * np.sqrt(((high - low) ** 2).sum(axis=0))
        self.lists = [self._near(g, centre, radius, t) for g in range(len(self.ranges))]
        self.used = 0.0

    def _near(self, group: int, centre: Array, radius: Array, t: float) -> tuple[Numbers, Numbers32]:
        tiles, count = len(centre), len(self.encounters.groups[group].obstacles)
        begin = np.zeros(tiles + 1, np.int64)
        found = [np.zeros(0, np.int32)]
        share = max(1, MOST_AT_ONCE // count)
        for first in range(0, tiles, share):
            part = slice(first, min(first + share, tiles))
            if np.isinf(self.speed):
                near = np.ones((part.stop - first, count), dtype=bool)
            else:
                reach = self.ranges[group] + radius[part, None] * (1 + 1e-9) + self.margin
                distance = self.encounters.distances(group, centre[part], t)
                near = ~(distance > reach)
            begin[first + 1 : part.stop + 1] = near.sum(axis=1)
            found.append(np.nonzero(near)[1].astype(np.int32))
        return np.cumsum(begin), np.concatenate(found)
