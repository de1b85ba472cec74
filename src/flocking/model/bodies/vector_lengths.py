"""Vectors with another length, also those whose squares are no floating-point numbers."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Links
from flocking.model.checks import Array

LARGE, FACTOR = 2.0**500, 2.0**-520
"""Length above which a vector is made smaller before it is squared, and the power of two by which.

Squares of shorter vectors are finite, and those of all finite ones by the power.
"""


def lowered(vectors: Array) -> tuple[Array, Array]:
    """Vectors and their lengths, shapes (K, m) and (K,); those whose squares may overflow are made smaller before.

    Parameters
    ----------
    vectors
        The vectors, shape (K, m).
    """
    with np.errstate(over="ignore"):
        length = np.linalg.norm(vectors, axis=1)
    large = length > LARGE
    if not large.any():
        return vectors, length
    smaller = np.where(large[:, None], vectors * FACTOR, vectors)
    return smaller, np.linalg.norm(smaller, axis=1)


def scaled(vectors: Array, which: Links, length: float | Array) -> Array:
    """Vectors, shape (K, m), some of them with another length.

    Parameters
    ----------
    vectors
        The vectors, shape (K, m).
    which
        Which of them, shape (K,); none of these is zero.
    length
        Their new length, one for all or shape (K,).
    """
    smaller, sizes = lowered(vectors)
    share = (length / np.where(which, sizes, 1.0))[:, None]
    return np.where(which[:, None], smaller * share, vectors)
