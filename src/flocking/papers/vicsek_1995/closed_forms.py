"""Directions of neighbours, moments of the order parameter, and the cumulant that separates kinds of transitions."""

from __future__ import annotations

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import Array, array, integer
from flocking.model.graphs.distance_graphs import pair_distances
from flocking.model.space import OPEN, Space
from flocking.papers.vicsek_1995.system import RADIUS

ENOUGH = 2
"""Values of the order parameter that a cumulant needs at least."""


def mean_directions(q: Array, p: Array, space: Space = OPEN, radius: float = RADIUS) -> Array:
    """<theta>_r = arctan(<sin theta>/<cos theta>) over the agents closer than the radius, in (-pi, pi]; shape (N,).

    Parameters
    ----------
    q, p
        Positions and velocities, shape (N, 2).
    space
        The space.
    radius
        The radius; an agent is closer than it to itself.
    """
    near = pair_distances(np.asarray(q, dtype=np.float64), space) < radius
    np.fill_diagonal(near, True)
    angles = np.arctan2(p[:, 1], p[:, 0])
    return np.asarray(np.arctan2(near @ np.sin(angles), near @ np.cos(angles)))


def deviations(q: Array, p: Array, after: Array, space: Space = OPEN, radius: float = RADIUS) -> Array:
    """Angles by which headings after an update differ from the mean directions before it, in [-pi, pi); shape (N,).

    Parameters
    ----------
    q, p
        Positions and velocities before the update, shape (N, 2).
    after
        Velocities after it, shape (N, 2).
    space, radius
        As for `mean_directions`.
    """
    turned = np.arctan2(after[:, 1], after[:, 0]) - mean_directions(q, p, space, radius)
    return np.asarray((turned + np.pi) % (2.0 * np.pi) - np.pi)


def random_order(agents: int) -> tuple[float, float, float]:
    """Of N independent headings: the mean of v_a for large N, and the mean and variance of v_a^2.

    |sum of N unit vectors|^2 has the mean N and the variance N(N - 1); for large N its root has the mean
    sqrt(pi N)/2.

    Parameters
    ----------
    agents
        N.
    """
    n = integer("random_order", "agents", agents, least=1)
    return float(np.sqrt(np.pi / (4.0 * n))), 1.0 / n, (n - 1.0) / n**3


def binder_cumulant(order: Array) -> float:
    """G = 1 - <v_a^4>/(3 <v_a^2>^2) of values of the order parameter.

    Where order varies little G is 2/3, of many independent headings in the plane it is 1/3. At a discontinuous
    transition, where a run is ordered for a time and disordered for another, it falls below both, to negative values
    (Binder, Landau 1984).

    Parameters
    ----------
    order
        Values of v_a.

    Raises
    ------
    InvalidInput
        If there are fewer than two, or all are zero.
    """
    values = array("binder_cumulant", "order", order, ndim=1)
    if len(values) < ENOUGH or not np.any(values):
        raise InvalidInput("binder_cumulant", "order", "must be two values or more, not all zero", len(values))
    return float(1.0 - (values**4).mean() / (3.0 * (values**2).mean() ** 2))
