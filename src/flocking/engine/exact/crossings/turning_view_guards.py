"""Crossings of fields of view whose headings turn with the bodies, on one step: all columns are of degree 7.

As `flocking.engine.exact.crossings.view_guards`, with a heading h that is a polynomial, too: L = d.h has degree 14, and
Q = L^2 - c^2 |d|^2 degree 28. The other polynomials are raised to that degree.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from math import comb

import numpy as np
from numpy.typing import NDArray

from flocking.engine.adaptive_steps.segment import Motion, Segment
from flocking.engine.exact.crossings.guards import _PRODUCT, places_and_pairs, squared_distance
from flocking.engine.exact.crossings.switch_numbers import DIFFERENCED
from flocking.engine.exact.crossings.view_guards import Bearing, ViewGuard
from flocking.engine.imperfect.view_switches import view_change
from flocking.engine.kernels.bernstein import NEVER, add_row, all_rows, part_from
from flocking.formula.native.functions import native
from flocking.model.checks import Array
from flocking.model.graphs.connectivity import Links

SQUARE = 15
"""Coefficients of a product of two polynomials of degree 7."""

TERMS = 2 * SQUARE - 1
"""Coefficients of a product of two such products."""

_RAISED = np.array([[comb(14, a) * comb(14, b) / comb(28, a + b) for b in range(SQUARE)] for a in range(SQUARE)])


@dataclass(frozen=True, eq=False)
class TurningView(ViewGuard):
    """Fields of view along a column of the bodies.

    Parameters
    ----------
    first
        Place of the column in state vectors.
    n, m
        Number of agents and of axes.
    cosines
        Cosine of the half angle of each agent, shape (N,).
    """

    first: int
    n: int
    m: int
    cosines: Array

    def directions(self, segment: Segment) -> Array:
        """Bernstein coefficients of the headings on a ``segment``, shape (8, N, m)."""
        C = segment.coefficients
        return np.ascontiguousarray(C[:, self.first : self.first + self.n * self.m]).reshape(len(C), self.n, self.m)

    def crossings(
        self, segment: Segment, motion: Motion, near: Links, radii: Array, slack: float
    ) -> tuple[Array, NDArray[np.int64]]:
        """As `ViewGuard.crossings`."""
        given = motion.positions, self.directions(segment), motion.far, near, self.cosines, radii, slack
        return places_and_pairs(all_rows(lambda found: int(_turning_crossings(*given, found)), 3))

    def place(
        self, segment: Segment, B: Array, pair: tuple[int, int], radius: float, near: bool, slack: float, after: float
    ) -> float:
        """As `ViewGuard.place`."""
        i, j = pair
        look = self.directions(segment), self.cosines[i], radius
        return float(_turning_place(B, i, j, *look, near, slack, after))

    def bearing(self, segment: Segment, pair: tuple[int, int], apart: Array, e: Array, errors: Array) -> Bearing:
        """As `ViewGuard.bearing`."""
        i, m = pair[0], self.m
        begin, end, cosine = segment.t0, segment.t1, float(self.cosines[i])
        own = slice(self.first + i * m, self.first + (i + 1) * m)
        both = Segment(begin, end, np.concatenate([apart, segment.coefficients[:, own]], axis=1))
        rates, gradient, y = [], np.zeros_like(e), both.coefficients[-1]
        for t in (end - DIFFERENCED * (end - begin), end):
            y, slope = both.with_slope(t)
            r = float(np.linalg.norm(y[:m]))
            gradient = y[m:] - (cosine * y[:m] / r if r > 0.0 else 0.0)
            rates.append(float(gradient @ slope[:m] + y[:m] @ slope[m:]))
        inside = float(y[:m] @ y[m:]) - cosine * float(np.linalg.norm(y[:m]))
        bend = (rates[1] - rates[0]) / (DIFFERENCED * (end - begin))
        off = float(gradient @ e + y[:m] @ errors[own])
        return Bearing(inside, float(np.linalg.norm(gradient)), rates[1], bend, off)

    def heading_error(self, of_column: Callable[[int, int, int], float], agents: Iterable[int]) -> float:
        """As `ViewGuard.heading_error`."""
        return max((of_column(self.first, self.m, i) for i in agents), default=0.0)


def _turning_polynomials(B: Array, H: Array, i: int, j: int, c: float, out: Array) -> None:
    """Bernstein coefficients of |d|^2, L and Q, shape (3, 29); ``H`` of the headings, as ``B`` of the positions."""
    square, ahead = np.empty(SQUARE), np.zeros(SQUARE)
    squared_distance(B, i, j, square)
    for a in range(8):
        for b in range(8):
            dot = 0.0
            for k in range(B.shape[2]):
                dot += (B[a, j, k] - B[a, i, k]) * H[b, i, k]
            ahead[a + b] += _PRODUCT[a, b] * dot
    for b in range(TERMS):
        out[0, b], out[1, b], out[2, b] = 0.0, 0.0, 0.0
    for a in range(SQUARE):
        for b in range(SQUARE):
            out[0, a + b] += _RAISED[a, b] * square[a]
            out[1, a + b] += _RAISED[a, b] * ahead[a]
            out[2, a + b] += _RAISED[a, b] * ahead[a] * ahead[b]
    for b in range(TERMS):
        out[2, b] -= c * c * out[0, b]


@native
def _turning_place(
    B: Array, i: int, j: int, H: Array, cosine: float, radius: float, near: bool, slack: float, after: float
) -> float:
    """As `view_place`, with Bernstein coefficients ``H`` of the headings, shape (8, N, m)."""
    out = np.empty((3, TERMS))
    _turning_polynomials(B, H, i, j, cosine, out)
    square, ahead, product = part_from(out[0], after), part_from(out[1], after), part_from(out[2], after)
    x = view_change(near, square, ahead, product, cosine, radius, slack)
    return float(after + x * (1.0 - after) if x <= 1.0 else NEVER)


@native
def _turning_crossings(
    B: Array, H: Array, far: Array, near: Links, cosines: Array, radii: Array, slack: float, found: Array
) -> int:
    n = B.shape[1]
    count = 0
    out = np.empty((3, TERMS))
    for i in range(n):
        for j in range(n):
            if i == j:
                continue
            if not near[i, j]:
                d2 = 0.0
                for k in range(B.shape[2]):
                    d2 += (B[0, j, k] - B[0, i, k]) ** 2
                if d2 > (radii[i] + far[i] + far[j] + slack) ** 2:
                    continue
            _turning_polynomials(B, H, i, j, cosines[i], out)
            x = view_change(near[i, j], out[0], out[1], out[2], cosines[i], radii[i], slack)
            if x <= 1.0:
                count = add_row(found, count, x, i, j)
    return count
