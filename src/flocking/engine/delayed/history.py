"""The past of a group as polynomials: what was before the start is a straight line."""

from __future__ import annotations

from bisect import bisect_left
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
        old = bisect_left(self._ends, keep_from)
        del self.segments[:old], self._ends[:old]

    def at(self, seconds: float) -> Array:
        """Positions and velocities at ``seconds`` since the start, shape (N, 2 m); velocities of order 1 are 0."""
        if seconds <= 0.0 or not self.segments:
            found = self.start.copy()
            found[:, : self.m] += seconds * found[:, self.m :]
            return found
        segment = self.segments[min(bisect_left(self._ends, seconds), len(self.segments) - 1)]
        x = (seconds - segment.t0) / (segment.t1 - segment.t0)
        y = (BINOMIALS * x**POWERS * (1.0 - x) ** (DEGREE - POWERS)) @ segment.coefficients
        return split_state(y[: self.order * self.n * self.m], self.n, self.m)

    def pieces(self, begin: float, end: float) -> list[tuple[float, float, Array]]:
        """The motion from ``begin`` to ``end`` seconds, piece by piece: begin, end and Taylor coefficients about begin.

        Coefficients are of positions, shape (8, N, m).
        """
        found = []
        if begin < 0.0:
            line = np.zeros((DEGREE + 1, self.n, self.m))
            line[0] = self.start[:, : self.m] + begin * self.start[:, self.m :]
            line[1] = self.start[:, self.m :]
            found.append((begin, min(end, 0.0), line))
        for k in range(bisect_left(self._ends, begin), len(self.segments)):
            segment = self.segments[k]
            if segment.t0 >= end:
                break
            first, last = max(segment.t0, begin), min(segment.t1, end)
            if first < last:
                found.append((first, last, position_series(segment, self.n, self.m, first)))
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


def position_series(segment: Segment, n: int, m: int, about: float) -> Array:
    """Taylor coefficients of the positions of ``n`` agents in ``m`` dimensions on a step, shape (8, n, m).

    Parameters
    ----------
    segment
        The step.
    about
        Time about which they are.
    """
    return shifted(segment.series(n * m).reshape(DEGREE + 1, n, m), about - segment.t0)
