"""Polynomials by their Taylor coefficients about a time."""

from __future__ import annotations

from functools import lru_cache
from math import comb

import numpy as np

from flocking.arrays import Array, Indices

LOOPED_DEGREE = 3
"""Degree up to which a few operations by Horner's rule cost less than one with a matrix for each agent."""


def shifted(series: Array, by: float | Array) -> Array:
    """Coefficients of the same polynomials about a later time.

    Parameters
    ----------
    series
        Taylor coefficients, shape (degree + 1, ...).
    by
        By how much it is later, a number or an array that broadcasts to the shape of a coefficient.
    """
    degree = len(series) - 1
    if degree > LOOPED_DEGREE and np.ndim(by):
        powers = np.power(by, np.arange(degree + 1).reshape(-1, *(1,) * np.ndim(by)))
        binomials, above = _binomials(degree)
        rows = powers[above] * binomials.reshape(*above.shape, *(1,) * np.ndim(by))
        return np.asarray(np.einsum("ka...,a...->k...", rows, series))
    found = np.empty_like(series)
    for k in range(degree + 1):
        value = comb(degree, k) * series[degree]
        for power in range(degree - 1, k - 1, -1):
            value = value * by + comb(power, k) * series[power]
        found[k] = value
    return found


@lru_cache(maxsize=8)
def _binomials(degree: int) -> tuple[Array, Indices]:
    """Binomials of a and k where a >= k, zeros elsewhere, and a - k or 0, shape (degree + 1, degree + 1) each."""
    k, a = np.indices((degree + 1, degree + 1))
    found = np.array([[float(comb(power, row)) for power in range(degree + 1)] for row in range(degree + 1)])
    return found, np.maximum(a - k, 0)


def rates_of(series: Array) -> Array:
    """Taylor coefficients of the derivatives of polynomials that are no constants.

    Parameters
    ----------
    series
        Their coefficients, shape (degree + 1, ...).
    """
    powers = np.arange(1.0, len(series)).reshape(-1, *(1,) * (series.ndim - 1))
    return np.asarray(series[1:] * powers)
