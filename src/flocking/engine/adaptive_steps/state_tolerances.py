"""Tolerances of positions and velocities from the size of a group."""

from __future__ import annotations

import numpy as np

from flocking.model.checks import Array
from flocking.model.state import State

ORDINARY = 0.01
"""Sizes from this on count as at least 1: a tolerance is an absolute error there. Smaller ones, as of
lengths of micrometres in metres, count as they are."""


def counted(size: float, natural: float) -> float:
    """The size to which a tolerance is relative.

    Parameters
    ----------
    size
        Largest absolute value at the start.
    natural
        The size that it has, or will have in the motion, in the units of the scenario; 0 where that is not known.
    """
    return natural if 0.0 < natural < ORDINARY else max(1.0, size)


def natural_sizes(state: State, duration: float) -> tuple[float, float]:
    """Sizes of the distances and of the velocities in a motion, by what the start shows.

    Agents are at least as far from each other as at the start or as they fly in the time, and at least as fast as one
    that needs the whole time for that.

    Parameters
    ----------
    state
        The group at the start; velocities of agents of order 1 are 0.
    duration
        Length of the run.
    """
    spread, speed = state.sizes
    length = max(spread, speed * duration)
    return length, max(speed, length / duration if duration > 0.0 else 0.0)


def state_tolerances(state: State, order: int, tolerance: float, duration: float) -> Array:
    """Absolute error tolerance of each component of the positions, and then of the velocities of agents of order 2.

    Parameters
    ----------
    state
        The group at the start; a size below 1 counts as 1 where it is no smaller than `ORDINARY`.
    order
        Order of the agents.
    tolerance
        The tolerance relative to these sizes.
    duration
        Length of the run.
    """
    sizes = [counted(*each) for each in zip(state.sizes, natural_sizes(state, duration), strict=True)]
    return np.repeat([tolerance * size for size in sizes[:order]], state.q.size)
