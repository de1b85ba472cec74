"""One step of the exact engine as a polynomial in time, in Bernstein form."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb
from weakref import WeakKeyDictionary

import numpy as np

from flocking.formula.native.functions import native
from flocking.model.checks import Array

DEGREE = 7
"""Degree of DOP853's dense output."""


def _part(coefficients: Array, x: float) -> Array:
    """Coefficients of the first fraction ``x`` of a segment; the last row is its end (de Casteljau)."""
    left = np.empty(coefficients.shape)
    _fill_part(coefficients, x, left)
    return left


@native
def _fill_part(coefficients: Array, x: float, left: Array) -> None:
    work = np.empty(coefficients.shape[0])
    for c in range(coefficients.shape[1]):
        for k in range(work.shape[0]):
            work[k] = coefficients[k, c]
        for k in range(work.shape[0]):
            left[k, c] = work[0]
            for a in range(work.shape[0] - 1 - k):
                work[a] += x * (work[a + 1] - work[a])


def _dense_to_bernstein() -> Array:
    """DOP853's dense output is y0 + sum over k of F[k] x^a (1 - x)^b: Bernstein coefficients of these, shape (8, 7)."""
    columns = np.zeros((DEGREE + 1, DEGREE))
    for power in range(DEGREE):
        a, b = power // 2 + 1, (power + 1) // 2
        rest = DEGREE - a - b
        for j in range(rest + 1):
            columns[a + j, power] = comb(rest, j) / comb(DEGREE, a + j)
    return columns


_TO_BERNSTEIN = _dense_to_bernstein()


def weights_at(places: Sequence[float]) -> Array:
    """Weights of the Bernstein coefficients in the values at some places in [0, 1], shape (places, 8)."""
    return np.array([[comb(DEGREE, k) * x**k * (1 - x) ** (DEGREE - k) for k in range(DEGREE + 1)] for x in places])


def powers_at(places: Sequence[float]) -> Array:
    """Weights of DOP853's powers in what is added to the start at some places in [0, 1], shape (places, 7)."""
    return np.asarray(weights_at(places) @ _TO_BERNSTEIN)


_parts: WeakKeyDictionary[Segment, dict[str, Array]] = WeakKeyDictionary()


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

    @classmethod
    def from_dense_output(cls, t0: float, t1: float, y0: Array, y1: Array, powers: Array) -> Segment:
        """Convert the dense output of a step from ``y0`` to ``y1``: SciPy's array F, shape (7, size).

        Parameters
        ----------
        t0, t1
            Ends of the step.
        powers
            SciPy's array F of the dense output, shape (7, size).
        """
        coefficients = y0 + _TO_BERNSTEIN @ powers
        coefficients[0], coefficients[-1] = y0, y1
        return cls(t0, t1, coefficients)

    @classmethod
    def resting(cls, t: float, y: Array) -> Segment:
        """The segment of no length at ``y``."""
        return cls(t, t, np.repeat(y[None], DEGREE + 1, axis=0))

    def positions(self, n: int, m: int) -> Array:
        """Bernstein coefficients of the positions, shape (8, N, m), contiguous: kernels are compiled for such alone."""
        return self._part_of("q", 0, n, m)

    def velocities(self, n: int, m: int) -> Array:
        """Those of the velocities of agents of order 2, shape (8, N, m), contiguous."""
        return self._part_of("p", n * m, n, m)

    def _part_of(self, name: str, first: int, n: int, m: int) -> Array:
        """Coefficients of N m components from ``first`` on; a step is asked for them many times."""
        known = _parts.setdefault(self, {})
        if name not in known:
            known[name] = np.ascontiguousarray(self.coefficients[:, first : first + n * m].reshape(-1, n, m))
            known[name].flags.writeable = False
        return known[name]

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

    def cut(self, x: float) -> Segment:
        """The first fraction ``x`` of the segment. Its end is at ``x`` exactly; only its time is rounded."""
        return Segment(self.t0, self.t0 + x * (self.t1 - self.t0), _part(self.coefficients, x))

    def until(self, t: float) -> Segment:
        """The part of the segment on [t0, t]."""
        if t >= self.t1:
            return self
        part = self.cut((t - self.t0) / (self.t1 - self.t0))
        return Segment(self.t0, t, part.coefficients)
