"""Held forces under which agents with a largest speed do not exceed it.

A force u that acts for a time T leads from the velocity p to w = a p + b u, with a = exp(-k T/m) and b the integral of
exp(-k t/m)/m. Where w is too long it is scaled back, and the force that leads there acts instead. It is not larger than
the other one, for the point of a ball that is nearest to another point depends on that point without expansion; and for
T to 0 it tends to the force without its outward component, as under continuous control. The velocity moves along a
straight line meanwhile, so that no speed within the time is larger than both at its ends.
"""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array
from flocking.formula.native.functions import native_apart
from flocking.model.bodies.body import Body


def speed_terms(body: Body, n: int, times: float | Array) -> Array:
    """What is left of a velocity and what a unit force adds to it while a force acts, shape (2, N).

    Parameters
    ----------
    body
        Masses and damping of agents of order 2.
    n
        Their number.
    times
        How long the forces act, in seconds, one or one for each.
    """
    masses, damping, span = (
        np.broadcast_to(np.asarray(x, dtype=np.float64), n) for x in (body.masses, body.damping, times)
    )
    lost = -np.expm1(-damping * span / masses)
    with np.errstate(divide="ignore", invalid="ignore"):
        gained = np.where(damping > 0.0, lost / damping, span / masses)
    return np.stack([1.0 - lost, gained])


def fit_speed(i: int, p: Array, force: Array, most: Array, terms: Array) -> None:
    """Change row ``i`` of forces so that the speed of the agent in the end fits; for native functions.

    It is at most the largest speed, or what is left of a larger one.

    Parameters
    ----------
    p, force
        Velocities when the forces begin to act, and these, which are changed, shape (N, m).
    most
        Largest speeds, infinite where there are none, shape (N,).
    terms
        See `speed_terms`, shape (2, N).
    """
    left, gained, size = terms[0, i], terms[1, i], 0.0
    for k in range(force.shape[1]):
        size = max(size, abs(left * p[i, k]), abs(left * p[i, k] + gained * force[i, k]))
    if size == 0.0:
        return
    # Forces may be too large for their squares.
    kept, square = 0.0, 0.0
    for k in range(force.shape[1]):
        kept += (left * p[i, k] / size) ** 2
        square += ((left * p[i, k] + gained * force[i, k]) / size) ** 2
    allowed, speed = max(most[i], size * np.sqrt(kept)), size * np.sqrt(square)
    if speed > allowed:
        share = allowed / speed
        for k in range(force.shape[1]):
            force[i, k] = share * force[i, k] - (1.0 - share) * left / gained * p[i, k]


@native_apart
def fit_speeds(p: Array, force: Array, most: Array, terms: Array) -> None:
    """Change forces as `fit_speed` does, one row after the other.

    Parameters
    ----------
    p, force, most, terms
        As for `fit_speed`.
    """
    for i in range(force.shape[0]):
        fit_speed(i, p, force, most, terms)
