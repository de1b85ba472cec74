"""Functions of Olfati-Saber's sections 10 and 11 that are not parts of a law: energies and contractions of balls."""

from __future__ import annotations

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import Array, array, number
from flocking.model.leaders_and_obstacles.leaders import Leader, Sink

ROUNDING = 1e-12
"""Positions on the boundary may be inside by their rounding."""


def translational_energy(q: Array, p: Array, leader: Leader) -> float:
    """H_tr = V_tr(q) + |p - p_d|^2/2 of the mean position and velocity (49).

    Parameters
    ----------
    q, p
        Mean position and velocity, shape (m,).
    leader
        A `Sink`, where V_tr = sqrt(1 + |q - q_d|^2) - 1, or a desired velocity, where V_tr = 0.

    Returns
    -------
    float
        Energy of a unit mass.
    """
    q, p = np.asarray(q, dtype=np.float64), np.asarray(p, dtype=np.float64)
    place, velocity, _ = leader.at(0.0)
    stored = np.sqrt(1.0 + np.sum((q - place) ** 2)) - 1.0 if isinstance(leader, Sink) else 0.0
    return float(stored + 0.5 * np.sum((p - velocity) ** 2))


def gathering_energy(q: Array, p: Array) -> float:
    """H_a = |q~|^2 + |p~|^2, the Lyapunov function of (51) without interaction (52).

    Parameters
    ----------
    q, p
        Positions and velocities, shape (N, m).

    Returns
    -------
    float
        Twice the energy of N unit masses connected to their mean by springs of stiffness 1.
    """
    q, p = np.asarray(q, dtype=np.float64), np.asarray(p, dtype=np.float64)
    return float(((q - q.mean(axis=0)) ** 2).sum() + ((p - p.mean(axis=0)) ** 2).sum())


def contraction(q: Array, centre: Array, radius: float) -> Array:
    """Factor s = l/(l + |qhat - q|) of (55), with which qhat = s q + (1 - s) b is the beta-agent on a ball.

    Parameters
    ----------
    q
        Positions outside the ball, shape (N, m).
    centre
        b, shape (m,).
    radius
        l.

    Returns
    -------
    Array
        Factors, shape (N,), between 0 and 1.

    Raises
    ------
    InvalidInput
        If a position is inside the ball, or a value is not finite.
    """
    _, distance, radius = _outside("contraction", q, centre, radius)
    return np.asarray(radius / distance)


def _outside(owner: str, q: Array, centre: Array, radius: float) -> tuple[Array, Array, float]:
    """Vectors to the centre of a ball, their lengths, and its radius, for positions outside."""
    size = number(owner, "radius", radius, above=0.0)
    inward = array(owner, "centre", centre, ndim=1) - array(owner, "q", q, ndim=2)
    distance = np.linalg.norm(inward, axis=1)
    if not (distance >= size * (1.0 - ROUNDING)).all():
        raise InvalidInput(owner, "q", "must be outside the ball", f"a position {distance.min():.6g} from its centre")
    return inward, distance, size


def contraction_rate(q: Array, p: Array, centre: Array, radius: float) -> Array:
    """Rate ds/dt = l p^T n/(l + |qhat - q|)^2 of the contraction, n the unit vector from q to qhat (57).

    Parameters
    ----------
    q, p
        Positions outside the ball, and velocities, shape (N, m) each.
    centre
        b, shape (m,), at rest.
    radius
        l.

    Returns
    -------
    Array
        Rates, shape (N,).

    Raises
    ------
    InvalidInput
        If a position is inside the ball, or a value is not finite.
    """
    inward, distance, radius = _outside("contraction_rate", q, centre, radius)
    p = array("contraction_rate", "p", p, ndim=2)
    return np.asarray(radius * (p * inward).sum(axis=1) / distance**3)
