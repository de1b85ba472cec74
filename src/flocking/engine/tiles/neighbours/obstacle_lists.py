"""Neighbour lists of obstacles: those within range of a tile until agents or obstacles have moved by a margin.

The distance to an obstacle changes at most as fast as agent and obstacle move. If an obstacle is farther from the
centre of a tile than the sum of its range, the radius of the tile and a margin, it stays out of range until the
motion exceeds the margin.

For the same reason tiles are not held against every obstacle: the tiles in each cell of a coarse grid are held together
against all of them, then those in the cells of finer grids against what was not too far from the cell around them.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from flocking.arrays import Array, Indices, Numbers, Numbers32, Reals
from flocking.engine.kernels.obstacle_distances import ObstacleDistances
from flocking.engine.tiles.neighbours.neighbour_lists import WIDTH
from flocking.model.law import Law
from flocking.model.leaders_and_obstacles.leaders import Sink, Velocity

MOST_AT_ONCE = 1_000_000
"""Number of distances computed at once."""

MARGIN = 0.5
"""Margin as a fraction of the longest range."""

FINER = 4
"""Cells of a grid along each axis in one of the coarser grid."""

TILES_IN_CELL = 4
"""Grids are no finer than that so many tiles are in a cell: then tiles themselves are held against what is left."""

ROUNDING = 1e-9
"""Extents and distances may be off by this fraction: far more than their rounding, far less than the margin."""

FIRST_HORIZON = 1.0
"""Time ahead for which the speed of obstacles on paths is bounded first; see `ObstacleLists.require`."""


class Near(NamedTuple):
    """The obstacles that may be near each of some groups of tiles, group by group.

    Parameters
    ----------
    begin
        Where those of each group begin, and the number of all, shape (groups + 1,).
    who
        Numbers of obstacles, ascending within a group.
    """

    begin: Numbers
    who: Numbers


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
        self.from_, self.until = -np.inf, np.inf
        self.horizon = FIRST_HORIZON
        movers = [x.mover for group in self.obstacle_distances.groups for x in group.obstacles]
        self._on_paths = [m for m in movers if m is not None and type(m) not in (Sink, Velocity)]
        self._steady = max((float(np.linalg.norm(m.value)) for m in movers if type(m) is Velocity), default=0.0)

    def moved(self, distance: float, duration: float) -> None:
        """Account for motion of agents by at most ``distance`` within ``duration``."""
        self.used += distance + (0.0 if np.isinf(self.speed) else self.speed * duration)

    def require(self, q: Reals, tiles: int, t: float, stride: float) -> None:
        """Rebuild the lists if they may be invalid for positions ``q``, shape (m, 16 tiles), at time ``t``.

        The speed of obstacles on paths is bounded from now on for a time in which they use up about the margin.

        Parameters
        ----------
        stride
            Largest motion in a step.
        """
        if self.used <= self.margin and self.from_ <= t <= self.until:
            return
        self.margin = max(MARGIN * max(self.ranges), 10.0 * stride)
        self._bound_speeds(t)
        self.lists = self.around(q, tiles, t)
        self.used = 0.0

    def around(self, q: Reals, tiles: int, t: float) -> list[tuple[Numbers, Numbers32]]:
        """Lists for positions ``q``, shape (m, 16 tiles), at time ``t``, which are not kept.

        Parameters
        ----------
        tiles
            Number of tiles.
        """
        # The agents of tiles as the first axis: extremes along a short last one take NumPy ten times as long.
        boxes = np.ascontiguousarray(q.reshape(len(q), tiles, WIDTH).transpose(2, 0, 1))
        low, high = boxes.min(axis=0).astype(np.float64), boxes.max(axis=0).astype(np.float64)
        centre, radius = 0.5 * (low + high).T, 0.5 * np.sqrt(((high - low) ** 2).sum(axis=0))
        return [self._near(g, centre, radius, t) for g in range(len(self.ranges))]

    def _bound_speeds(self, t: float) -> None:
        """Take a bound of the speeds of all obstacles, and from when until when it is one."""
        self.speed, self.from_, self.until = self._steady, -np.inf, np.inf
        if not self._on_paths:
            return
        for _ in range(8):
            bound = max(m.speed_bound(t, t + self.horizon) for m in self._on_paths)
            # A path without a bound is not looked at again: every tile lists every obstacle.
            if np.isinf(bound) or bound * self.horizon <= 4.0 * self.margin:
                break
            self.horizon /= 4.0
        self.speed = max(self._steady, bound)
        self.from_, self.until = t, t + self.horizon
        if bound * self.horizon < 0.25 * self.margin:
            self.horizon *= 2.0

    def _near(self, group: int, centre: Array, radius: Array, t: float) -> tuple[Numbers, Numbers32]:
        """The obstacles of a group within range of each tile, given their centres, shape (tiles, m), and radii."""
        tiles, count = len(centre), len(self.obstacle_distances.groups[group].obstacles)
        if np.isinf(self.speed):
            return np.arange(tiles + 1) * count, np.tile(np.arange(count, dtype=np.int32), tiles)
        reach = self.ranges[group] + self.margin
        found = Near(np.array([0, count]), np.arange(count))
        place = np.zeros(tiles, np.int64)
        if np.isfinite(centre).all():
            for cell in _cells(centre):
                # Everything in a cell lies in the one around it.
                _, one, inside = np.unique(cell, return_index=True, return_inverse=True)
                middle, around = _spheres(centre, radius, inside, len(one))
                found = self._closer(group, found, place[one], middle, reach + around, t)
                place = inside
        found = self._closer(group, found, place, centre, reach + radius * (1.0 + ROUNDING), t)
        return found.begin, found.who.astype(np.int32)

    def _closer(self, group: int, wide: Near, place: Numbers, points: Array, reach: Array, t: float) -> Near:
        """Those of the obstacles that may be near the group of tiles around a point that are near the point.

        Parameters
        ----------
        wide
            Obstacles that may be near.
        place
            Which of its groups each point lies in, shape (points,).
        points, reach
            The points, shape (points, m), and how far each one's obstacles are, shape (points,).
        """
        many = wide.begin[place + 1] - wide.begin[place]
        ends = np.cumsum(many)
        whose = np.repeat(np.arange(len(points)), many)
        who = wide.who[np.arange(len(whose)) + np.repeat(wide.begin[place] - (ends - many), many)]
        near = np.empty(len(who), dtype=bool)
        for first in range(0, len(who), MOST_AT_ONCE):
            some = slice(first, first + MOST_AT_ONCE)
            each: Numbers = whose[some]
            near[some] = ~(self._distances(group, points[each], t, who[some]) > reach[each])
        begin = np.zeros(len(points) + 1, np.int64)
        np.cumsum(np.bincount(whose[near], minlength=len(points)), out=begin[1:])
        return Near(begin, who[near])

    def _distances(self, group: int, points: Array, t: float, who: Indices) -> Array:
        return self.obstacle_distances.clearance(group, points, np.full(len(points), t), who)


def _cells(centre: Array) -> Iterator[Numbers]:
    """Number of the cell that each tile's centre lies in, shape (tiles,), of finer and finer grids."""
    tiles, m = centre.shape
    depth = 0
    while TILES_IN_CELL * FINER ** (m * (depth + 1)) <= tiles:
        depth += 1
    # Few tiles need no grid, and a rank of many may have none.
    if not depth:
        return
    low = centre.min(axis=0)
    extent = float((centre.max(axis=0) - low).max())
    if not extent > 0.0:
        return
    finest = np.minimum((centre - low) / extent * FINER**depth, FINER**depth - 1).astype(np.int64)
    for level in range(1, depth + 1):
        coarse, number = finest // FINER ** (depth - level), np.zeros(tiles, np.int64)
        for k in range(m):
            number = number * FINER**level + coarse[:, k]
        yield number


def _spheres(centre: Array, radius: Array, inside: Numbers, count: int) -> tuple[Array, Array]:
    """Centres, shape (count, m), and radii of spheres around the tiles ``inside`` each of some cells."""
    low, high = np.full((count, centre.shape[1]), np.inf), np.full((count, centre.shape[1]), -np.inf)
    np.minimum.at(low, inside, centre)
    np.maximum.at(high, inside, centre)
    middle, around = 0.5 * (low + high), np.zeros(count)
    np.maximum.at(around, inside, np.sqrt(((centre - middle[inside]) ** 2).sum(axis=1)) + radius)
    return middle, around * (1.0 + ROUNDING) + ROUNDING * np.abs(middle).max(axis=1)
