"""One step of the exact engine as a polynomial in time, in Bernstein form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import comb

import numpy as np

from flocking.model.checks import Array

DEGREE = 7
"""Degree of DOP853's dense output."""

_NODES = 0.5 - 0.5 * np.cos(np.pi * np.arange(DEGREE + 1) / DEGREE)


def bernstein_basis(x: Array) -> Array:
    """Values of the Bernstein polynomials of degree 7 at ``x``, shape (len(x), 8)."""
    k = np.arange(DEGREE + 1)
    binomials = np.array([comb(DEGREE, int(j)) for j in k], dtype=np.float64)
    return np.asarray(binomials * x[:, None] ** k * (1.0 - x[:, None]) ** (DEGREE - k))


_TO_BERNSTEIN = np.linalg.inv(bernstein_basis(_NODES))


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
    def from_dense_output(cls, t0: float, t1: float, y0: Array, y1: Array, dense: Callable[[Array], Array]) -> Segment:
        """Convert a dense output, a function from times (k,) to states (size, k)."""
        values = dense(t0 + (t1 - t0) * _NODES).T
        coefficients = y0 + _TO_BERNSTEIN @ (values - y0)
        coefficients[0], coefficients[-1] = y0, y1
        return cls(t0, t1, coefficients)

    def at(self, t: float) -> Array:
        """State vector at time ``t``."""
        if t == self.t1:
            return np.array(self.coefficients[-1])
        x = (t - self.t0) / (self.t1 - self.t0) if self.t1 > self.t0 else 0.0
        start = self.coefficients[0]
        return np.asarray(start + bernstein_basis(np.array([x]))[0] @ (self.coefficients - start))

    def until(self, t: float) -> Segment:
        """The part of the segment on [t0, t]."""
        if t == self.t1:
            return self
        x = (t - self.t0) / (self.t1 - self.t0) if self.t1 > self.t0 else 0.0
        left = np.empty_like(self.coefficients)
        work = self.coefficients.copy()
        for k in range(DEGREE + 1):
            left[k] = work[0]
            work = work[:-1] + x * (work[1:] - work[:-1])
        left[-1] = self.at(t)
        return Segment(self.t0, t, left)
