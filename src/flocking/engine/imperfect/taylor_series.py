"""Polynomials by their Taylor coefficients about a time."""

from __future__ import annotations

from math import comb

import numpy as np

from flocking.arrays import Array


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
    found = np.empty_like(series)
    for k in range(degree + 1):
        value = comb(degree, k) * series[degree]
        for power in range(degree - 1, k - 1, -1):
            value = value * by + comb(power, k) * series[power]
        found[k] = value
    return found
