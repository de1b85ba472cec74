"""State vectors: positions, velocities of agents of order 2, and the further columns of bodies, one after the other."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from flocking.engine.adaptive_steps.state_tolerances import ORDINARY, counted, natural_sizes, state_tolerances
from flocking.model.bodies.actuators import APPLIED
from flocking.model.checks import Array
from flocking.model.graphs.views import VELOCITY
from flocking.model.law import Scenario
from flocking.model.state import State


def joined(state: State, order: int, widths: Mapping[str, int]) -> Array:
    """State vector of a state.

    Parameters
    ----------
    state
        The state.
    order
        Order of the agents.
    widths
        How many numbers an agent has in each further column, by name.
    """
    parts = [state.q, state.p][:order] + [state.columns[name] for name in widths]
    return np.concatenate([part.ravel() for part in parts], dtype=np.float64)


def place_of(column: str, order: int, n: int, m: int, widths: Mapping[str, int]) -> int:
    """Place of the first number of a ``column`` in state vectors; that of the velocities is ``"p"``.

    Parameters
    ----------
    order, widths
        As for `joined`.
    n, m
        Number of agents and of axes.
    """
    if column == VELOCITY:
        return n * m
    before = list(widths).index(column)
    return n * (order * m + sum(list(widths.values())[:before]))


def further_columns(y: Array, first: int, n: int, widths: Mapping[str, int]) -> dict[str, Array]:
    """Further columns of a state vector by name, shape (n, width) each; views.

    Parameters
    ----------
    y
        The state vector.
    first
        Place of the first one: how many positions and velocities there are.
    n
        Number of agents.
    widths
        As for `joined`.
    """
    found = {}
    for name, width in widths.items():
        found[name] = y[first : first + n * width].reshape(n, width)
        first += n * width
    return found


def component_tolerances(state: State, order: int, widths: Mapping[str, int], scenario: Scenario) -> Array:
    """Absolute error tolerance of each component of a state vector.

    Parameters
    ----------
    state
        The group at the start; a size below 1 counts as 1, of positions and velocities as in `state_tolerances`.
    order, widths
        As for `joined`.
    scenario
        Its tolerance is relative to the sizes of positions, velocities and each column. Where velocities are so small
        that they count as they are, so do applied forces (of order 1 velocities), by the force that gives the heaviest
        agent the natural velocity in the whole time. The units of other columns are not known.
    """
    tolerance, duration = scenario.tolerance, scenario.t_end - scenario.start.t
    parts = [state_tolerances(state, order, tolerance, duration)]
    speed = natural_sizes(state, duration)[1]
    for name in widths:
        values = state.columns[name]
        size = float(np.abs(values).max(initial=0.0))
        natural = 0.0
        if name == APPLIED and speed < ORDINARY and duration > 0.0:
            heaviest = float(np.max(scenario.agents.masses))
            natural = max(size, speed if order == 1 else heaviest * speed / duration)
        parts.append(np.full(values.size, tolerance * counted(size, natural)))
    return np.concatenate(parts)
