"""Functions of Olfati-Saber's sections 10 and 11 that are not parts of a law: energies and contractions of balls."""

from __future__ import annotations

import numpy as np

from flocking.model.checks import Array
from flocking.model.leaders_and_obstacles.leaders import Leader, Sink


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
    """
    away = np.linalg.norm(np.asarray(q) - centre, axis=1) - radius
    return np.asarray(radius / (radius + away))


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
    """
    inward = centre - np.asarray(q)
    distance = np.linalg.norm(inward, axis=1)
    return np.asarray(radius * (p * inward).sum(axis=1) / distance**3)
