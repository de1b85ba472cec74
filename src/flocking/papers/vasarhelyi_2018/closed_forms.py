"""Closed forms that runs and parts are judged by: the speed of a lone agent, and the size of errors of fixes."""

from __future__ import annotations

import numpy as np

from flocking.model.checks import Array, integer
from flocking.papers.vasarhelyi_2018 import system


def lone_speeds(speed: float, ticks: int) -> Array:
    """Speeds of a lone agent without noise at its ticks, shape (ticks + 1,).

    Its desired velocity has its own direction and the length v_flock, so that its speed s follows
    s' = s + h/tau (v_flock - s) in steps of h, within the largest acceleration: s - v_flock falls by (1 - h/tau) a
    step.

    Parameters
    ----------
    speed
        At the start; positive, and within tau a_max of v_flock.
    ticks
        Number of ticks.
    """
    count = integer("lone_speeds", "ticks", ticks, least=0)
    steps = round(system.REFRESH / system.STEP) * np.arange(count + 1)
    return np.asarray(
        system.FLOCK_SPEED + (speed - system.FLOCK_SPEED) * (1.0 - system.STEP / system.TIME_CONSTANT) ** steps
    )


def error_variances(period: float, diffusion: float, damping: float, stiffness: float) -> tuple[float, float]:
    """Stationary variances of the errors of positions and velocities of fixes along an axis.

    Of v' = (1 - T b) v - T s x + sqrt(2 b T D) N(0, 1), x' = x + T v': the fixed point of the covariance.

    Parameters
    ----------
    period, diffusion, damping, stiffness
        T, D, b and s of `flocking.model.world.satellite_fixes.Fixes`; damping and stiffness positive.
    """
    step = np.array([[1.0 - period**2 * stiffness, period * (1.0 - period * damping)],
                     [-period * stiffness, 1.0 - period * damping]])  # fmt: skip
    kick = np.sqrt(2.0 * damping * period * diffusion) * np.array([period, 1.0])
    grown = np.eye(4) - np.kron(step, step)
    found = np.linalg.solve(grown, np.outer(kick, kick).ravel())
    return float(found[0]), float(found[3])
