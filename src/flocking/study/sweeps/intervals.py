"""Confidence intervals: Wilson's for shares, the bootstrap for means."""

from __future__ import annotations

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import Array, number

RESAMPLES = 2000


def check_level(level: float) -> float:
    """A level of confidence between 0 and 1.

    Raises
    ------
    InvalidInput
        When it is not.
    """
    checked = number("summary", "level", level, above=0.0)
    if checked >= 1:
        raise InvalidInput("summary", "level", "must be below 1", level)
    return checked


def wilson(successes: int, total: int, level: float = 0.95) -> tuple[float, float]:
    """Wilson's score interval for a share.

    Parameters
    ----------
    successes, total
        How often it was so, out of how many.
    level
        Level of confidence.

    Returns
    -------
    tuple of float
        Lower and upper end; nan when nothing was tried.
    """
    if total == 0:
        return np.nan, np.nan
    from scipy.special import ndtri

    z2 = float(ndtri(0.5 + check_level(level) / 2)) ** 2
    share = successes / total
    centre = (share + z2 / (2 * total)) / (1 + z2 / total)
    half = np.sqrt(z2 * (share * (1 - share) / total + z2 / (4 * total**2))) / (1 + z2 / total)
    # Rounding must not push the ends past what is certain.
    low = 0.0 if successes == 0 else float(centre - half)
    return low, 1.0 if successes == total else float(centre + half)


def bootstrap(values: Array, level: float = 0.95, seed: int = 0, resamples: int = RESAMPLES) -> tuple[float, float]:
    """Percentile bootstrap interval of the mean.

    Parameters
    ----------
    values
        Measured values, shape (K,); those that are nan are left out.
    level
        Level of confidence.
    seed
        Seed of the resampling.
    resamples
        How many resamples.

    Returns
    -------
    tuple of float
        Lower and upper end; nan for fewer than two values.
    """
    kept = np.asarray(values, dtype=np.float64)
    kept = kept[~np.isnan(kept)]
    if len(kept) < 2:
        return np.nan, np.nan
    rng = np.random.default_rng(seed)
    means = np.array([kept[rng.integers(len(kept), size=len(kept))].mean() for _ in range(resamples)])
    half = check_level(level) / 2
    low, high = np.quantile(means, [0.5 - half, 0.5 + half])
    return float(low), float(high)
