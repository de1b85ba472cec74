"""What the positions of a file leave in doubt of the velocities beside them, and their noise."""

from __future__ import annotations

import numpy as np

from flocking.model.checks import Array
from flocking.study.sample_files.velocities import SPREADS, WINDOW, Velocities, smoothed_velocities

BEYOND = 3.0
"""Multiples of the estimated error of slopes by which velocities may differ from them."""

TOLERATED = 0.05
"""And this share of the largest speed about the mean: where forces jump, slopes are off by more than is estimated."""

EXACT = 1e-12
"""Noise below this share of the largest coordinate is rounding."""


def doubted_velocities(
    t: Array, q: Array, p: Array, *, rounding: tuple[float, float] = (0.0, 0.0)
) -> Velocities | None:
    """Given velocities, with their errors and the noise of the positions beside them; None where both count as exact.

    The error is what they differ by from the slopes of the positions, and of fewer than `WINDOW` samples from the mean
    velocities between samples. Up to `BEYOND` times what these are uncertain by and `TOLERATED` of the speeds counts as
    none, so that velocities that are measured better than positions stay exact. The noise of the positions is that in
    the residuals of the fits, and that of the velocities in those of fits to them, which counts as their error, too; of
    fewer samples it is not known.

    Parameters
    ----------
    t
        Times, ascending, shape (F,).
    q, p
        Positions and velocities, shape (F, N, m).
    rounding
        Most that a coordinate of a position, and of a velocity, was rounded by where it was stored.
    """
    if len(t) < WINDOW:
        slopes, uncertain = _mean_velocities(t, q, p)
        noise, of_velocities = rounding
    else:
        smoothed = smoothed_velocities(t, q, rounding=rounding[0])
        slopes, uncertain = smoothed.p, smoothed.error
        noise = max(_noise(smoothed, q), rounding[0])
        of_velocities = max(_noise(smoothed_velocities(t, p), p), rounding[1])
    fastest = float(np.linalg.norm(slopes - slopes.mean(axis=1, keepdims=True), axis=2).max())
    off = np.abs(p - slopes)
    error = np.where(off > BEYOND * uncertain + TOLERATED * fastest, off, 0.0)
    if error.any():
        agent = int(error.max(axis=(0, 2)).argmax())
        method = (
            "given in the file; they differ from the slopes of the positions by up to "
            f"{error.max():.2g} (agent {agent}), "
            "more than the estimated errors of these, which counts as their error: check units and columns, or leave "
            "them out; or samples are too far apart for the motion"
        )
        return Velocities(p, slopes, np.maximum(error, SPREADS * of_velocities), noise, method)
    if not noise and not of_velocities:
        return None
    exact = f"noise of velocities about {of_velocities:.1e}" if of_velocities else "taken as exact"
    method = f"given in the file, {exact}; noise of positions about {noise:.1e}, or the motion between samples"
    return Velocities(p, p, np.full_like(p, SPREADS * of_velocities), noise, method)


def rounded_velocities(p: Array, rounding: tuple[float, float]) -> Velocities | None:
    """Given velocities with no error but that of their storage; None where neither they nor positions are rounded.

    Parameters
    ----------
    p
        Velocities, shape (F, N, m).
    rounding
        Most that a coordinate of a position, and of a velocity, was rounded by where it was stored.
    """
    place, speed = rounding
    if not place and not speed:
        return None
    method = f"given in the file, rounded by up to {speed:.1e}, positions by up to {place:.1e}"
    return Velocities(p, p, np.full_like(p, SPREADS * speed), place, method)


def _noise(found: Velocities, values: Array) -> float:
    """The noise that was found; 0 for rounding."""
    noise = found.resolved_noise
    return noise if noise > EXACT * float(np.abs(values).max()) else 0.0


def _mean_velocities(t: Array, q: Array, p: Array) -> tuple[Array, Array]:
    """Mean velocities about every sample, and how much given velocities change there: of few samples."""
    each = np.diff(q, axis=0) / np.diff(t)[:, None, None]
    changes = np.abs(np.diff(p, axis=0))
    about = np.concatenate([each[:1], 0.5 * (each[1:] + each[:-1]), each[-1:]])
    beside = np.concatenate([changes[:1], np.maximum(changes[1:], changes[:-1]), changes[-1:]])
    return about, beside
