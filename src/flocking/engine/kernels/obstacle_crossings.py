"""When agents on given paths cross distances from obstacles.

The distance to an obstacle changes no faster than the agent and the obstacle move. On a piece of a segment it therefore
stays within a bound of its value in the middle: halving the segment either proves that a distance is not crossed or
closes in on the first crossing. Excursions shorter than `FINE` of a step that leave no trace at the ends and the middle
of their piece are not detected.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from flocking.engine.kernels.bernstein import NEVER
from flocking.formula.native.functions import native
from flocking.model.checks import Array
from flocking.model.leaders_and_obstacles.leaders import Sink, Velocity
from flocking.model.leaders_and_obstacles.obstacles import Obstacle

Indices = NDArray[np.intp]

FINE = 1e-7
"""Fraction of a step below which excursions that leave no trace at ends and middles are not detected."""
SPEED_SAMPLES = 9
"""Samples of a speed on a step, the ends of 8 parts: one part more than the degree of the polynomial that resolves
the motion of a step."""
SPEED_MARGIN = 1.5
"""Factor that covers a speed which changes by a third between neighbouring samples of a step, more than steps that
resolve the motion have. It proves nothing: it is used if interval arithmetic finds no bound on a velocity.
"""

CLOSED = 1e-15
"""Fraction of a step to which a crossing is located."""


ROUNDINGS = 4.0
"""Times by which the errors of places where a crossing is located count: twice their number, a crossing and a time."""


def place_slack(reach: Array, t: float, length: float) -> Array:
    """How far beyond a distance a pair must be, that both sides of a located crossing are on their side of it.

    Parameters
    ----------
    reach
        How far agent and obstacle move together in ``length``.
    t
        The largest time.
    length
        Length of the time in which the crossing is looked for.
    """
    if not length > 0.0:
        return np.zeros_like(reach)
    return np.asarray(ROUNDINGS * (CLOSED + float(np.spacing(abs(t))) / length) * reach)


def speed_bound(obstacle: Obstacle, t0: float, t1: float) -> float:
    """Speed that an obstacle does not exceed on [t0, t1].

    Exact for constant velocities, by interval arithmetic for formulas. Only where that finds none is it an estimate:
    the largest of `SPEED_SAMPLES` speeds, `SPEED_MARGIN` times.

    Parameters
    ----------
    obstacle
        The obstacle.
    t0, t1
        When.
    """
    mover = obstacle.mover
    if mover is None or type(mover) is Sink:
        return 0.0
    if type(mover) is Velocity:
        return float(np.linalg.norm(mover.value))
    bound = mover.speed_bound(t0, t1)
    if np.isfinite(bound):
        return bound
    times = np.linspace(t0, t1, SPEED_SAMPLES)
    return SPEED_MARGIN * max(float(np.linalg.norm(mover.at(float(t))[1])) for t in times)


def first_crossings(above: Callable[[Array, Array, Indices], Array], C: Array, speed: Array) -> Array:
    """First position in [0, 1] at which each of several distances exceeds its border, or `NEVER`.

    Parameters
    ----------
    above
        Function of points (k, m), positions in [0, 1] and candidate numbers: how far the distance exceeds its
        border. It must change no faster than the points move plus ``speed``.
    C
        Bernstein coefficients of the candidates' paths, shape (candidates, degree + 1, m).
    speed
        How far each candidate's obstacle moves on the whole segment, shape (candidates,).
    """
    count = len(C)
    best = np.full(count, NEVER)
    known = np.full(count, NEVER)
    candidate, start, width = np.arange(count), np.zeros(count), 1.0
    at_start = above(C[:, 0], start, candidate)
    at_end = above(C[:, -1], start + 1.0, candidate)
    while len(candidate):
        begun = at_start > 0
        np.minimum.at(best, candidate[begun], start[begun])
        np.minimum.at(known, candidate[begun], start[begun])
        changes = ~begun & (at_end > 0)
        np.minimum.at(known, candidate[changes], start[changes] + width)
        if width < CLOSED:
            np.minimum.at(best, candidate[changes], start[changes])
            break
        left, right, excursion = _halves(C)
        middle = right[:, 0]
        value = above(middle, start + 0.5 * width, candidate)
        reach = excursion + 0.5 * width * speed[candidate]
        keep = ~begun & (start < known[candidate]) & (value + reach > 0)
        if width < FINE:
            keep &= (value > 0) | (at_end > 0)
        half = 0.5 * width
        candidate = np.concatenate([candidate[keep], candidate[keep]])
        C = np.concatenate([left[keep], right[keep]])
        at_start, at_end = (
            np.concatenate([at_start[keep], value[keep]]), np.concatenate([value[keep], at_end[keep]])
        )  # fmt: skip
        start = np.concatenate([start[keep], start[keep] + half])
        width = half
    return best


def _halves(C: Array) -> tuple[Array, Array, Array]:
    """Both halves of each path, and its largest distance from its middle; shapes (k, degree + 1, m) twice and (k,)."""
    left, right = np.empty(C.shape), C.copy()
    reach = np.zeros(len(C))
    _halve_paths(C, left, right, reach)
    return left, right, reach


@native
def _halve_paths(C: Array, left: Array, right: Array, reach: Array) -> None:
    count, size, m = C.shape[0], C.shape[1], C.shape[2]
    for c in range(count):
        for k in range(size):
            for x in range(m):
                left[c, k, x] = right[c, 0, x]
                for a in range(size - 1 - k):
                    right[c, a, x] = 0.5 * (right[c, a, x] + right[c, a + 1, x])
        for k in range(size):
            square = 0.0
            for x in range(m):
                square += (C[c, k, x] - right[c, 0, x]) ** 2
            reach[c] = max(reach[c], square)
        reach[c] = np.sqrt(reach[c])
