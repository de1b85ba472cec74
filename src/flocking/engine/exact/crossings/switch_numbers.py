"""Numbers of a pair at the instant at which it switches: speed, errors, and how late the switch may be."""

from __future__ import annotations

import math

import numpy as np

from flocking.arrays import Array
from flocking.engine.adaptive_steps.segment import fill_part
from flocking.formula.native.functions import native, native_apart

DIFFERENCED = 0.01
"""Part of a step over which the second derivative of a distance is a difference of first ones: short against the step,
long against the rounding of polynomials, about 1e-14 of it."""


@native
def pair_speed(d: Array, v: Array) -> tuple[float, float]:
    """Rate of change of the distance of two agents, 0 where they coincide, and their relative speed.

    Parameters
    ----------
    d, v
        Difference of their positions and of their velocities, shape (m,).
    """
    along, square, size = 0.0, 0.0, 0.0
    for k in range(d.shape[0]):
        along += d[k] * v[k]
        square += d[k] * d[k]
        size += v[k] * v[k]
    return along / np.sqrt(square) if square > 0.0 else 0.0, np.sqrt(size)


@native
def largest_difference(rows: Array, first: int, i: int, j: int, m: int) -> float:
    """Largest difference of the numbers of two agents over some rows.

    Parameters
    ----------
    rows
        Numbers of the agents, m for each, shape (k, size).
    first
        Where those of agent 0 begin.
    """
    most = 0.0
    for k in range(rows.shape[0]):
        square = 0.0
        for c in range(m):
            square += (rows[k, first + j * m + c] - rows[k, first + i * m + c]) ** 2
        most = max(most, square)
    return float(np.sqrt(most))


@native
def agent_difference(rows: Array, i: int, m: int) -> float:
    """Largest of the numbers of an agent over some ``rows``, as `largest_difference` of two."""
    most = 0.0
    for k in range(rows.shape[0]):
        square = 0.0
        for c in range(m):
            square += rows[k, i * m + c] ** 2
        most = max(most, square)
    return float(np.sqrt(most))


@native_apart
def radial_motion(apart: Array, begin: float, end: float, e: Array) -> tuple[float, float, float]:
    """Of two agents at the end of a step: difference of their distance, their tangential speed over the distance, and
    the second derivative of the distance.

    Parameters
    ----------
    apart
        Bernstein coefficients of the difference of their positions, shape (8, m).
    begin, end
        Times of the step.
    e
        Difference of the errors of their positions, shape (m,).
    """
    last, m = apart.shape[0] - 1, apart.shape[1]
    left = np.empty((apart.shape[0], m))
    span = end - begin
    before, rate, r = 0.0, 0.0, 0.0
    for part in range(2):
        x = (end - DIFFERENCED * span - begin) / span if part == 0 else (end - begin) / span
        fill_part(apart, x, left)
        before, rate, square = rate, 0.0, 0.0
        for k in range(m):
            slope = last / (x * span) * (left[last, k] - left[last - 1, k])
            rate += left[last, k] * slope
            square += left[last, k] * left[last, k]
        r = np.sqrt(square)
        rate = rate / r if r > 0.0 else 0.0
    if r == 0.0:
        return 0.0, np.inf, np.inf
    off, aside = 0.0, 0.0
    for k in range(m):
        slope = last / ((end - begin) / span * span) * (left[last, k] - left[last - 1, k])
        off += left[last, k] * e[k]
        aside += (slope - rate * left[last, k] / r) ** 2
    return off / r, np.sqrt(aside) / r, (rate - before) / (DIFFERENCED * span)


@native
def beyond_level(d: Array, level: float, slack: float) -> float:
    """How far beyond a level a distance counts as across where it was located.

    A step that is cut there may have smaller coordinates than the whole one, on whose rounding that depends.

    Parameters
    ----------
    d
        Difference of the positions there, shape (m,).
    level
        The level.
    slack
        How far it is at least.
    """
    square = 0.0
    for k in range(d.shape[0]):
        square += d[k] * d[k]
    return float(max(slack, abs(np.sqrt(square) - level)))


def switch_errors(
    bound: float, drift: float, speed: float, off: float, turning: float, acceleration: float, beyond: float
) -> tuple[float, float, float]:
    """How late a switch may be, infinite where nothing bounds it, the error of its speed, and the delay that is likely.

    For native functions too.

    Parameters
    ----------
    bound, drift
        Errors of the distance of the pair and of its relative velocity.
    speed
        Rate of change of the distance.
    off, turning, acceleration
        See `radial_motion`.
    beyond
        How far beyond the distance the pair counts as across.
    """
    drift += turning * bound
    bound += beyond
    off += math.copysign(beyond, speed)
    late = bound / abs(speed) if speed != 0.0 else np.inf
    if acceleration != 0.0:
        late = min(late, np.sqrt(2.0 * bound / abs(acceleration)))
    delay = min(max(-off / speed, -late), late) if speed != 0.0 else late
    return late, drift + abs(acceleration) * late, delay
