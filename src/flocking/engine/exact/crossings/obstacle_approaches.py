"""How near agents come to the distances from obstacles at which forces may jump, on one step."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from flocking.engine.adaptive_steps.segment import ROUNDING, Segment
from flocking.engine.exact.crossings.ball_guards import centre_paths, largest_radius, level_slack
from flocking.engine.exact.crossings.band_guards import closest_after, first_beyond
from flocking.engine.exact.crossings.switching import LinkState
from flocking.engine.kernels.bernstein import NEVER
from flocking.engine.kernels.obstacle_crossings import first_crossings, speed_bound
from flocking.engine.kernels.obstacle_distances import Indices, Level
from flocking.model.checks import Array

SAMPLES = 17
"""Places of a step at which the distance to an obstacle other than a ball is looked at for its extremum: twice the
parts that resolve a polynomial of degree 7, and the ends."""

ZOOMS = 12
"""Number of times the extremum is sought anew between the neighbours of the best place, 8 times closer each: to 2^-36
of the step, where a distance differs from its extremum by less than its rounding."""

DIFFERENCED = 0.05
"""Part of a step over which the second derivative of a distance is a difference: the rounding of a distance, 2e-16 of
the size, makes an error of 1e-13 of the size over the squared step."""


def agent_slack(q_floor: float, level: float, radius: float) -> float:
    """How far an agent must pass a ``level`` of an obstacle to have crossed it; for native functions too.

    Parameters
    ----------
    q_floor
        What rounding adds to a position: a known share of the largest coordinate.
    radius
        The largest radius of the balls of the level; 0 of other obstacles.
    """
    return level_slack(q_floor / ROUNDING, level, radius)


def recorded(links: LinkState, number: int, j: int) -> tuple[int, int]:
    """Graph or group of obstacles of a watch, and agent or obstacle ``j``, by their numbers in records.

    Parameters
    ----------
    links
        The watches and the obstacles.
    number
        Number of the watch.
    """
    graph = links.watches[number].graph
    group = graph - len(links.graphs)
    return (graph, j) if group < 0 else (group, links.contacts.groups[group].numbers[j])


class ObstacleStep:
    """Distances of agents from obstacles on one step.

    Parameters
    ----------
    links
        Which agents are within which distances, and the obstacles.
    segment
        The step, in the session's own time.
    B
        Bernstein coefficients of the positions, shape (8, N, m).
    """

    def __init__(self, links: LinkState, segment: Segment, B: Array) -> None:
        self._links, self._B = links, B
        self._t0, self._length = segment.t0 + links.base, segment.t1 - segment.t0
        self._t1 = segment.t1 + links.base

    def level(self, number: int) -> Level:
        """The distance of the watch ``number``."""
        return self._links.contacts.levels[number - self._links.first_level]

    def radius(self, number: int) -> float:
        """The largest radius of the balls of the watch ``number``; 0 of other obstacles."""
        contacts, group = self._links.contacts, self.level(number).group
        return largest_radius(contacts.radii(group)) if contacts.are_balls(group) else 0.0

    def within(self, bounds: Array, q_floor: float) -> Iterator[tuple[int, int, int, float, float, float, bool]]:
        """Agents that come within their error of a distance at which they would cross it.

        Parameters
        ----------
        bounds
            Errors of the positions, shape (N,).
        q_floor
            What rounding adds to a position.

        Returns
        -------
        iterator
            Number of the watch, the agent, the obstacle, where on the step it is nearest to crossing, how near, its
            error, and whether it is within the error at the end.
        """
        links, contacts, B = self._links, self._links.contacts, self._B
        excursion = np.sqrt(((B - B[0]) ** 2).sum(axis=2).max(axis=0))
        active, known = links.active(), {}
        for k, level in enumerate(contacts.levels):
            if not level.jumps:
                continue
            number, group = links.first_level + k, level.group
            if group not in known:
                moved = np.array([speed_bound(x, self._t0, self._t1) for x in contacts.groups[group].obstacles])
                known[group] = contacts.distances(group, B[0], self._t0), self._length * moved
            clear, moved = known[group]
            reach = bounds + agent_slack(q_floor, level.distance, self.radius(number))
            candidates = np.abs(clear - level.distance) <= (excursion + reach)[:, None] + moved
            if level.kind == "rim":
                candidates &= active[group]
            for i, o in zip(*(x.tolist() for x in np.nonzero(candidates)), strict=True):
                inside, error = bool(links.near[number][i, o]), float(reach[i])
                margin, x = self.nearest(number, i, o, inside, 0.0)
                if margin <= error:
                    end = self._clearance(number, i, o, np.ones(1))[0] - level.distance
                    yield number, i, o, x, margin, error, bool((-end if inside else end) <= error)

    def _ball(self, number: int, i: int, o: int) -> tuple[Array, float] | None:
        """Paths of a ball and of an agent, shape (8, 2, m), and the radius; None for other obstacles."""
        contacts, group = self._links.contacts, self.level(number).group
        if not contacts.are_balls(group):
            return None
        ball = contacts.groups[group].obstacles[o]
        centre = centre_paths([ball], self._t0, self._t1)  # type: ignore[list-item]
        return np.ascontiguousarray(np.stack([centre[:, 0], self._B[:, i]], axis=1)), float(contacts.radii(group)[o])

    def _clearance(self, number: int, i: int, o: int, x: Array) -> Array:
        """Distances of an agent from an obstacle at places ``x`` of the step."""
        points = np.empty((len(x), self._B.shape[2]))
        for k, place in enumerate(x.tolist()):
            work = self._B[:, i].copy()
            for a in range(len(work) - 1, 0, -1):
                work[:a] += place * (work[1 : a + 1] - work[:a])
            points[k] = work[0]
        times, which = self._t0 + self._length * x, np.full(len(x), o)
        return self._links.contacts.clearance(self.level(number).group, points, times, which)

    def first_past(self, number: int, i: int, o: int, distance: float, *, outward: bool) -> float:
        """First place at which an agent is further from an obstacle than a ``distance``, or closer; or `NEVER`.

        Parameters
        ----------
        number, i, o
            Numbers of the watch, the agent and the obstacle.
        outward
            Whether it is to be further.
        """
        ball = self._ball(number, i, o)
        if ball is not None:
            paths, radius = ball
            return float(first_beyond(paths, 0, 1, radius + distance, outward))
        contacts, group, sign = self._links.contacts, self.level(number).group, 1.0 if outward else -1.0

        def above(points: Array, x: Array, which: Indices) -> Array:
            times = self._t0 + self._length * x
            found = contacts.clearance(group, points, times, np.full(len(points), o))
            return np.asarray(sign * (found - distance))

        moved = self._length * speed_bound(contacts.groups[group].obstacles[o], self._t0, self._t1)
        path = np.ascontiguousarray(self._B[:, i][None])
        return float(first_crossings(above, path, np.array([moved]))[0])

    def nearest(self, number: int, i: int, o: int, inside: bool, after: float) -> tuple[float, float]:
        """How near an agent comes to crossing the distance of a watch after the place ``after``, and where.

        Parameters
        ----------
        number, i, o
            Numbers of the watch, the agent and the obstacle.
        inside
            Whether it counts as closer.
        """
        level, ball = self.level(number).distance, self._ball(number, i, o)
        if ball is not None:
            paths, radius = ball
            margin, x = closest_after(paths, 0, 1, radius + level, inside, after)
            return float(margin), float(x)
        sign, low, high = (-1.0 if inside else 1.0), after, 1.0
        margin, place = np.inf, NEVER
        for _ in range(ZOOMS):
            places = np.linspace(low, high, SAMPLES)
            values = sign * (self._clearance(number, i, o, places) - level)
            best = int(np.argmin(values))
            if values[best] < margin:
                margin, place = float(values[best]), float(places[best])
            low, high = float(places[max(best - 1, 0)]), float(places[min(best + 1, SAMPLES - 1)])
        return margin, place

    def acceleration(self, number: int, i: int, o: int) -> float:
        """Second derivative of the distance of an agent from an obstacle at the end of the step.

        Parameters
        ----------
        number, i, o
            Numbers of the watch, the agent and the obstacle.
        """
        if not self._length > 0.0:
            return 0.0
        before, middle, last = self._clearance(number, i, o, 1.0 - DIFFERENCED * np.array([2.0, 1.0, 0.0]))
        return float(before - 2.0 * middle + last) / (DIFFERENCED * self._length) ** 2
