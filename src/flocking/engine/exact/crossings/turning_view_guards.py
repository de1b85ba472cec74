"""Crossings of fields of view whose headings turn with the agents, on one step: all columns are of degree 7.

As `flocking.engine.exact.crossings.view_guards`, with a heading h that is a polynomial, too: L = d.h has degree 14, and
Q = L^2 - c^2 |d|^2 |h|^2 degree 28, where a column of the bodies has |h| = 1. The other polynomials are raised to that
degree. Velocities are scaled by a bound on their size on the step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import comb

import numpy as np
from numpy.typing import NDArray

from flocking.engine.adaptive_steps.segment import ROUNDING, Motion, Segment
from flocking.engine.exact.crossings.guards import _PRODUCT, places_and_pairs, squared_distance
from flocking.engine.exact.crossings.switch_numbers import DIFFERENCED
from flocking.engine.exact.crossings.view_guards import Bearing, ViewGuard, border_speed, of_pair, stays_beyond
from flocking.engine.imperfect.view_switches import view_border, view_change
from flocking.engine.kernels.bernstein import NEVER, add_row, all_rows, part_from
from flocking.formula.native.functions import native
from flocking.model.checks import Array
from flocking.model.graphs.connectivity import Links
from flocking.model.graphs.views import ALL_AROUND

SQUARE = 15
"""Coefficients of a product of two polynomials of degree 7."""

TERMS = 2 * SQUARE - 1
"""Coefficients of a product of two such products."""

_RAISED = np.array([[comb(14, a) * comb(14, b) / comb(28, a + b) for b in range(SQUARE)] for a in range(SQUARE)])


@dataclass(frozen=True, eq=False)
class TurningView(ViewGuard):
    """Fields of view along a column of the bodies, or along the velocities.

    Parameters
    ----------
    first
        Place of the column in state vectors.
    n, m
        Number of agents and of axes.
    cosines
        Cosine of the half angle of each agent, shape (N,).
    unit
        Whether the vectors of the column have length 1; velocities have not.
    """

    first: int
    n: int
    m: int
    cosines: Array
    unit: bool = True

    def directions(self, segment: Segment, agents: slice = slice(None)) -> tuple[Array, Array, Array]:
        """How ``agents`` look on a ``segment``: headings, squares of their lengths, and cosines of the half angles.

        Bernstein coefficients of shape (agents, 8, m) and (agents, 15), and shape (agents,). An agent whose velocity is
        zero on all of the segment looks all around.
        """
        H, cosines = self._headings(segment)[agents], self.cosines[agents]
        if self.unit:
            return H, np.ones((len(H), SQUARE)), cosines
        most = _largest(H)
        rests = most == 0.0
        H = H / np.where(rests, 1.0, most)[:, None, None]
        return H, np.where(rests[:, None], 1.0, _squares(H)), np.where(rests, ALL_AROUND, cosines)

    def crossings(
        self, segment: Segment, motion: Motion, near: Links, radii: Array, slack: float
    ) -> tuple[Array, NDArray[np.int64]]:
        """As `ViewGuard.crossings`."""
        given = motion.positions, *self.directions(segment), motion.far, near, radii, slack
        return places_and_pairs(all_rows(lambda found: int(_turning_crossings(*given, found)), 3))

    def place(
        self, segment: Segment, B: Array, pair: tuple[int, int], radius: float, near: bool, slack: float, after: float
    ) -> float:
        """As `ViewGuard.place`."""
        i, j = pair
        headings, lengths, cosines = self.directions(segment, slice(i, i + 1))
        look = headings[0], lengths[0], float(cosines[0])
        return float(_turning_place(B, i, j, *look, radius, near, slack, after))

    def bearing(self, segment: Segment, pair: tuple[int, int], apart: Array, e: Array, errors: Array) -> Bearing:
        """As `ViewGuard.bearing`."""
        i, m = pair[0], self.m
        begin, end, cosine = segment.t0, segment.t1, float(self.cosines[i])
        own = slice(self.first + i * m, self.first + (i + 1) * m)
        both = Segment(begin, end, np.concatenate([apart, segment.coefficients[:, own]], axis=1))
        most = 1.0 if self.unit else float(_largest(self._headings(segment)[i : i + 1])[0])
        if most == 0.0:
            return Bearing(np.inf, 0.0, 0.0, 0.0, 0.0, 1.0)
        rates, gradient, turning, inside = [], np.zeros_like(e), np.zeros_like(e), 0.0
        for t in (end - DIFFERENCED * (end - begin), end):
            y, slope = both.with_slope(t)
            d, heading, slope = y[:m], y[m:] / most, slope / np.repeat([1.0, most], m)
            size = 1.0 if self.unit else float(np.linalg.norm(heading))
            inside, gradient = view_border(d, heading, cosine * size)
            # The gradient of g by h: a direction keeps its length.
            along = cosine * float(np.linalg.norm(d)) * heading / size if size > 0.0 and not self.unit else 0.0
            turning = d - along
            rates.append(float(gradient @ slope[:m] + turning @ slope[m:]))
        bend = (rates[1] - rates[0]) / (DIFFERENCED * (end - begin))
        off = float(gradient @ e + turning @ errors[own] / most)
        return Bearing(
            inside, float(np.linalg.norm(gradient)), rates[1], bend, off, 1.0 if self.unit else 1.0 + abs(cosine)
        )

    def border_speed(self, pair: tuple[int, int], y: Array, slope: Array) -> tuple[float, float, float]:
        """As `ViewGuard.border_speed`."""
        i, m = pair[0], self.m
        d, v = (of_pair(x, pair, m) for x in (y, slope))
        heading, turning = (x[self.first + i * m : self.first + (i + 1) * m] for x in (y, slope))
        if not self.unit:
            size = float(np.linalg.norm(heading))
            if size == 0.0:
                return np.inf, 0.0, 0.0
            heading = heading / size
            turning = (turning - (turning @ heading) * heading) / size
        return border_speed(d, v, heading, turning, float(self.cosines[i]))

    def heading_errors(self, segment: Segment, of_column: Callable[[int, int], Array]) -> Array:
        """As `ViewGuard.heading_errors`; velocities are scaled as in the polynomials, by a bound on their size."""
        errors = of_column(self.first, self.m)
        if self.unit:
            return errors + ROUNDING
        most = _largest(self._headings(segment))
        # An agent that rests on the whole step looks all around, whatever rounding makes of its velocity.
        return np.divide(errors, most, out=np.zeros_like(errors), where=most > 0.0) + ROUNDING

    def _headings(self, segment: Segment) -> Array:
        """Bernstein coefficients of the column on a step, shape (N, 8, m)."""
        C = segment.coefficients[:, self.first : self.first + self.n * self.m]
        return np.ascontiguousarray(C.reshape(len(C), self.n, self.m).swapaxes(0, 1))


def _largest(H: Array) -> Array:
    """Bounds on the lengths of vectors on a step, shape (N,), from their Bernstein coefficients, shape (N, 8, m)."""
    return np.asarray(np.sqrt((H**2).sum(axis=2)).max(axis=1))


def _squares(H: Array) -> Array:
    """Bernstein coefficients of squared lengths, shape (N, 15), from those of vectors, shape (N, 8, m)."""
    found = np.zeros((len(H), SQUARE))
    for a in range(H.shape[1]):
        for b in range(H.shape[1]):
            found[:, a + b] += _PRODUCT[a, b] * (H[:, a] * H[:, b]).sum(axis=1)
    return found


def _turning_polynomials(B: Array, H: Array, lengths: Array, i: int, j: int, c: float, out: Array) -> None:
    """Bernstein coefficients of |d|^2, L and Q, shape (3, 29).

    ``H`` are those of the heading of agent i, shape (8, m), and ``lengths`` of its square, shape (15,).
    """
    square, ahead = np.empty(SQUARE), np.zeros(SQUARE)
    squared_distance(B, i, j, square)
    for a in range(8):
        for b in range(8):
            dot = 0.0
            for k in range(B.shape[2]):
                dot += (B[a, j, k] - B[a, i, k]) * H[b, k]
            ahead[a + b] += _PRODUCT[a, b] * dot
    for b in range(TERMS):
        out[0, b], out[1, b], out[2, b] = 0.0, 0.0, 0.0
    for a in range(SQUARE):
        for b in range(SQUARE):
            out[0, a + b] += _RAISED[a, b] * square[a]
            out[1, a + b] += _RAISED[a, b] * ahead[a]
            out[2, a + b] += _RAISED[a, b] * (ahead[a] * ahead[b] - c * c * square[a] * lengths[b])


@native
def _turning_place(
    B: Array, i: int, j: int, H: Array, lengths: Array, cosine: float, radius: float, near: bool, slack: float,
    after: float,
) -> float:  # fmt: skip
    """As `view_place`, with what `TurningView.directions` gives of agent ``i``."""
    out = np.empty((3, TERMS))
    _turning_polynomials(B, H, lengths, i, j, cosine, out)
    square, ahead, product = part_from(out[0], after), part_from(out[1], after), part_from(out[2], after)
    x = view_change(near, square, ahead, product, cosine, radius, radius, slack)
    return float(after + x * (1.0 - after) if x <= 1.0 else NEVER)


@native
def _turning_crossings(
    B: Array, H: Array, lengths: Array, cosines: Array, far: Array, near: Links, radii: Array, slack: float,
    found: Array,
) -> int:  # fmt: skip
    n = B.shape[1]
    count = 0
    out = np.empty((3, TERMS))
    for i in range(n):
        for j in range(n):
            if i == j:
                continue
            if not near[i, j] and stays_beyond(B, far, i, j, radii[i] + slack):
                continue
            _turning_polynomials(B, H[i], lengths[i], i, j, cosines[i], out)
            x = view_change(near[i, j], out[0], out[1], out[2], cosines[i], radii[i], radii[i], slack)
            if x <= 1.0:
                count = add_row(found, count, x, i, j)
    return count
