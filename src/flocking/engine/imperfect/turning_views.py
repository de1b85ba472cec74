"""Fields of view that turn: along velocities or columns of the bodies that are polynomials in time, as positions are.

As `flocking.engine.imperfect.view_switches`, with a heading h of any length: L = d.h and Q = L^2 - c^2 |d|^2 |h|^2. An
overshoot s in distance changes L by s |h|, and Q by s |d| |h|^2. A stretch on which |h| changes much, or |d| where the
other one comes near, is therefore cut; headings of each part are scaled by a bound on their length there, and |d| has a
bound of its own. So a border is not passed later than elsewhere where an agent turns back, begins to move or meets
another one, but for the last part around that moment, `NARROWEST_PART` of the stretch.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flocking.arrays import Array, Indices, Links
from flocking.engine.imperfect.pair_polynomials import (
    ROUNDING,
    Paths,
    conversion,
    nearest_offset,
    reach_within,
)
from flocking.engine.imperfect.pair_switches import TwoPaths, radial_speed
from flocking.engine.imperfect.view_switches import (
    Looking,
    View,
    ViewPart,
    ViewPolynomials,
    add_changes_of_part,
    crosses_radius,
    view_border,
)
from flocking.engine.kernels.bernstein import all_rows, halve_interval
from flocking.formula.native.functions import native_apart
from flocking.model.graphs.views import ALL_AROUND

EVEN = 1.0 / 16.0
"""Smallest over largest squared length, of a heading and of a distance, on a part that is not cut again."""

NARROWEST_PART = 2.0**-40
"""Length of a part that is not cut again, as a share of the stretch: around a moment of rest or of a meeting."""

DEPTH = 64
"""Parts that are open at once: each cut needs one more."""

MOST_CHANGES = 70
"""Changes of one pair within one part: roots of polynomials of degree 18, 17 and 34 or less."""

ROUNDED_TURN = 1e-14
"""Share of the rate of a heading below which what is across it is rounding: some units of 2.2e-16."""


class TurningView(NamedTuple):
    """The fields of view of one graph along a column of the bodies, or along velocities.

    Parameters
    ----------
    column
        Its name, see `flocking.model.graphs.views.HeadingGraph.heading_column`.
    cosines, radii
        Cosine of the half angle and radius of each agent, shape (N,).
    """

    column: str
    cosines: Array
    radii: Array

    @property
    def mutual(self) -> bool:
        """Whether both agents of a pair see each other: they need not."""
        return False

    def of(self, agents: Indices) -> TurningView:
        """Those of some ``agents`` alone, each as often as it is named."""
        return TurningView(self.column, self.cosines[agents], self.radii[agents])

    def looking(self, headings: Array) -> View:
        """The fields of view at a moment.

        Parameters
        ----------
        headings
            Vectors along which agents look, of any length, shape (N, m); one without a length looks all around.
        """
        lengths = np.sqrt((headings**2).sum(axis=1))
        rests = lengths == 0.0
        directions = headings / np.where(rests, 1.0, lengths)[:, None]
        return View(np.ascontiguousarray(directions), np.where(rests, ALL_AROUND, self.cosines), self.radii)

    def along(self, headings: Array) -> MovingView:
        """The same from a moment on, by Taylor coefficients of the ``headings`` about it, shape (terms, N, m)."""
        return MovingView(np.ascontiguousarray(headings.swapaxes(0, 1)), self.cosines, self.radii)


class MovingView(NamedTuple):
    """Fields of view from a moment on.

    Parameters
    ----------
    headings
        Taylor coefficients of the vectors along which agents look, about that moment, shape (N, terms, m).
    cosines, radii
        As of `TurningView`.
    """

    headings: Array
    cosines: Array
    radii: Array

    def border_speed(self, agent: int, d: Array, w: Array) -> tuple[float, float]:
        """How fast another one leaves the view of an ``agent`` now, negative when it comes in, and its relative speed.

        The turn of the agent counts in both. Where it is at rest no side has a speed: it is that of the distance.

        Parameters
        ----------
        d, w
            Its position and velocity relative to the agent, shape (m,), where it crosses a side or the radius.
        """
        heading = self.headings[agent, 0]
        turning = self.headings[agent, 1] if self.headings.shape[1] > 1 else np.zeros_like(heading)
        cosine, distance = float(self.cosines[agent]), float(np.sqrt(d @ d))
        length = float(np.sqrt(heading @ heading))
        if length == 0.0 or distance == 0.0:
            return radial_speed(d.tolist(), w.tolist())
        ahead = heading / length
        inside, gradient = view_border(d, ahead, cosine)
        if crosses_radius(float(self.radii[agent]), distance, inside):
            return radial_speed(d.tolist(), w.tolist())
        across = turning - (turning @ ahead) * ahead
        if float(np.sqrt(across @ across)) <= ROUNDED_TURN * float(np.sqrt(turning @ turning)):
            across = np.zeros_like(across)
        turn = across / length
        return -float(gradient @ w + d @ turn), float(np.sqrt(w @ w)) + distance * float(np.sqrt(turn @ turn))

    def events(self, paths: Paths, length: Array, changed: Links, near: Links, size: float) -> Array:
        """Rows (time, i, j) of all changes of what agents see until the motion of either one changes, in order of time.

        Parameters
        ----------
        paths, length, changed, near, size
            As for `flocking.engine.imperfect.constant_views.find_view_events`.
        """
        given = turning_paths(paths, self.headings.shape[1]), length, changed, near, *self, size
        rows = all_rows(lambda found: int(find_turning_events(*given, found)), 3)
        return rows[np.lexsort(rows.T[::-1])]


def turning_paths(paths: Paths, terms: int) -> Paths:
    """The same ``paths`` with the table for products with headings of so many ``terms``."""
    return paths._replace(table=conversion(paths.S.shape[0] + terms - 2))


def _taylor_part(C: Array, begin: float, length: float, found: Array) -> None:
    """Power coefficients on [0, 1] of the part of a ``length`` from ``begin`` on of polynomials ``C``, (terms, m)."""
    terms, scale = C.shape[0], 1.0
    for a in range(terms):
        for k in range(C.shape[1]):
            found[a, k] = C[a, k]
    for a in range(terms):
        # Horner's rule for the derivatives, one division of the polynomial after the other.
        for b in range(terms - 2, a - 1, -1):
            for k in range(C.shape[1]):
                found[b, k] += begin * found[b + 1, k]
    for a in range(terms):
        for k in range(C.shape[1]):
            found[a, k] *= scale
        scale *= length


def _dot(one: Array, other: Array, found: Array) -> None:
    """Power coefficients of the product of two vectors of polynomials, of (terms, m) each, with zeros behind them."""
    for a in range(found.shape[0]):
        found[a] = 0.0
    for a in range(one.shape[0]):
        for b in range(other.shape[0]):
            for k in range(one.shape[1]):
                found[a + b] += one[a, k] * other[b, k]


def _bernstein(table: Array, power: Array, found: Array) -> None:
    """Bernstein coefficients on [0, 1] of a polynomial with ``power`` coefficients there."""
    for a in range(power.shape[0]):
        found[a] = 0.0
        for b in range(a + 1):
            found[a] += table[a, b] * power[b]


def add_turning_changes(
    paths: Paths, two: TwoPaths, look: Looking, near: bool, heading: Array, found: Array, total: int
) -> int:
    """Add rows (time, s, o) of all changes of whether an agent has another one in view; how many rows there are.

    Parameters
    ----------
    paths
        What `turning_paths` gives: how agents move from now on, in open space.
    two, look, near
        As for `flocking.engine.imperfect.constant_views.add_view_changes`.
    heading
        Taylor coefficients of the vector along which it looks, about now, shape (terms, m).
    found, total
        Takes the rows, shape (room, 3 or more), and how many there are before.
    """
    i, j, span, slack = two.i, two.j, two.span, look.slack
    if not near and two.distance - two.reach > look.radius + 2.0 * slack:
        return total
    S, table = paths.S, paths.table
    degree, m, terms = S.shape[0] - 1, S.shape[2], table.shape[0]
    apart, d, h = np.empty((degree + 1, m)), np.empty((degree + 1, m)), np.empty((heading.shape[0], m))
    for a in range(degree + 1):
        for k in range(m):
            apart[a, k] = S[a, j, k] - S[a, i, k]
    square, ahead, lengths, product = np.empty(terms), np.empty(terms), np.empty(terms), np.empty(terms)
    D, L, Q, steep = np.empty(terms), np.empty(terms), np.empty(terms), np.empty(terms)
    begin, width, top = np.empty(DEPTH), np.empty(DEPTH), 0
    begin[0], width[0] = 0.0, 1.0
    seen = near
    while top >= 0:
        _taylor_part(heading, begin[top] * span, width[top] * span, h)
        _taylor_part(apart, begin[top] * span, width[top] * span, d)
        _dot(h, h, lengths)
        _dot(d, d, square)
        _bernstein(table, lengths, steep)
        _bernstein(table, square, D)
        least, most, nearest, far = steep[0], steep[0], D[0], D[0]
        for a in range(terms):
            least, most = min(least, steep[a]), max(most, steep[a])
            nearest, far = min(nearest, D[a]), max(far, D[a])
        far = min(far, look.radius * look.radius)
        around = look.cosine == ALL_AROUND or not most > 0.0
        uneven = least < EVEN * most or nearest < EVEN * far
        if not around and uneven and width[top] > NARROWEST_PART and top + 2 < DEPTH:
            halve_interval(begin, width, top)
            top += 1
            continue
        cosine = ALL_AROUND if around else look.cosine
        if around:
            for a in range(terms):
                L[a], Q[a] = look.radius, 0.0
        else:
            scale = 1.0 / np.sqrt(most)
            for a in range(heading.shape[0]):
                for k in range(m):
                    h[a, k] *= scale
            _dot(d, h, ahead)
            _dot(h, h, lengths)
            for a in range(terms):
                product[a] = 0.0
            for a in range(terms):
                for b in range(terms - a):
                    product[a + b] += ahead[a] * ahead[b] - look.cosine * look.cosine * square[a] * lengths[b]
            _bernstein(table, ahead, L)
            _bernstein(table, product, Q)
        polynomials = ViewPolynomials(D, L, Q, np.sqrt(far), MOST_CHANGES)
        looking = Looking(look.s, look.o, look.radius, cosine, slack)
        part = ViewPart(begin[top], width[top], span)
        seen, total = add_changes_of_part(polynomials, looking, part, seen, found, total)
        top -= 1
    return total


@native_apart
def find_turning_events(
    paths: Paths, length: Array, changed: Links, near: Links, headings: Array, cosines: Array, radii: Array,
    size: float, found: Array,
) -> int:  # fmt: skip
    """Fill rows (time, i, j) of all changes of whether agent i has agent j in view until the motion of either changes.

    Parameters
    ----------
    paths
        What `turning_paths` gives.
    length, changed, near
        As for `flocking.engine.imperfect.constant_views.find_view_events`.
    headings, cosines, radii
        See `MovingView`.
    size
        Size of the coordinates, for rounding.
    found
        Takes the rows, shape (room, 3).

    Returns
    -------
    int
        How many rows there are, those included for which there was no room.
    """
    n, nearest, total = paths.S.shape[1], np.empty(paths.S.shape[2]), 0
    for i in range(n):
        slack = ROUNDING * (radii[i] + size)
        for j in range(n):
            if i == j or not (changed[i] or changed[j]):
                continue
            span = min(length[i], length[j])
            distance, reach = nearest_offset(paths, i, j, nearest), reach_within(paths, i, j, span)
            two, look = TwoPaths(i, j, span, distance, reach), Looking(i, j, radii[i], cosines[i], slack)
            total = add_turning_changes(paths, two, look, near[i, j], headings[i], found, total)
    return total
