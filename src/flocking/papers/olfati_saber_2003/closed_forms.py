"""Functions of Olfati-Saber's section 10 that no part of a law states: translational and gathering energy."""

from __future__ import annotations

import numpy as np

from flocking.model.checks import Array
from flocking.model.leaders import Leader, Sink


def translational_energy(q: Array, p: Array, leader: Leader) -> float:
    """H_tr = V_tr(q) + |p - p_d|^2/2 of the mean position and velocity (49).

    Parameters
    ----------
    q, p
        Mean position and velocity, shape (m,).
    leader
        A `Sink`, where V_tr = sqrt(1 + |q - q_d|^2) - 1, or a desired velocity, where V_tr = 0.
    """
    place, velocity, _ = leader.at(0.0)
    stored = np.sqrt(1.0 + np.sum((q - place) ** 2)) - 1.0 if isinstance(leader, Sink) else 0.0
    return float(stored + 0.5 * np.sum((p - velocity) ** 2))


def gathering_energy(q: Array, p: Array) -> float:
    """H_a = |q~|^2 + |p~|^2, the Lyapunov function of (51) without interaction (52).

    Parameters
    ----------
    q, p
        Positions and velocities, shape (N, m).
    """
    return float(((q - q.mean(axis=0)) ** 2).sum() + ((p - p.mean(axis=0)) ** 2).sum())
