"""What the positions of a file leave in doubt of the velocities beside them, and their noise."""

from __future__ import annotations

import numpy as np

from flocking.model.checks import Array
from flocking.study.sample_files.velocities import WINDOW, Velocities, smoothed_velocities

BEYOND = 3.0
"""Multiples of the estimated error of slopes by which velocities may differ from them."""

TOLERATED = 0.05
"""And this share of the largest speed about the mean: where forces jump, slopes are off by more than is estimated."""

EXACT = 1e-12
"""Noise below this share of the largest coordinate is rounding."""


def doubted_velocities(t: Array, q: Array, p: Array) -> Velocities | None:
    """Given velocities, with their errors and the noise of the positions beside them; None where both count as exact.

    The error is what they differ by from the slopes of the positions, and of fewer than `WINDOW` samples from the mean
    velocities between samples. Up to `BEYOND` times what these are uncertain by and `TOLERATED` of the speeds counts as
    none, so that velocities that are measured better than positions stay exact. The noise is that in the residuals of
    the fits; of fewer samples it is not known.

    Parameters
    ----------
    t
        Times, ascending, shape (F,).
    q, p
        Positions and velocities, shape (F, N, m).
    """
    if len(t) < WINDOW:
        slopes, uncertain = _mean_velocities(t, q, p)
        noise, is_noise = 0.0, False
    else:
        smoothed = smoothed_velocities(t, q)
        slopes, uncertain = smoothed.p, smoothed.error
        noise, is_noise = smoothed.noise, smoothed.is_noise and smoothed.noise > EXACT * float(np.abs(q).max())
    fastest = float(np.linalg.norm(slopes - slopes.mean(axis=1, keepdims=True), axis=2).max())
    off = np.abs(p - slopes)
    error = np.where(off > BEYOND * uncertain + TOLERATED * fastest, off, 0.0)
    if error.any():
        agent = int(error.max(axis=(0, 2)).argmax())
        method = (
            f"given in the file; they differ from the slopes of the positions by up to {error.max():.2g}, more than "
            f"errors of these explain (agent {agent}), which counts as their error: check units and columns, or leave "
            "them out"
        )
        return Velocities(p, slopes, error, noise, method)
    if is_noise:
        method = f"given in the file, taken as exact; noise of positions {noise:.1e}, from their residuals"
        return Velocities(p, p, error, noise, method)
    return None


def _mean_velocities(t: Array, q: Array, p: Array) -> tuple[Array, Array]:
    """Mean velocities about every sample, and how much given velocities change there: of few samples."""
    each = np.diff(q, axis=0) / np.diff(t)[:, None, None]
    changes = np.abs(np.diff(p, axis=0))
    about = np.concatenate([each[:1], 0.5 * (each[1:] + each[:-1]), each[-1:]])
    beside = np.concatenate([changes[:1], np.maximum(changes[1:], changes[:-1]), changes[-1:]])
    return about, beside
