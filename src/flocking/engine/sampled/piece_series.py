"""Taylor coefficients of pieces that began at different times, about one time."""

from __future__ import annotations

from functools import lru_cache
from math import comb

import numpy as np

from flocking.arrays import Array
from flocking.formula.native.functions import native_apart
from flocking.model.world.times import NANOSECOND, Instants

LONGEST_PIECE = 1 << 62
"""Nanoseconds of a piece that has no end of its own."""


@lru_cache(maxsize=8)
def binomials(degree: int) -> Array:
    """Binomials of a and k in row k, shape (degree + 1, degree + 1).

    Parameters
    ----------
    degree
        Largest a and k.
    """
    return np.array([[float(comb(a, k)) for a in range(degree + 1)] for k in range(degree + 1)])


@native_apart
def shift_pieces(table: Array, coefficients: Array, begin: Instants, seconds: float, found: Array) -> None:
    """Put coefficients of the same polynomials about a time into ``found``, by Horner's rule.

    Parameters
    ----------
    table
        What `binomials` gives.
    coefficients
        Taylor coefficients about the begins, shape (degree + 1, N, m).
    begin
        When each piece began, in nanoseconds, shape (N,).
    seconds
        The time, in seconds.
    found
        Of the shape of ``coefficients``.
    """
    degree, n, m = coefficients.shape[0] - 1, coefficients.shape[1], coefficients.shape[2]
    for i in range(n):
        s = seconds - begin[i] * NANOSECOND
        for axis in range(m):
            for k in range(degree + 1):
                value = table[k, degree] * coefficients[degree, i, axis]
                for a in range(degree - 1, k - 1, -1):
                    value = value * s + table[k, a] * coefficients[a, i, axis]
                found[k, i, axis] = value
