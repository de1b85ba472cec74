"""Every time at which an agent comes into the field of view of another one, or leaves it, on polynomials in time.

With d = q_j - q_i, heading h, radius r and c the cosine of the half angle, j is seen when D = r^2 - |d|^2 >= 0 and
d.h >= c |d|. With L = d.h and Q = L^2 - c^2 |d|^2 the second is (L >= 0 and Q >= 0) for c >= 0, and
(L >= 0 or Q <= 0) for c < 0: first moments of being seen or lost are first moments at which some of these
polynomials are all positive.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flocking.arrays import Array, Indices, Links
from flocking.engine.imperfect.pair_polynomials import (
    ROUNDING,
    Paths,
    nearest_offset,
    reach_within,
    squared_distance,
)
from flocking.engine.imperfect.pair_switches import TwoPaths, radial_speed
from flocking.engine.kernels.bernstein import all_rows, first_all_above, part_from
from flocking.formula.native.functions import native_apart

ROUNDED_SQUARE = 2e-15
"""Rounding of Q relative to its largest coefficient, some units of 2.2e-16."""

MOST_CHANGES = 60
"""Changes of one pair within one piece: each is a root of one of three polynomials of degree 18 or less."""


class View(NamedTuple):
    """The fields of view of one graph.

    Parameters
    ----------
    directions
        Unit vectors in which agents look, shape (N, m).
    cosines, radii
        Cosine of the half angle and radius of each agent, shape (N,).
    """

    directions: Array
    cosines: Array
    radii: Array

    def seen(self, agents: Indices | slice, offset: Array) -> Links:
        """What ``agents`` see at each ``offset`` from them, shape (agents, others, m), as shape (agents, others)."""
        distance = np.sqrt((offset**2).sum(axis=-1))
        ahead = np.einsum("ijk,ik->ij", offset, self.directions[agents])
        within = distance <= self.radii[agents][:, None]
        return np.asarray(within & (ahead >= self.cosines[agents][:, None] * distance))

    def border_speed(self, agent: int, d: Array, w: Array) -> tuple[float, float]:
        """How fast another one leaves the view of an ``agent``, negative when it comes in, and its relative speed.

        Parameters
        ----------
        d, w
            Its position and velocity relative to the agent, shape (m,), where it crosses a side or the radius.
        """
        distance = float(np.sqrt(d @ d))
        inside, gradient = view_border(d, self.directions[agent], float(self.cosines[agent]))
        if distance == 0.0 or crosses_radius(float(self.radii[agent]), distance, inside):
            return radial_speed(d.tolist(), w.tolist())
        return -float(gradient @ w), float(np.sqrt(w @ w))

    @property
    def mutual(self) -> bool:
        """Whether both agents of a pair see each other: they need not."""
        return False

    def margins(self, i: Indices, j: Indices, offset: Array) -> Array:
        """How far ``j``, at each ``offset`` from agents ``i``, shape (k, m), are from the border; negative outside."""
        distance = np.sqrt((offset**2).sum(axis=-1))
        ahead = (offset * self.directions[i]).sum(axis=-1) - self.cosines[i] * distance
        return np.asarray(np.minimum(self.radii[i] - distance, ahead))


def view_border(d: Array, heading: Array, cosine: float) -> tuple[float, Array]:
    """How far another agent is inside the border of a view by its bearing, g = d.h - c |d|, and the gradient of g by d.

    Parameters
    ----------
    d
        Its position relative to the agent that looks, shape (m,).
    heading, cosine
        Where that one looks, shape (m,), and the cosine c of its half angle, times |h| where h is no unit vector.
    """
    r = float(np.linalg.norm(d))
    return float(d @ heading) - cosine * r, heading - (cosine * d / r if r > 0.0 else 0.0)


def crosses_radius(radius: float, distance: float, inside: float) -> bool:
    """Whether a pair at the border of a view is at its ``radius``: at least as near to that as to its sides.

    Parameters
    ----------
    distance, inside
        Distance of the pair, and how far it is inside the sides, see `view_border`.
    """
    return abs(radius - distance) <= abs(inside)


class Looking(NamedTuple):
    """How an agent looks at another one.

    Parameters
    ----------
    s, o
        The agent that looks, and the other one.
    radius, cosine
        Radius of its field of view, and the cosine of the half angle.
    slack
        Overshoot in distance that counts as a change; covers rounding.
    """

    s: int
    o: int
    radius: float
    cosine: float
    slack: float


def view_change(
    near: bool, square: Array, L: Array, Q: Array, c: float, radius: float, far: float, slack: float
) -> float:
    """First place in [0, 1] at which a seen agent is lost, or an unseen one is seen, or `NEVER`; for native functions.

    At the border L is c |d|, so that an overshoot s changes Q by 2 s |L| + 2 c^2 s |d|, with the sign of c before L for
    its absolute value, and |d| at most ``far``. A bound by that alone would let pass a border across the
    heading, where c is 0, by the root of s. There the sign of L decides alone: Q is a square. Where c is smaller than
    1e-6 and not 0 the rounding of Q lets a border pass by up to 1e-7 of that.

    Parameters
    ----------
    near
        Whether it is seen.
    square, L, Q
        Bernstein coefficients of |d|^2, L and Q.
    c, radius
        Cosine of the half angle, and the radius.
    far
        Bound on the distance of agents that are seen: the radius, or less.
    slack
        Overshoot in distance that counts as a change; covers rounding. A negative one asks how near it comes to that.
    """
    size, side = square.shape[0], 1.0 if c >= 0.0 else -1.0
    border = (radius + slack) ** 2 if near else max(radius - slack, 0.0) ** 2
    one, two, three = np.empty((1, size)), np.empty((2, size)), np.empty((3, size))
    largest = far * far
    for k in range(size):
        largest = max(largest, abs(Q[k]))
    wide = 2.0 * c * c * far * slack + (
        slack * slack + ROUNDED_SQUARE * largest if slack > 0.0 else -3.0 * slack * slack - ROUNDED_SQUARE * largest
    )
    across = abs(c) * far <= abs(slack)
    if near:
        for k in range(size):
            one[0, k] = square[k] - border
        first = first_all_above(one)
        for k in range(size):
            one[0, k] = -L[k] - slack
            two[0, k], two[1, k] = one[0, k], Q[k] - 2.0 * side * slack * L[k] - wide
        if across:
            return min(first, first_all_above(one))
        if c < 0.0:
            return min(first, first_all_above(two))
        first = min(first, first_all_above(one))
        for k in range(size):
            one[0, k] = -Q[k] - 2.0 * side * slack * L[k] - wide
        return min(first, first_all_above(one))
    for k in range(size):
        two[0, k], two[1, k] = border - square[k], L[k] - slack
        three[0, k], three[1, k] = two[0, k], two[1, k]
        three[2, k] = Q[k] - 2.0 * side * slack * L[k] - wide
    if across:
        return first_all_above(two)
    if c >= 0.0:
        return first_all_above(three)
    first = first_all_above(two)
    for k in range(size):
        two[1, k] = -Q[k] - 2.0 * side * slack * L[k] - wide
    return min(first, first_all_above(two))


class ViewPolynomials(NamedTuple):
    """Polynomials that decide on a part of a stretch whether an agent has another one in view, by `view_change`.

    Parameters
    ----------
    square, L, Q
        Their Bernstein coefficients on it.
    far
        Bound on the distance there, for the slack of ``Q``.
    most
        Changes of one pair that are looked for at most.
    """

    square: Array
    L: Array
    Q: Array
    far: float
    most: int


class ViewPart(NamedTuple):
    """A part of a stretch of the length ``span``: where it begins and how long it is, as shares of the stretch."""

    begin: float
    width: float
    span: float


def add_changes_of_part(
    polynomials: ViewPolynomials, look: Looking, part: ViewPart, seen: bool, found: Array, total: int
) -> tuple[bool, int]:
    """Add rows (time, s, o) of changes on one part; whether the other one is seen at its end, and the number of rows.

    Parameters
    ----------
    polynomials, look, part
        What decides, who looks how, and where the part lies.
    seen
        Whether the other one is in view as it begins.
    found, total
        Takes the rows, shape (room, 3 or more), and how many there are before.
    """
    square, L, Q, far, most = polynomials
    x, changes = 0.0, 0
    while x < 1.0 and changes < most:
        place = view_change(
            seen, part_from(square, x), part_from(L, x), part_from(Q, x), look.cosine, look.radius, far, look.slack
        )
        if place > 1.0:
            break
        x = x + place * (1.0 - x)
        seen = not seen
        if total < found.shape[0]:
            found[total, 0], found[total, 1], found[total, 2] = (
                (part.begin + x * part.width) * part.span,
                look.s,
                look.o,
            )
        total += 1
        changes += 1
    return seen, total


def add_view_changes(
    paths: Paths, two: TwoPaths, look: Looking, near: bool, direction: Array, found: Array, total: int
) -> int:
    """Add rows (time, s, o) of all changes of whether an agent has another one in view; how many rows there are.

    Parameters
    ----------
    paths, two
        How agents move from now on, in open space, and the paths that are looked at, first that of the one that looks.
    look
        How it looks.
    near
        Whether it has the other one in view now.
    direction
        Unit vector in which it looks, shape (m,).
    found, total
        Takes the rows, shape (room, 3 or more), and how many there are before.
    """
    i, j, span, slack = two.i, two.j, two.span, look.slack
    if not near and two.distance - two.reach > look.radius + 2.0 * slack:
        return total
    degree, m = paths.S.shape[0] - 1, paths.S.shape[2]
    terms = 2 * degree + 1
    square, L, Q, offset = np.empty(terms), np.empty(terms), np.empty(terms), np.empty(m)
    ahead, power, product = np.empty(degree + 1), np.empty(terms), np.empty(terms)
    for k in range(m):
        offset[k] = paths.S[0, j, k] - paths.S[0, i, k]
    squared_distance(paths, i, j, offset, span, square)
    scale = 1.0
    for a in range(degree + 1):
        ahead[a] = 0.0
        for k in range(m):
            ahead[a] += (paths.S[a, j, k] - paths.S[a, i, k]) * direction[k]
        ahead[a] *= scale
        scale *= span
    for a in range(terms):
        power[a], product[a] = ahead[a] if a <= degree else 0.0, 0.0
    for a in range(degree + 1):
        for b in range(degree + 1):
            product[a + b] += ahead[a] * ahead[b]
    for a in range(terms):
        L[a], Q[a] = 0.0, -look.cosine * look.cosine * square[a]
        for b in range(a + 1):
            L[a] += paths.table[a, b] * power[b]
            Q[a] += paths.table[a, b] * product[b]
    polynomials = ViewPolynomials(square, L, Q, look.radius, MOST_CHANGES)
    return add_changes_of_part(polynomials, look, ViewPart(0.0, 1.0, span), near, found, total)[1]


@native_apart
def find_view_events(
    paths: Paths, length: Array, changed: Links, near: Links, directions: Array, cosines: Array, radii: Array,
    size: float, found: Array,
) -> int:  # fmt: skip
    """Fill rows (time, i, j) of all changes of what agent i sees of agent j until the motion of either one changes.

    Parameters
    ----------
    paths
        How agents move from now on, in open space.
    length
        How long each agent's motion goes on from now, shape (N,).
    changed
        Whose motion begins now, shape (N,).
    near
        What is seen now, shape (N, N).
    directions, cosines, radii
        See `View`.
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
            total = add_view_changes(paths, two, look, near[i, j], directions[i], found, total)
    return total


def constant_view_events(paths: Paths, length: Array, changed: Links, near: Links, view: View, size: float) -> Array:
    """Rows (time, i, j) of all changes of what agents see, in order of time.

    Parameters
    ----------
    paths, length, changed, near, size
        As for `find_view_events`.
    view
        The fields of view.
    """
    given = paths, length, changed, near, *view, size
    rows = all_rows(lambda found: int(find_view_events(*given, found)), 3)
    return rows[np.lexsort(rows.T[::-1])]
