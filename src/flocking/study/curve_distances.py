"""The smallest distance of cubic curves from a convex body at rest, by halving them."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array
from flocking.model.leaders_and_obstacles.obstacles import Obstacle

ROUNDS = 40
"""Halvings of a curve at most: the bounds of a part fall by a factor of two to four in each."""

RESOLVED = 1e-13
"""Share of the largest coordinate to which the smallest distance is searched for: a hundred times the rounding of
places on a curve."""

MOST_PARTS = 2**15
"""Parts of curves that are looked at at once, and of which the nearest go on; what the others hide is in the error."""


def searched_curves(
    obstacle: Obstacle, t: float, points: Array, off: Array, nearest: float, lowest: float, tolerance: float
) -> tuple[float, float, float]:
    """The smallest distance on some curves, the smallest less what an agent may be off, and a bound of other parts.

    Parameters
    ----------
    obstacle
        The body, convex and at rest.
    t
        A time.
    points
        Control points of the curves, shape (K, 4, m).
    off
        By how much agents may be off their curves, shape (K,).
    nearest, lowest
        What was found on others.
    tolerance
        Parts that hide less are let go.

    Returns
    -------
    tuple
        The smallest distance on the curves, and that less what agents may be off, of places that were looked at; and
        what bounds the latter from below elsewhere.
    """
    hidden = np.inf
    for _ in range(ROUNDS):
        left, right, middle = _halved(points)
        found = obstacle.at(middle, t=float(t))
        nearest = min(nearest, float(found["distance"].min(initial=np.inf)))
        lowest = min(lowest, float((found["distance"] - off).min(initial=np.inf)))
        # The distance of a convex body is convex, so that it lies above its tangent planes, and it changes no faster
        # than the place.
        away = points - middle[:, None]
        slope = np.einsum("kim,km->ki", away, found["normal"]).min(axis=1)
        reach = -np.linalg.norm(away, axis=2).max(axis=1)
        bound = found["distance"] + np.where(slope > reach, slope, reach)
        parts = np.flatnonzero((bound < nearest - tolerance) | (bound - off < lowest - tolerance))
        rest = np.setdiff1d(np.arange(len(bound)), parts)
        hidden = min(hidden, float((bound - off)[rest].min(initial=np.inf)))
        if len(parts) > MOST_PARTS // 2:
            order = parts[np.argsort((bound - off)[parts], kind="stable")]
            parts, late = order[: MOST_PARTS // 2], order[MOST_PARTS // 2 :]
            hidden = min(hidden, float((bound - off)[late].min()))
        if not len(parts):
            return nearest, lowest, hidden
        points, off = np.concatenate([left[parts], right[parts]]), np.tile(off[parts], 2)
        bound = np.tile(bound[parts], 2)
    return nearest, lowest, min(hidden, float((bound - off).min()))


def _halved(points: Array) -> tuple[Array, Array, Array]:
    """Control points of the two halves of cubic curves, and the points between them, by de Casteljau's rule."""
    one = 0.5 * (points[:, 1:] + points[:, :-1])
    two = 0.5 * (one[:, 1:] + one[:, :-1])
    middle = 0.5 * (two[:, 1] + two[:, 0])
    left = np.stack([points[:, 0], one[:, 0], two[:, 0], middle], axis=1)
    right = np.stack([middle, two[:, 1], one[:, 2], points[:, 3]], axis=1)
    return left, right, middle
