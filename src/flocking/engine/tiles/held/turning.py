"""Headings of unicycles after a step under held forces, along the motion of their hand points."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from flocking.arrays import Array
from flocking.engine.kernels.headings import turned
from flocking.engine.tiles.held.limited_rates import steady_times


class TurningPoint(NamedTuple):
    """What unicycles are, by place, shape (size,) each.

    Parameters
    ----------
    masses, rate, offset
        Mass, damping over mass, and how far hand points lie in front of their axles.
    tau, largest_rate
        Time constants and largest rates of lagged forces; infinite where there are none.
    """

    masses: Array
    rate: Array
    offset: Array
    tau: Array
    largest_rate: Array


class Pushed(NamedTuple):
    """How unicycles move and what pushes them, shape (size, m) each.

    Parameters
    ----------
    p
        Velocities.
    goal, lagged
        What lagged forces tend to, and these forces; forces that do not lag are both.
    beside
        What acts beside them.
    """

    p: Array
    goal: Array
    lagged: Array
    beside: Array


def headings_after(
    point: TurningPoint, pushed: Pushed, heading: Array, dt: float, order: tuple[int, int], each: Callable[..., None]
) -> Array:
    """Headings after some pieces of a motion, shape (size, 2).

    Parameters
    ----------
    point, pushed
        What the agents are, and how they move.
    heading
        Headings now, shape (size, 2).
    dt
        How long a piece is.
    order
        How many pieces there are, and the degree of the motion on each.
    each
        Shares tiles among threads, see `flocking.engine.fixed_step.threads.Workers.each`.
    """
    pieces, degree = order
    limited, size = bool(np.isfinite(point.largest_rate).any()), len(heading)
    full = np.full(size, dt)
    for _ in range(pieces):
        left = full
        if limited:
            gap = pushed.goal - pushed.lagged
            steady = np.minimum(steady_times(gap, point.largest_rate, point.tau), dt)
            with np.errstate(divide="ignore", invalid="ignore"):
                shares = point.largest_rate / np.sqrt((gap**2).sum(axis=1))
            slope = np.where(steady > 0.0, shares, 0.0)[:, None] * gap
            C = _motion(point, pushed, slope, np.inf, degree)
            heading = turned(C, point.offset, steady, heading, each)
            after = pushed.lagged + slope * steady[:, None]
            pushed = pushed._replace(p=_velocity(C, steady[:, None]), lagged=after)
            left = dt - steady
        C = _motion(point, pushed, (pushed.goal - pushed.lagged) / point.tau[:, None], point.tau[:, None], degree)
        heading = turned(C, point.offset, left, heading, each)
        decay = np.exp(-left / point.tau)[:, None]
        after = pushed.goal + (pushed.lagged - pushed.goal) * decay
        pushed = pushed._replace(p=_velocity(C, left[:, None] if limited else dt), lagged=after)
    return heading


def _motion(point: TurningPoint, pushed: Pushed, slope: Array, tau: Array | float, degree: int) -> Array:
    """Taylor coefficients of positions but the first, shape (degree + 1, size, m).

    Parameters
    ----------
    slope, tau
        Rate of the force at the beginning, and the time constant with which it decays.
    """
    C = np.zeros((degree + 1, *pushed.p.shape))
    masses, rate = point.masses[:, None], point.rate[:, None]
    C[1] = pushed.p
    C[2] = 0.5 * ((pushed.lagged + pushed.beside) / masses - rate * pushed.p)
    lagging = slope / masses
    for k in range(3, degree + 1):
        C[k] = -rate / k * C[k - 1] + lagging / (k * (k - 1))
        lagging = -lagging / (tau * (k - 1))
    return C


def _velocity(C: Array, s: Array | float) -> Array:
    """Velocities a time after the coefficients."""
    return np.asarray(sum(k * C[k] * s ** (k - 1) for k in range(1, len(C))))
