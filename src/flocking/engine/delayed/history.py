"""The past of a group as polynomials: what was before the start is a straight line."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from copy import copy
from math import comb

import numpy as np

from flocking.arrays import Array
from flocking.engine.adaptive_steps.integration_method import DEGREE
from flocking.engine.adaptive_steps.segment import Segment
from flocking.engine.imperfect.taylor_series import shifted

BINOMIALS = np.array([comb(DEGREE, k) for k in range(DEGREE + 1)], dtype=np.float64)
POWERS = np.arange(DEGREE + 1)


class History:
    """States of a group until now, as far back as a delay reads them.

    Parameters
    ----------
    q, p
        Positions and velocities at the start, shape (N, m); the velocities of agents of order 1 are not read.
    order
        Order of the agents.

    Attributes
    ----------
    start
        Positions and velocities at the start, shape (N, 2 m); velocities of order 1 are 0.
    segments
        The steps, without gaps between them; their times are seconds from the start.
    """

    def __init__(self, q: Array, p: Array, order: int) -> None:
        self.n, self.m = q.shape
        self.order = order
        self.start = np.concatenate([q, p if order == 2 else np.zeros_like(q)], axis=1, dtype=np.float64)
        self.segments: list[Segment] = []
        self._ends: list[float] = []

    def copy(self) -> History:
        """An independent copy; the steps themselves are shared, for they do not change."""
        other = copy(self)
        other.segments, other._ends = list(self.segments), list(self._ends)
        return other

    def add(self, segment: Segment, keep_from: float) -> None:
        """Add a step, and drop those that end before a time.

        Parameters
        ----------
        segment
            The step, which begins where the last one ends.
        keep_from
            The earliest time that is read from now on.
        """
        self.segments.append(segment)
        self._ends.append(segment.t1)
        self.drop(keep_from)

    def drop(self, keep_from: float) -> None:
        """Drop the steps that end before a time.

        Parameters
        ----------
        keep_from
            The earliest time that is read from now on.
        """
        old = bisect_left(self._ends, keep_from)
        del self.segments[:old], self._ends[:old]

    def end_at(self, seconds: float) -> None:
        """Let the past end at a time in its last step.

        Parameters
        ----------
        seconds
            The time, since the start.
        """
        if not self.segments:
            return
        last = self.segments.pop()
        self._ends.pop()
        if last.t0 < seconds:
            self.segments.append(last.until(seconds))
            self._ends.append(seconds)

    def steps_beside(self, seconds: float) -> tuple[int, int]:
        """Numbers of the step that ends at a time, -1 for the line before the start, and of the next one.

        Parameters
        ----------
        seconds
            A time at which one ends, since the start.
        """
        return (bisect_left(self._ends, seconds) if seconds > 0.0 else -1), bisect_right(self._ends, seconds)

    def at(self, seconds: float, first: int = -1, last: int | None = None) -> Array:
        """Positions and velocities at ``seconds`` since the start, shape (N, 2 m); velocities of order 1 are 0.

        Parameters
        ----------
        first, last
            Numbers of the steps that may be read, -1 for the line before the start; the last of all when absent. A
            time beyond these is one but for rounding.
        """
        count = len(self.segments)
        k = -1 if seconds <= 0.0 else min(bisect_left(self._ends, seconds), count - 1)
        k = min(max(k, first), count - 1 if last is None else last)
        if k < 0:
            found = self.start.copy()
            found[:, : self.m] += seconds * found[:, self.m :]
            return found
        segment = self.segments[k]
        x = (seconds - segment.t0) / (segment.t1 - segment.t0)
        y = (BINOMIALS * x**POWERS * (1.0 - x) ** (DEGREE - POWERS)) @ segment.coefficients
        return split_state(y[: self.order * self.n * self.m], self.n, self.m)

    def pieces(
        self, begin: float, end: float, first: int = -1, last: int | None = None, *, velocities: bool = False
    ) -> list[tuple[float, float, Array]]:
        """The motion from ``begin`` to ``end`` seconds, piece by piece: begin, end and Taylor coefficients about begin.

        Coefficients are of positions, shape (8, N, m).

        Parameters
        ----------
        first, last
            As for `at`.
        velocities
            Whether they are of velocities instead, of agents of order 2.
        """
        found, place = [], self.n * self.m if velocities else 0
        if begin < 0.0 and first < 0:
            line = np.zeros((DEGREE + 1, self.n, self.m))
            line[0] = self.start[:, : self.m] + begin * self.start[:, self.m :]
            line[1] = self.start[:, self.m :]
            if velocities:
                line[0], line[1] = line[1], 0.0
            found.append((begin, min(end, 0.0), line))
        stop = len(self.segments) if last is None else last + 1
        for k in range(max(bisect_left(self._ends, begin), first), stop):
            segment = self.segments[k]
            if segment.t0 >= end:
                break
            since, until = max(segment.t0, begin), min(segment.t1, end)
            if since < until:
                found.append((since, until, position_series(segment, self.n, self.m, since, place)))
        return found


def split_state(y: Array, n: int, m: int) -> Array:
    """Positions and velocities in a state vector ``y``, shape (n, 2 m); velocities of agents of order 1 are 0.

    Parameters
    ----------
    n, m
        Number of agents and of axes.
    """
    found = np.zeros((n, 2 * m))
    for k, part in enumerate(y.reshape(-1, n, m)):
        found[:, k * m : (k + 1) * m] = part
    return found


def position_series(segment: Segment, n: int, m: int, about: float, first: int = 0) -> Array:
    """Taylor coefficients of the positions of ``n`` agents in ``m`` dimensions on a step, shape (8, n, m).

    Parameters
    ----------
    segment
        The step.
    about
        Time about which they are.
    first
        Where another column of as many numbers begins in state vectors, for that one.
    """
    return shifted(segment.series(first + n * m)[:, first:].reshape(DEGREE + 1, n, m), about - segment.t0)
