"""Every change of what agents see along constant headings, on polynomials in time.

See `flocking.engine.imperfect.view_switches`. Where a pair comes near, a slack for the radius would let a border pass
late: agents that go through one another change sides at a distance of zero. There the stretch is cut as
`flocking.engine.imperfect.turning_views` cuts it.
"""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array, Links
from flocking.engine.imperfect.pair_polynomials import (
    ROUNDING,
    Paths,
    nearest_offset,
    reach_within,
    squared_distance,
)
from flocking.engine.imperfect.pair_switches import TwoPaths
from flocking.engine.imperfect.turning_views import add_turning_changes
from flocking.engine.imperfect.view_switches import (
    MOST_CHANGES,
    Looking,
    View,
    ViewPart,
    ViewPolynomials,
    add_changes_of_part,
)
from flocking.engine.kernels.bernstein import all_rows
from flocking.formula.native.functions import native_apart
from flocking.model.graphs.views import ALL_AROUND

CLOSE = 0.01
"""Squared distance, as a share of the squared radius, below which a stretch is cut: at a tenth of the radius the slack
lets a border pass by up to five times as far as at the radius, nearer by the ratio of the two."""


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
    ahead, power, product, heading = np.empty(degree + 1), np.empty(terms), np.empty(terms), np.empty((1, m))
    for k in range(m):
        offset[k] = paths.S[0, j, k] - paths.S[0, i, k]
    squared_distance(paths, i, j, offset, span, square)
    nearest = square[0]
    for a in range(terms):
        nearest = min(nearest, square[a])
    if nearest < CLOSE * look.radius * look.radius and look.cosine != ALL_AROUND:
        for k in range(m):
            heading[0, k] = direction[k]
        return add_turning_changes(paths, two, look, near, heading, found, total)
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
