"""Tolerances of positions and velocities from the size of a group."""

from __future__ import annotations

import numpy as np

from flocking.model.checks import Array
from flocking.model.state import State


def state_tolerances(state: State, order: int, tolerance: float) -> Array:
    """Absolute error tolerance of each component of the positions, and then of the velocities of agents of order 2.

    Parameters
    ----------
    state
        The group at the start; a size below 1 counts as 1.
    order
        Order of the agents.
    tolerance
        The tolerance relative to these sizes.
    """
    spread = float(np.abs(state.q - state.q.mean(axis=0)).max(initial=0.0))
    speed = float(np.abs(state.p).max(initial=0.0))
    return np.repeat([tolerance * max(1.0, size) for size in (spread, speed)[:order]], state.q.size)
