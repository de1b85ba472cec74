"""Velocities of sampled positions, by polynomials fitted to neighbouring samples, and their estimated errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import Array

WINDOW = 9
"""Samples of one fit. Two more than the coefficients of the highest degree that is compared, so that residuals of the
fits show the noise of the positions."""

DEGREES = ((2, 4), (4, 6))
"""Degrees of the polynomials that are tried, and the higher degree that each is compared with."""

SPREADS = 3.0
"""Standard deviations of noise that an estimated error contains; all but 0.3 % of normal noise lies within."""


SAME_NOISE = 0.05
"""Residuals of the highest degree above this share of those of the degree below it are noise: of noise alone the
expected share is 1, while errors of truncation fall by far more where samples resolve the motion."""


@dataclass(frozen=True, eq=False)
class Velocities:
    """Estimated velocities.

    Parameters
    ----------
    p
        Velocities, shape (F, N, m).
    other
        Those of the higher degree, whose difference estimates the truncation error, shape (F, N, m).
    error
        Estimated error of every velocity, shape (F, N, m): its distance from ``other``, and `SPREADS` standard
        deviations of the noise in that.
    noise
        Standard deviation of the noise in each coordinate of the positions, from the residuals of the fits.
    method
        The method in words.
    typical_noise
        The same by the median over the samples, which moments at which forces jump do not raise.
    coarser_noise
        That from fits of a lower degree. They show the same noise, and far larger errors of truncation.
    jump
        Size of the largest jump of a coordinate of the positions (`flocking.study.sample_files.jumps`); 0 without one.
    """

    p: Array
    other: Array
    error: Array
    noise: float
    method: str
    typical_noise: float = 0.0
    coarser_noise: float = np.inf
    jump: float = 0.0

    @property
    def resolved_noise(self) -> float:
        """The typical noise; 0 where a higher degree reduces it, as it does errors of truncation."""
        return self.typical_noise if self.typical_noise > SAME_NOISE * self.coarser_noise else 0.0


def smoothed_velocities(t: Array, q: Array, *, rounding: float = 0.0) -> Velocities:
    """Velocities of sampled positions by least squares (Savitzky and Golay, Anal. Chem. 36 (1964) 1627).

    A polynomial is fitted to the `WINDOW` samples nearest to each sample, which need not be evenly spaced; its slope is
    the velocity. Of two degrees the one with the smaller estimated error is used.

    Parameters
    ----------
    t
        Times, ascending, shape (F,).
    q
        Positions, shape (F, N, m).
    rounding
        Most that a coordinate was rounded by where it was stored. Noise is taken to be no less: by the inequality of
        Cauchy and Schwarz `SPREADS` times that, the root of `WINDOW`, contains all that rounding can do to a slope.

    Raises
    ------
    InvalidInput
        When there are fewer than `WINDOW` samples.
    """
    if len(t) < WINDOW:
        raise InvalidInput(
            "smoothed_velocities", "t", f"must hold at least {WINDOW} times, for velocities are estimated", len(t),
            "Give velocities, or more samples.",
        )  # fmt: skip
    slopes = {degree: _slopes(t, q, degree) for degree in sorted({d for pair in DEGREES for d in pair})}
    lower, highest = DEGREES[-1]
    noise = max(float(np.sqrt(slopes[highest][2].mean())), rounding)
    typical_noise, coarser_noise = (float(np.sqrt(np.median(slopes[degree][2]))) for degree in (highest, lower))
    best = None
    for degree, higher in DEGREES:
        p = slopes[degree][0]
        other, gain = slopes[higher][:2]
        error = np.abs(p - other) + SPREADS * noise * gain[:, None, None]
        if best is None or np.mean(error**2) < np.mean(best.error**2):
            method = f"slope of a polynomial of degree {degree} through the {WINDOW} nearest samples"
            best = Velocities(p, other, error, noise, method, typical_noise, coarser_noise)
    assert best is not None
    return best


def _slopes(t: Array, q: Array, degree: int) -> tuple[Array, Array, Array]:
    """Slopes at every sample, the gain of noise in each, and the squared noise in the residuals of its fit."""
    count = len(t)
    p, gain, squares = np.zeros_like(q), np.zeros(count), np.zeros(count)
    for k in range(count):
        first = min(max(0, k - WINDOW // 2), count - WINDOW)
        part = slice(first, first + WINDOW)
        scale = float(np.abs(t[part] - t[k]).max())
        powers = np.vander((t[part] - t[k]) / scale, degree + 1, increasing=True)
        fit = np.linalg.pinv(powers)
        values = q[part] - q[k]
        weights = fit[1] / scale
        p[k] = np.tensordot(weights, values, axes=1)
        gain[k] = float(np.linalg.norm(weights))
        residual = values - np.tensordot(powers @ fit, values, axes=1)
        squares[k] = float((residual**2).mean()) * WINDOW / (WINDOW - degree - 1)
    return p, gain, squares
