"""Certified crossings of the distances from balls that stand still or move uniformly.

The squared distance of an agent from such a ball's centre is a polynomial on a segment, like that of two agents: no
excursion can be missed, however short. `obstacle_contacts` treats other obstacles.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flocking.engine.adaptive_steps.segment import BOUND_ROUNDING, ROUNDING
from flocking.engine.exact.crossings.guards import _PRODUCT, on_border, places_and_pairs
from flocking.engine.kernels.bernstein import NEVER, add_row, all_rows, first_above
from flocking.formula.native.functions import native_apart
from flocking.model.checks import Array
from flocking.model.graphs.connectivity import Links
from flocking.model.leaders_and_obstacles.leaders import Leader, Sink, Velocity
from flocking.model.leaders_and_obstacles.obstacles import Ball
from flocking.model.terms.avoidance import ObstacleGroup

ROUNDED = 1e-13
"""Slack of a distance whose coordinates are exact: above the rounding of a distance, some units of 2.2e-16."""


SHORTEST_USUAL, LONGEST_USUAL = 1e-2, 1e4
"""Lengths in a world of usual units, in which distances below 1 count as 1; in others they count as they are."""


def level_slack(size: float, level: float, radius: float) -> float:
    """Distance beyond a level of an obstacle at which an agent has crossed it; for native functions too.

    Parameters
    ----------
    size
        The largest coordinate.
    level
        Distance from the obstacle.
    radius
        The radius of a ball, from which that distance is measured; 0 of another obstacle.
    """
    largest = max(size, level, radius)
    if SHORTEST_USUAL <= largest <= LONGEST_USUAL:
        return (ROUNDED + ROUNDING * size) * max(level, 1.0)
    return ROUNDED * max(level, radius) + ROUNDING * largest


def largest_radius(radii: Array) -> float:
    """The largest of some radii, 0 of none; for native functions too."""
    found = 0.0
    for k in range(radii.shape[0]):
        found = max(found, radii[k])
    return found


def uniform_balls(group: ObstacleGroup) -> bool:
    """Whether all obstacles of a group are balls that stand still or move uniformly."""
    # Subclasses may move otherwise.
    return all(type(x) is Ball and type(x.centre) in (Sink, Velocity) for x in group.obstacles)


def centre_paths(balls: Sequence[Ball], t0: float, t1: float) -> Array:
    """Bernstein coefficients of the centres on [t0, t1], shape (8, K, m).

    Parameters
    ----------
    balls
        K balls whose centres rest or move on straight lines, in m dimensions.
    t0, t1
        Ends of the step.
    """
    begin = np.array([_place(b.centre, t0) for b in balls])
    if all(type(b.centre) is Sink for b in balls):
        return np.repeat(begin[None], 8, axis=0)
    end = np.array([_place(b.centre, t1) for b in balls])
    share = np.linspace(0.0, 1.0, 8)[:, None, None]
    return np.asarray(begin + share * (end - begin))


def _place(centre: Leader, t: float) -> Array:
    return centre.point if type(centre) is Sink else centre.at(t)[0]


def ball_crossings(
    B: Array, centres: Array, radii: Array, near: Links, active: Links, level: float, slack: float
) -> tuple[Array, NDArray[np.int64]]:
    """First crossing of one level by every pair (agent, ball) that crosses it.

    Parameters
    ----------
    B
        Bernstein coefficients of the positions, shape (8, N, m).
    centres
        Those of the centres, shape (8, K, m).
    radii
        Radii of the balls, shape (K,).
    near
        Pairs that are within the level now, shape (N, K). They cross by leaving, the others by entering.
    active
        Pairs that are watched, shape (N, K).
    level
        Distance from the surface.
    slack
        Overshoot that counts as a crossing.

    Returns
    -------
    tuple of Array
        Positions in [0, 1], shape (k,), and pairs (agent, ball), shape (k, 2).
    """
    given = B, centres, radii, near, active, level, slack
    return places_and_pairs(all_rows(lambda found: int(find_ball_crossings(*given, found)), 3))


@native_apart
def find_ball_crossings(
    B: Array, centres: Array, radii: Array, near: Links, active: Links, level: float, slack: float, found: Array
) -> int:
    """Fill the rows (place, agent, ball) of `ball_crossings`, as many as fit; returns their total number.

    Parameters
    ----------
    B, centres, radii, near, active, level, slack
        As for `ball_crossings`.
    found
        The rows, shape (room, 3).
    """
    n, m = B.shape[1], B.shape[2]
    count = 0
    relative = np.empty((8, m))
    square = np.empty(15)
    for i in range(n):
        for o in range(centres.shape[1]):
            if not active[i, o]:
                continue
            border = radii[o] + level + (slack if near[i, o] else -slack)
            first = 0.0
            excursion = 0.0
            for a in range(8):
                apart2 = 0.0
                for k in range(m):
                    relative[a, k] = B[a, i, k] - centres[a, o, k]
                    apart2 += (relative[a, k] - relative[0, k]) ** 2
                    if a == 0:
                        first += relative[0, k] ** 2
                excursion = max(excursion, apart2)
            first, excursion = np.sqrt(first), np.sqrt(excursion) * (1.0 + BOUND_ROUNDING)
            if near[i, o]:
                if first + excursion < border:
                    continue
            elif border <= 0.0 or first - excursion > border:
                continue
            for a in range(15):
                square[a] = 0.0
            for a in range(8):
                for b in range(8):
                    dot = 0.0
                    for k in range(m):
                        dot += relative[a, k] * relative[b, k]
                    square[a + b] += _PRODUCT[a, b] * dot
            edge = max(border, 0.0) ** 2
            for k in range(15):
                square[k] = square[k] - edge if near[i, o] else edge - square[k]
            x = first_above(square)
            if x < NEVER and border > 0.0:
                x = on_border(relative, square, border, x, 1.0 if near[i, o] else -1.0)
            if x < NEVER:
                count = add_row(found, count, x, i, o)
    return count
