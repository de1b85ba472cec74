"""Agents within range of obstacles, and the next change of that.

`obstacle_crossings` locates crossings of all obstacles, `ball_guards` detects all excursions for balls that stand still
or move uniformly.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from flocking.engine.adaptive_steps.integration_method import DEGREE
from flocking.engine.adaptive_steps.segment import ROUNDING, Segment
from flocking.engine.exact.crossings.ball_guards import (
    _place,
    ball_crossings,
    centre_paths,
    largest_radius,
    level_slack,
    uniform_balls,
)
from flocking.engine.exact.crossings.switch_numbers import beyond_level, pair_speed
from flocking.engine.exact.crossings.watch_tables import BallWatches
from flocking.engine.kernels.obstacle_crossings import first_crossings, place_slack, speed_bound
from flocking.engine.kernels.obstacle_distances import ObstacleDistances
from flocking.engine.runs.run import is_tangential
from flocking.formula.compiled import Reading
from flocking.model.checks import Array
from flocking.model.graphs.connectivity import Links
from flocking.model.law import Law
from flocking.model.leaders_and_obstacles.leaders import Sink
from flocking.model.leaders_and_obstacles.obstacles import Obstacle

Indices = NDArray[np.intp]


class ObstacleContacts(ObstacleDistances):
    """Distances of agents from the obstacles of a law, and when they cross the levels of the law."""

    def __init__(self, law: Law) -> None:
        super().__init__(law)
        self._reading = Reading()
        self._balls = [uniform_balls(g) for g in self.groups]

    def are_balls(self, group: int) -> bool:
        """Whether the obstacles of a ``group`` are balls that stand still or move uniformly."""
        return self._balls[group]

    def radii(self, group: int) -> Array:
        """Radii of the balls of a ``group``, shape (K,)."""
        return np.asarray(self._rows[group][list(self.groups[group].rows).index("radius")])

    def record(
        self, group: int, t: float, q: Array, p: Array, pair: tuple[int, int]
    ) -> tuple[float, int, int, str, int, float, bool]:
        """The switch of one pair (agent, obstacle), fields `SWITCH_FIELDS`; ``j`` numbers the obstacle in its term.

        Parameters
        ----------
        group
            Number of the group of obstacles.
        """
        i, o = (int(k) for k in pair)
        obstacle = self.groups[group].obstacles[o]
        if self._balls[group] and _rest([obstacle]):
            speed, size = pair_speed(q[i] - _place(obstacle.centre, t), p[i])  # type: ignore[attr-defined]
        else:
            speed, size = self.speed(group, t, q[i], p[i], o), float(np.linalg.norm(p[i]))
        return self.row(group, t, i, o, speed, size)

    def row(
        self, group: int, t: float, i: int, o: int, speed: float, size: float
    ) -> tuple[float, int, int, str, int, float, bool]:
        """As `record`, of agent ``i`` and obstacle ``o`` of a ``group``, for a known ``speed`` of the distance.

        Parameters
        ----------
        size
            Size of the velocity of the agent.
        """
        return (t, i, self.groups[group].numbers[o], "obstacle", group, speed, is_tangential(speed, size))

    def farther(self, group: int, t: float, q: Array, e: Array, o: int) -> float:
        """How much further from obstacle ``o`` of a ``group`` an agent is if its position has an error.

        Parameters
        ----------
        t, q, e
            The time, the position and its error, shape (m,).
        """
        obstacle = self.groups[group].obstacles[o]
        if self._balls[group]:
            return float(pair_speed(q - _place(obstacle.centre, t), e)[0])  # type: ignore[attr-defined,operator]
        moved, which = np.stack([q, q + e]), np.array([o, o])
        before, after = self.clearance(group, moved, np.array([t, t]), which).tolist()
        return float(after - before)

    def beyond(self, number: int, t: float, q: Array, o: int, q_floor: float) -> float:
        """How far beyond the level ``number`` of obstacle ``o`` an agent may be that crosses it at a time.

        Parameters
        ----------
        t, q
            The time, and its position, shape (m,).
        q_floor
            What rounding adds to a position.
        """
        level = self.levels[number]
        if self._balls[level.group] and _rest(self.groups[level.group].obstacles):
            radii = self.radii(level.group)
            slack = float(level_slack(q_floor / ROUNDING, level.distance, largest_radius(radii)))
            centre = _place(self.groups[level.group].obstacles[o].centre, t)  # type: ignore[attr-defined]
            return float(beyond_level(q - centre, level.distance + float(radii[o]), slack))
        there = float(self.clearance(level.group, q[None], np.array([t]), np.array([o]))[0])
        return float(level_slack(q_floor / ROUNDING, level.distance, 0.0)) + abs(there - level.distance)

    def next_crossings(
        self, segment: Segment, B: Array, near: list[Links], active: list[Links]
    ) -> list[tuple[int, Array, Indices]]:
        """First crossings on a segment.

        Parameters
        ----------
        segment
            The segment.
        B
            Bernstein coefficients of the positions, shape (8, N, m).
        near
            Which pairs are within each level, shape (N, K) each.
        active
            Which pairs are within the range of each group.

        Returns
        -------
        list
            Number of the level, positions in [0, 1] and pairs (agent, obstacle), for each level crossed.
        """
        with self._reading:
            return self._crossings(segment, B, near, active)

    def _crossings(
        self, segment: Segment, B: Array, near: list[Links], active: list[Links]
    ) -> list[tuple[int, Array, Indices]]:
        size = float(np.abs(B).max(initial=0.0))
        length = segment.t1 - segment.t0
        found = []
        for g, group in enumerate(self.groups):
            if self._balls[g]:
                found += self._ball_crossings(g, segment, B, near, active, size)
                continue
            excursion = np.sqrt(((B - B[0]) ** 2).sum(axis=2).max(axis=0))
            clear = self.distances(g, B[0], segment.t0)
            moved = length * np.array([speed_bound(x, segment.t0, segment.t1) for x in group.obstacles])
            reach = excursion[:, None] + moved
            located = place_slack(reach, max(abs(segment.t0), abs(segment.t1)), length)
            parts = []
            for number, level in enumerate(self.levels):
                if level.group != g:
                    continue
                slack = np.maximum(level_slack(size, level.distance, 0.0), located)
                allowance = reach + 2 * slack
                candidates = np.abs(clear - level.distance) <= allowance
                if level.kind == "rim":
                    candidates &= active[g]
                i, o = np.nonzero(candidates)
                sign = np.where(near[number][i, o], 1.0, -1.0)
                border = level.distance + sign * slack[i, o]
                parts.append((np.full(len(i), number), i, o, sign, border))
            levels, i, o, sign, border = (np.concatenate(x) for x in zip(*parts, strict=True))
            if len(i):
                above = self._excess(segment, g, o, sign, border)
                when = first_crossings(above, np.ascontiguousarray(B[:, i].transpose(1, 0, 2)), moved[o])
                for number in np.unique(levels[when <= 1.0]):
                    hit = (when <= 1.0) & (levels == number)
                    found.append((int(number), when[hit], np.stack([i[hit], o[hit]], axis=1)))
        return found

    def tables(self, near: list[Links], active: list[Links]) -> BallWatches | None:
        """Distances from balls at rest that are watched; None where there are other obstacles.

        K of the arrays is the largest number of balls of a group.

        Parameters
        ----------
        near, active
            As for `next_crossings`.
        """
        if not all(balls and _rest(group.obstacles) for balls, group in zip(self._balls, self.groups, strict=True)):
            return None
        paths = [centre_paths(g.obstacles, 0.0, 0.0) for g in self.groups]  # type: ignore[arg-type]
        count, most, (n, m) = len(self.levels), max(p.shape[1] for p in paths), (len(near[0]), paths[0].shape[2])
        centres, radii = np.zeros((count, DEGREE + 1, most, m)), np.zeros((count, most))
        inside, watched = np.zeros((count, n, most), dtype=bool), np.zeros((count, n, most), dtype=bool)
        for number, level in enumerate(self.levels):
            path = paths[level.group]
            balls = slice(path.shape[1])
            centres[number, :, balls] = path
            radii[number, balls] = self.radii(level.group)
            inside[number, :, balls] = near[number]
            watched[number, :, balls] = active[level.group] if level.kind == "rim" else True
        ranges = [number for number, level in enumerate(self.levels) if level.kind == "obstacle"]
        return BallWatches(
            centres, radii, inside, watched, np.array([level.distance for level in self.levels]),
            np.array([level.group for level in self.levels], dtype=np.int64),
            np.array([level.kind == "rim" for level in self.levels], dtype=bool),
            np.array([level.jumps for level in self.levels], dtype=bool),
            np.array(ranges, dtype=np.int64), np.array([p.shape[1] for p in paths], dtype=np.int64),
        )  # fmt: skip

    def _ball_crossings(
        self, g: int, segment: Segment, B: Array, near: list[Links], active: list[Links], size: float
    ) -> list[tuple[int, Array, Indices]]:
        centres = centre_paths(self.groups[g].obstacles, segment.t0, segment.t1)  # type: ignore[arg-type]
        radii = self.radii(g)
        located, moved = 0.0, float(np.linalg.norm(centres[-1] - centres[0], axis=-1).max(initial=0.0))
        if moved:
            reach, latest = np.array(moved + np.abs(centres).max()), max(abs(segment.t0), abs(segment.t1))
            located = float(place_slack(reach, latest, segment.t1 - segment.t0))
        found = []
        for number, level in enumerate(self.levels):
            if level.group == g:
                watched = active[g] if level.kind == "rim" else np.ones_like(active[g])
                margin = max(level_slack(size, level.distance, float(np.max(radii, initial=0.0))), located)
                when, candidate = ball_crossings(B, centres, radii, near[number], watched, level.distance, margin)
                if len(when):
                    found.append((number, when, candidate))
        return found

    def _excess(
        self, segment: Segment, group: int, obstacle: Indices, sign: Array, border: Array
    ) -> Callable[[Array, Array, Indices], Array]:
        """How far candidates are beyond their border, as a function for `first_crossings`."""
        length = segment.t1 - segment.t0

        def above(points: Array, x: Array, which: Indices) -> Array:
            values = self.clearance(group, points, segment.t0 + length * x, obstacle[which])
            return np.asarray(sign[which] * (values - border[which]))

        return above


def _rest(obstacles: Sequence[Obstacle]) -> bool:
    return all(x.mover is None or type(x.mover) is Sink for x in obstacles)
