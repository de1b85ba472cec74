"""One step as a polynomial in time, in Bernstein form."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import comb
from typing import NamedTuple

import numpy as np

from flocking.engine.adaptive_steps.integration_method import DEGREE, TO_BERNSTEIN
from flocking.formula.native.functions import native_apart
from flocking.model.checks import Array

BOUND_ROUNDING = 1e-14
"""Relative margin of the bounds on displacements, more than the rounding of a root of a sum of a few squares."""

ROUNDING = 16 * float(np.finfo(float).eps)
"""Error of a position and a velocity from rounding, relative to the largest of the group."""


def _part(coefficients: Array, x: float) -> Array:
    left = np.empty(coefficients.shape)
    fill_part(coefficients, x, left)
    return left


@native_apart
def fill_part(coefficients: Array, x: float, left: Array) -> None:
    """Coefficients of the first fraction ``x`` of a segment (de Casteljau); the last row is its end.

    Parameters
    ----------
    coefficients
        Those of the segment, shape (8, size).
    left
        The result, of the same shape.
    """
    work = np.empty(DEGREE + 1)
    # How many steps there are is known to the compiler: it writes them out, and takes several components at a time.
    for c in range(coefficients.shape[1]):
        for k in range(DEGREE + 1):
            work[k] = coefficients[k, c]
        for k in range(DEGREE + 1):
            left[k, c] = work[0]
            for a in range(DEGREE - k):
                work[a] += x * (work[a + 1] - work[a])


def weights_at(places: Sequence[float]) -> Array:
    """Weights of the Bernstein coefficients in the values at some places in [0, 1], shape (places, 8)."""
    return np.array([[comb(DEGREE, k) * x**k * (1 - x) ** (DEGREE - k) for k in range(DEGREE + 1)] for x in places])


def powers_at(places: Sequence[float]) -> Array:
    """Weights of DOP853's powers in the change since the start at some places in [0, 1], shape (places, 7)."""
    return np.asarray(weights_at(places) @ TO_BERNSTEIN)


class Motion(NamedTuple):
    """Motion of the agents on a segment.

    Parameters
    ----------
    positions
        Bernstein coefficients of the positions, shape (8, N, m).
    velocities
        Those of the velocities, shape (8, N, m); agents of order 1 have none, shape (8, 0, m).
    far
        Bound on the displacement of each agent from its start, relative to the group's mean, shape (N,).
    size
        Largest absolute coefficient of a position.
    """

    positions: Array
    velocities: Array
    far: Array
    size: float


@native_apart
def split_motion(coefficients: Array, B: Array, P: Array, far: Array) -> float:
    """Fill the fields of a `Motion` from the coefficients of a segment, and return its size.

    Parameters
    ----------
    coefficients
        Those of the state vector, shape (8, size).
    B, P, far
        Results: the positions, the velocities and the bounds.
    """
    count, n, m = B.shape[0], B.shape[1], B.shape[2]
    for a in range(count):
        for i in range(n):
            for k in range(m):
                B[a, i, k] = coefficients[a, i * m + k]
        for i in range(P.shape[1]):
            for k in range(m):
                P[a, i, k] = coefficients[a, (n + i) * m + k]
    bound_excursions(B, far)
    return largest_entry(coefficients, 0, n * m)


def largest_entry(rows: Array, first: int, last: int) -> float:
    """Largest absolute value in the columns ``first`` to ``last - 1`` of ``rows``, but NaN; for native functions."""
    columns, found = np.zeros(last - first), 0.0
    # Column by column, so that the loop runs over vectors.
    for a in range(rows.shape[0]):
        for c in range(last - first):
            columns[c] = max(columns[c], abs(rows[a, first + c]))
    for c in range(last - first):
        found = max(found, columns[c])
    return found


def bound_excursions(B: Array, far: Array) -> None:
    """Fill the bounds ``far`` on displacements, shape (N,), see `Motion`; for native functions."""
    n, m = B.shape[1], B.shape[2]
    mean = np.empty(m)
    for i in range(n):
        far[i] = 0.0
    for a in range(1, B.shape[0]):
        for k in range(m):
            total = 0.0
            for i in range(n):
                total += B[a, i, k] - B[0, i, k]
            mean[k] = total / n
        for i in range(n):
            square = 0.0
            for k in range(m):
                square += (B[a, i, k] - B[0, i, k] - mean[k]) ** 2
            far[i] = max(far[i], square)
    for i in range(n):
        far[i] = np.sqrt(far[i]) * (1.0 + BOUND_ROUNDING)


@dataclass(frozen=True, eq=False)
class Segment:
    """The solution on [t0, t1] as a polynomial of degree 7.

    Parameters
    ----------
    t0, t1
        The interval.
    coefficients
        Bernstein coefficients of the state vector, shape (8, size): the solution stays in their convex hull.
    """

    t0: float
    t1: float
    coefficients: Array
    _motion: dict[tuple[int, int, int], Motion] = field(default_factory=dict, init=False, repr=False)

    @classmethod
    def resting(cls, t: float, y: Array) -> Segment:
        """The segment of no length at ``y``."""
        return cls(t, t, np.repeat(y[None], DEGREE + 1, axis=0))

    def motion(self, n: int, m: int, order: int) -> Motion:
        """Motion of the agents on it, computed once; ``order`` is that of the agents: order 1 has no velocities."""
        found = self._motion.get((n, m, order))
        if found is None:
            B, P, far = np.empty((DEGREE + 1, n, m)), np.empty((DEGREE + 1, n * (order - 1), m)), np.empty(n)
            size = split_motion(self.coefficients, B, P, far)
            found = self._motion[n, m, order] = Motion(B, P, far, size)
            for array in (B, P, far):
                array.flags.writeable = False
        return found

    def at(self, t: float) -> Array:
        """State vector at time ``t``."""
        if t == self.t1:
            return np.array(self.coefficients[-1])
        x = (t - self.t0) / (self.t1 - self.t0) if self.t1 > self.t0 else 0.0
        return np.asarray(_part(self.coefficients, x)[-1])

    def with_slope(self, t: float) -> tuple[Array, Array]:
        """State vector and its derivative at time ``t`` of a segment that has a length."""
        span = self.t1 - self.t0
        x = (t - self.t0) / span
        left = _part(self.coefficients, x)
        if x > 0.0:
            return left[-1], DEGREE / (x * span) * (left[-1] - left[-2])
        return left[-1], DEGREE / span * (self.coefficients[1] - self.coefficients[0])

    def series(self, count: int) -> Array:
        """Taylor coefficients of the first ``count`` components about ``t0``, shape (8, count)."""
        differences, span = self.coefficients[:, :count], self.t1 - self.t0
        found = np.zeros(differences.shape)
        found[0] = differences[0]
        if span > 0.0:
            for k in range(1, DEGREE + 1):
                differences = np.diff(differences, axis=0)
                found[k] = comb(DEGREE, k) * differences[0] / span**k
        return found

    def cut(self, x: float) -> Segment:
        """The first fraction ``x`` of the segment. Its end is at ``x`` exactly; only its time is rounded."""
        return Segment(self.t0, self.t0 + x * (self.t1 - self.t0), _part(self.coefficients, x))

    def until(self, t: float) -> Segment:
        """The part of the segment on [t0, t]."""
        if t >= self.t1:
            return self
        return Segment(self.t0, t, _part(self.coefficients, (t - self.t0) / (self.t1 - self.t0)))
