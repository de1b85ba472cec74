"""Motions with constant distances: rates of distances, and conditions for a common velocity."""

from __future__ import annotations

import numpy as np

from flocking.model.checks import Array
from flocking.model.graphs.connectivity import is_connected
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.state import State

ROUNDING = 4.0 * float(np.finfo(np.float64).eps)
"""Relative rounding of the difference of two velocities that were computed, some units in the last place."""


def _pairs(state: State) -> tuple[Array, Array]:
    i, j = np.triu_indices(state.n, 1)
    return state.q[j] - state.q[i], state.p[j] - state.p[i]


def largest_distance_rate(state: State) -> float:
    """Largest | d/dt |q_j - q_i| | over all pairs; for agents at the same point their relative speed.

    Parameters
    ----------
    state
        Positions and velocities.
    """
    offset, relative = _pairs(state)
    distance, speed = np.linalg.norm(offset, axis=1), np.linalg.norm(relative, axis=1)
    apart = distance > 0
    rates = np.where(apart, np.abs((offset * relative).sum(axis=1)) / np.where(apart, distance, 1.0), speed)
    return float(rates.max(initial=0.0))


def converse_conditions(graph: Graph, state: State, tolerance: float = 1e-9) -> tuple[bool, bool, bool]:
    """Conditions a) to c) of the converse of Proposition 2 ii) of Olfati-Saber at one time.

    If all hold and all rates of distances vanish, all velocities are equal.

    Parameters
    ----------
    graph
        The graph.
    state
        Positions and velocities, and links for graphs with memory.
    tolerance
        Tolerance for zero relative velocities and for orthogonality, relative to the largest relative velocity. What is
        of the size of the rounding of the velocities themselves counts as zero too.

    Returns
    -------
    tuple of bool
        a) the net is an undirected flock; b) no two agents are at the same point; c) no two agents have different
        velocities with p_j - p_i orthogonal to q_j - q_i.
    """
    links = np.asarray(graph.initial(state.q) if state.links is None else state.links)
    undirected = bool((links == links.T).all()) and is_connected(links)
    offset, relative = _pairs(state)
    distance, speed = np.linalg.norm(offset, axis=1), np.linalg.norm(relative, axis=1)
    rounding = ROUNDING * float(np.linalg.norm(state.p, axis=1).max())
    different = speed > max(tolerance * float(speed.max(initial=0.0)), rounding)
    orthogonal = np.abs((offset * relative).sum(axis=1)) <= tolerance * distance * speed
    return undirected, bool((distance > 0).all()), not bool((different & orthogonal).any())
