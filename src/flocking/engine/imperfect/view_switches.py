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
from flocking.engine.imperfect.pair_switches import radial_speed
from flocking.engine.kernels.bernstein import first_all_above, part_from

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
