"""What the positions of a file leave in doubt of the velocities beside them."""

from __future__ import annotations

import numpy as np

from flocking.model.checks import Array
from flocking.study.sample_files.velocities import WINDOW, Velocities, smoothed_velocities

BEYOND = 3.0
"""Multiples of the estimated error of slopes by which velocities may differ from them."""

TOLERATED = 0.05
"""And this share of the largest speed about the mean: where forces jump, slopes are off by more than is estimated."""


def doubted_velocities(t: Array, q: Array, p: Array) -> Velocities | None:
    """Given velocities, with what they differ by from the slopes of the positions as their error; None without doubt.

    Up to `BEYOND` times the estimated error of the slopes and `TOLERATED` of the speeds counts as none, so that
    velocities that are measured better than positions stay exact. Of fewer than `WINDOW` samples nothing is known.

    Parameters
    ----------
    t
        Times, ascending, shape (F,).
    q, p
        Positions and velocities, shape (F, N, m).
    """
    if len(t) < WINDOW:
        return None
    slopes = smoothed_velocities(t, q)
    fastest = float(np.linalg.norm(slopes.p - slopes.p.mean(axis=1, keepdims=True), axis=2).max())
    off = np.abs(p - slopes.p)
    error = np.where(off > BEYOND * slopes.error + TOLERATED * fastest, off, 0.0)
    if not error.any():
        return None
    agent = int(error.max(axis=(0, 2)).argmax())
    method = (
        f"given in the file; they differ from the slopes of the positions by up to {error.max():.2g}, more than "
        f"errors of these explain (agent {agent}), which counts as their error: check units and columns, or leave them "
        "out"
    )
    return Velocities(p, slopes.p, error, slopes.noise, method)
