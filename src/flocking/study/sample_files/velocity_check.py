"""Whether the velocities of a file can have moved its positions."""

from __future__ import annotations

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import Array

SHARE = 0.2
"""Difference between a displacement and the integral of the velocities that counts as none, as a share of the larger:
units are wrong by more, such as 1.94 for knots and 3.6 for km/h, and estimates that other programs make are better."""

NOISE = 4.0
"""Multiples of the noise of positions that are allowed: of the root mean square of their second differences, which is
itself 2.4 times the standard deviation of independent errors."""

FEWEST = 5
"""Samples from which on the error of an integral is estimated."""


def check_velocities(t: Array, q: Array, p: Array) -> None:
    """Refuse velocities that certainly did not move the positions beside them.

    The displacement of every agent since the first sample is compared with the trapezoidal rule for its velocities,
    whose error is at most the sum of its differences from the rule on every second sample where the motion is resolved.

    Parameters
    ----------
    t
        Times, ascending, shape (F,).
    q, p
        Positions and velocities, shape (F, N, m).

    Raises
    ------
    InvalidInput
        When they differ by more than errors of the rule, noise of the positions and `SHARE` explain.
    """
    if len(t) < FEWEST:
        return
    h = np.diff(t)[:, None, None]
    steps = h * (p[1:] + p[:-1]) / 2.0
    double = (h[1:] + h[:-1]) * (p[2:] + p[:-2]) / 2.0
    rule = np.linalg.norm(steps[1:] + steps[:-1] - double, axis=2)
    allowed = np.concatenate([rule[:1], rule]).cumsum(axis=0)
    moved, integral = q[1:] - q[0], steps.cumsum(axis=0)
    off = np.linalg.norm(moved - integral, axis=2)
    largest = np.maximum(np.linalg.norm(moved, axis=2), np.linalg.norm(integral, axis=2)).max(axis=0)
    noise = np.sqrt((np.diff(q, 2, axis=0) ** 2).sum(axis=2).mean(axis=0))
    beyond = off - allowed - NOISE * noise - SHARE * largest
    k, i = (int(x) for x in np.unravel_index(int(np.argmax(beyond)), beyond.shape))
    if not beyond[k, i] > 0.0:
        return
    found = (
        f"agent {i}, which is {np.linalg.norm(moved[k, i]):.3g} from its first place at t = {t[k + 1]:.6g} where its "
        f"velocities lead {np.linalg.norm(integral[k, i]):.3g} away, {off[k, i]:.3g} from there"
    )
    raise InvalidInput(
        "audit", "samples", "must have velocities that move the positions beside them", found,
        "Check the units and the columns, or leave velocities out: they are estimated then. Samples that are further "
        "apart than the motion's own time do not determine it.",
    )  # fmt: skip
