"""The box around agents and near objects, to which the view is fitted."""

from __future__ import annotations

import numpy as np

from flocking.apps.lab.scene import glyphs
from flocking.apps.lab.scene.solids import Solid
from flocking.arrays import Array, Positions, Vector
from flocking.model.state import State

FAR = 3.0
"""Leaders and obstacles further away than this, in sizes of the group, do not widen the view."""


def box_around(state: State, things: list[Solid], least: float) -> tuple[Array, Array]:
    """Corners of a box around the agents and near objects, at least ``least`` wide.

    Parameters
    ----------
    things
        Obstacles and leaders; distant ones do not count.
    least
        Smallest width of the box in each direction.
    """
    q = glyphs.in_space(state.q).astype(np.float64)
    low, high = q.min(axis=0), q.max(axis=0)
    size, middle = max(float((high - low).max()), least), (low + high) / 2
    for thing in things:
        if np.abs(thing.position - middle).max() > FAR * size:
            continue
        own = thing.vertices if thing.kind == "obstacle" else np.zeros((1, 3))
        # A wall longer than the group counts as a point.
        own = own if np.abs(own).max() < size else np.zeros((1, 3))
        low = np.minimum(low, thing.position + own.min(axis=0))
        high = np.maximum(high, thing.position + own.max(axis=0))
    short = np.maximum(least - (high - low), 0.0) / 2
    return low - short, high + short


def centre_of(q: Positions) -> Vector:
    """Mean position as a point of space."""
    found = np.zeros(3)
    found[: min(3, q.shape[1])] = q.mean(axis=0)[:3]
    return found
