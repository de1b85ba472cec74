"""Crossings of fields of view along constant headings on one step of degree 7: distance and bearing at once.

See `flocking.engine.imperfect.view_switches` for the polynomials, and
`flocking.engine.exact.crossings.turning_view_guards` for headings that turn with the bodies.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from flocking.engine.adaptive_steps.segment import Motion, Segment
from flocking.engine.exact.crossings.guards import _PRODUCT, places_and_pairs, squared_distance
from flocking.engine.exact.crossings.switch_numbers import DIFFERENCED
from flocking.engine.imperfect.view_switches import view_border, view_change
from flocking.engine.kernels.bernstein import NEVER, add_row, all_rows, part_from
from flocking.formula.native.functions import native
from flocking.model.checks import Array
from flocking.model.graphs.connectivity import Links


class Bearing(NamedTuple):
    """How an agent stands to the border of a field of view, where g = d.h - c |d| |h| is zero; |h| is 1 at most.

    Parameters
    ----------
    inside
        The value of g: how far it is inside.
    steep
        Size of the gradient of g in positions.
    rate, bend
        First and second derivative of g in time.
    off
        Difference of g by the error of the solution.
    turned
        By how much an error of the heading changes g, as a share of |d|.
    """

    inside: float
    steep: float
    rate: float
    bend: float
    off: float
    turned: float


class ViewGuard(Protocol):
    """How agents look under one graph along a solution."""

    def crossings(
        self, segment: Segment, motion: Motion, near: Links, radii: Array, slack: float
    ) -> tuple[Array, NDArray[np.int64]]:
        """First change of every ordered pair on a step.

        Parameters
        ----------
        segment, motion
            The step, and the motion of the agents on it.
        near, radii, slack
            As for `view_crossings`.

        Returns
        -------
        tuple
            Places in [0, 1], shape (k,), and ordered pairs, shape (k, 2).
        """

    def place(
        self, segment: Segment, B: Array, pair: tuple[int, int], radius: float, near: bool, slack: float, after: float
    ) -> float:
        """First place after ``after`` at which another agent comes into view or leaves it, or `NEVER`.

        Parameters
        ----------
        segment, B
            The step, and the Bernstein coefficients of the positions on it, shape (8, N, m).
        pair
            The agent that looks, and the other one.
        radius, near, slack
            As for `view_place`.
        """

    def bearing(self, segment: Segment, pair: tuple[int, int], apart: Array, e: Array, errors: Array) -> Bearing:
        """How an agent stands to the border of the view of another one at the end of a step.

        Parameters
        ----------
        segment, pair
            The step, the agent that looks, and the other one.
        apart
            Bernstein coefficients of the difference of their positions, shape (8, m).
        e
            Difference of the errors of their positions, shape (m,).
        errors
            Error of the state vector, shape (size,).
        """

    def border_speed(self, pair: tuple[int, int], y: Array, slope: Array) -> tuple[float, float, float]:
        """How far agent j is inside the border of the view of agent i by its bearing, how fast it comes further in, and
        the size of the motions that this is the sum of.

        Parameters
        ----------
        pair
            The agent that looks, and the other one.
        y, slope
            State vector and its rate of change.
        """

    def heading_errors(self, segment: Segment, of_column: Callable[[int, int], Array]) -> Array:
        """Bounds on the errors of the headings of all agents, lengths of vectors, shape (N,).

        Parameters
        ----------
        segment
            The step.
        of_column
            Bounds on the errors of a column, shape (N,), from its first place in state vectors and its width.
        """


@dataclass(frozen=True, eq=False)
class ConstantView(ViewGuard):
    """Fields of view along constant headings.

    Parameters
    ----------
    directions
        Unit vectors, shape (N, m).
    cosines
        Cosine of the half angle of each agent, shape (N,).
    """

    directions: Array
    cosines: Array

    def crossings(
        self, segment: Segment, motion: Motion, near: Links, radii: Array, slack: float
    ) -> tuple[Array, NDArray[np.int64]]:
        """As `ViewGuard.crossings`."""
        return view_crossings(motion.positions, motion.far, near, self.directions, self.cosines, radii, slack)

    def place(
        self, segment: Segment, B: Array, pair: tuple[int, int], radius: float, near: bool, slack: float, after: float
    ) -> float:
        """As `ViewGuard.place`."""
        i, j = pair
        return float(view_place(B, i, j, self.directions[i], self.cosines[i], radius, near, slack, after))

    def bearing(self, segment: Segment, pair: tuple[int, int], apart: Array, e: Array, errors: Array) -> Bearing:
        """As `ViewGuard.bearing`."""
        i = pair[0]
        return bearing_motion(apart, segment.t0, segment.t1, e, self.directions[i], float(self.cosines[i]))

    def border_speed(self, pair: tuple[int, int], y: Array, slope: Array) -> tuple[float, float, float]:
        """As `ViewGuard.border_speed`."""
        i, m = pair[0], self.directions.shape[1]
        d, v = (of_pair(x, pair, m) for x in (y, slope))
        return border_speed(d, v, self.directions[i], np.zeros(m), float(self.cosines[i]))

    def heading_errors(self, segment: Segment, of_column: Callable[[int, int], Array]) -> Array:
        """Zeros: the headings are given."""
        return np.zeros(len(self.directions))


def border_speed(d: Array, v: Array, heading: Array, turning: Array, cosine: float) -> tuple[float, float, float]:
    """How far an agent is inside the border of a view, how fast it comes further in, and the size of its motion.

    Parameters
    ----------
    d, v
        Its position and velocity relative to the agent that looks, shape (m,).
    heading, turning
        The unit vector along which that one looks, and its rate of change, shape (m,).
    cosine
        Cosine of the half angle.
    """
    inside, gradient = view_border(d, heading, cosine)
    size = float(np.linalg.norm(v)) + float(np.linalg.norm(d)) * float(np.linalg.norm(turning))
    return inside, float(gradient @ v + d @ turning), size


def of_pair(y: Array, pair: tuple[int, int], m: int) -> Array:
    """Difference of the first ``m`` numbers of the agents of a ``pair`` in a state vector ``y``, shape (m,)."""
    i, j = pair
    return np.asarray(y[j * m : (j + 1) * m] - y[i * m : (i + 1) * m])


def _polynomials(B: Array, i: int, j: int, heading: Array, c: float, out: Array) -> None:
    """Bernstein coefficients of |d|^2, L and Q, shape (3, 15)."""
    squared_distance(B, i, j, out[0])
    for b in range(15):
        out[1, b], out[2, b] = 0.0, 0.0
    ahead = np.zeros(8)
    for a in range(8):
        for k in range(B.shape[2]):
            ahead[a] += (B[a, j, k] - B[a, i, k]) * heading[k]
    for a in range(8):
        for b in range(8):
            out[1, a + b] += _PRODUCT[a, b] * ahead[a]
            out[2, a + b] += _PRODUCT[a, b] * ahead[a] * ahead[b]
    for a in range(15):
        out[2, a] -= c * c * out[0, a]


def view_crossings(
    B: Array, far: Array, near: Links, headings: Array, cosines: Array, radii: Array, slack: float
) -> tuple[Array, NDArray[np.int64]]:
    """First change of every ordered pair that is seen or lost on the segment.

    Parameters
    ----------
    B
        Bernstein coefficients of the positions, shape (8, N, m).
    far
        See `flocking.engine.adaptive_steps.segment.Motion`.
    near
        Matrix (N, N): pairs that are seen now.
    cosines, radii
        Cosine of the half angle and radius of each sensing agent, shape (N,).
    slack
        Overshoot in distance that counts as a crossing; covers rounding.

    Returns
    -------
    tuple
        Crossing positions in [0, 1], shape (k,), and ordered pairs, shape (k, 2).
    """
    given = B, far, near, headings, cosines, radii, slack
    return places_and_pairs(all_rows(lambda found: int(_view_crossings(*given, found)), 3))


@native
def view_place(
    B: Array, i: int, j: int, heading: Array, cosine: float, radius: float, near: bool, slack: float, after: float
) -> float:
    """First place after ``after`` at which a seen agent is lost or an unseen one is seen, or `NEVER`.

    Parameters
    ----------
    B
        Bernstein coefficients of the positions, shape (8, N, m).
    heading, cosine, radius
        Where agent ``i`` looks, shape (m,), the cosine of its half angle and its radius.
    near
        Whether it counts as seen.
    slack
        Overshoot in distance that counts as a change; a negative one asks how near it comes to that.
    """
    out = np.empty((3, 15))
    _polynomials(B, i, j, heading, cosine, out)
    square, ahead, product = part_from(out[0], after), part_from(out[1], after), part_from(out[2], after)
    x = view_change(near, square, ahead, product, cosine, radius, radius, slack)
    return float(after + x * (1.0 - after) if x <= 1.0 else NEVER)


def bearing_motion(apart: Array, begin: float, end: float, e: Array, heading: Array, cosine: float) -> Bearing:
    """How an agent stands to the border of a view along a constant heading at the end of a step.

    Parameters
    ----------
    apart
        Bernstein coefficients of the difference of their positions d, shape (8, m).
    begin, end
        Times of the step.
    e
        Difference of the errors of their positions, shape (m,).
    heading, cosine
        Where the first looks, shape (m,), and the cosine of its half angle.
    """
    segment, rates, gradient, inside = Segment(begin, end, apart), [], np.zeros_like(e), 0.0
    for t in (end - DIFFERENCED * (end - begin), end):
        d, v = segment.with_slope(t)
        inside, gradient = view_border(d, heading, cosine)
        rates.append(float(gradient @ v))
    bend = (rates[1] - rates[0]) / (DIFFERENCED * (end - begin))
    return Bearing(inside, float(np.linalg.norm(gradient)), rates[1], bend, float(gradient @ e), 1.0)


def stays_beyond(B: Array, far: Array, i: int, j: int, distance: float) -> bool:
    """Whether two agents are farther apart than a ``distance`` on all of a step; for native functions.

    Parameters
    ----------
    B, far
        As for `view_crossings`.
    """
    d2 = 0.0
    for k in range(B.shape[2]):
        d2 += (B[0, j, k] - B[0, i, k]) ** 2
    return bool(d2 > (distance + far[i] + far[j]) ** 2)


@native
def _view_crossings(
    B: Array, far: Array, near: Links, headings: Array, cosines: Array, radii: Array, slack: float, found: Array
) -> int:
    n = B.shape[1]
    count = 0
    out = np.empty((3, 15))
    for i in range(n):
        for j in range(n):
            if i == j:
                continue
            if not near[i, j] and stays_beyond(B, far, i, j, radii[i] + slack):
                continue
            _polynomials(B, i, j, headings[i], cosines[i], out)
            x = view_change(near[i, j], out[0], out[1], out[2], cosines[i], radii[i], radii[i], slack)
            if x <= 1.0:
                count = add_row(found, count, x, i, j)
    return count
