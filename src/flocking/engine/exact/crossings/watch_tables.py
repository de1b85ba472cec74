"""Watched distances as arrays for native functions."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flocking.arrays import Array, Indices, Mask
from flocking.engine.adaptive_steps.integration_method import DEGREE
from flocking.engine.adaptive_steps.segment import ROUNDING


class PairWatches(NamedTuple):
    """Distances of pairs of agents that are watched, watch by watch.

    Parameters
    ----------
    near, active
        Which pairs are within the distance, and which are watched at all; shape (watches, N, N).
    enter, leave
        The distances at which pairs enter and leave, shape (watches, N).
    slack
        How far beyond these a pair has crossed, but for the rounding of coordinates, shape (watches,).
    directed
        Whether pairs are ordered, shape (watches,).
    smooth
        Whether the force is continuous there, shape (watches,).
    barred
        Whether the potential of a link is infinite where it breaks, shape (watches,).
    """

    near: Mask
    active: Mask
    enter: Array
    leave: Array
    slack: Array
    directed: Mask
    smooth: Mask
    barred: Mask


class BallWatches(NamedTuple):
    """Distances from balls at rest that are watched, level by level.

    Parameters
    ----------
    centres, radii
        Bernstein coefficients of the centres, shape (levels, 8, K, m), and the radii, shape (levels, K).
    inside, active
        Which agents are within the distance, and which pairs are watched; shape (levels, N, K).
    levels
        The distances, shape (levels,).
    groups, rims, jumps
        Group of obstacles of each level, whether it is a kink of the force inside the range, and whether the force may
        jump there, shape (levels,).
    ranges, counts
        Level of the range of each group, and how many balls it has, shape (groups,).
    """

    centres: Array
    radii: Array
    inside: Mask
    active: Mask
    levels: Array
    groups: Indices
    rims: Mask
    jumps: Mask
    ranges: Indices
    counts: Indices


NO_BALLS = BallWatches(
    np.zeros((0, DEGREE + 1, 0, 1)), np.zeros((0, 0)), np.zeros((0, 1, 0), dtype=bool),
    np.zeros((0, 1, 0), dtype=bool), np.zeros(0), np.zeros(0, dtype=np.int64), np.zeros(0, dtype=bool),
    np.zeros(0, dtype=bool), np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64),
)  # fmt: skip
"""Those of a law without obstacles."""


def slack_at(own: float, size: float) -> float:
    """How far a pair must pass a distance to have crossed it; for native functions too.

    Parameters
    ----------
    own
        That of exact coordinates.
    size
        The largest coordinate, whose rounding is added.
    """
    return own + ROUNDING * size


def near_miss_floor(slack: float, q_floor: float) -> float:
    """Error of the distance of two agents that is added to the integration error; for native functions too.

    It is the rounding of two positions, and how far the pair must pass the distance for a crossing to count.

    Parameters
    ----------
    slack
        As ``own`` of `slack_at`.
    q_floor
        What rounding adds to a position, see `flocking.engine.exact.companion.StateError`.
    """
    return 2.0 * q_floor + slack_at(slack, q_floor / ROUNDING)
