"""All eigenvalues of the Laplacian of an undirected graph, enclosed."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array, Links
from flocking.formula.intervals import Interval

UNIT = 2.0**-53
"""Unit of rounding of double precision."""

INFLATION = 1.0 + 1e-9
"""Factor for the rounding of the bounds themselves, which are sums of nonnegative numbers."""


def laplacian_spectrum(links: Links) -> Interval:
    """Enclosures of the eigenvalues of the Laplacian, ascending, shape (N,).

    With the computed eigenvectors V and eigenvalues D, Q the orthogonal factor nearest to V, and
    e = |V^T V - I| >= |V - Q|: Q^T L Q = D + F with |F| <= |L V - V D| + (|L| + |D|) e, and by Weyl's inequality no
    eigenvalue of L is farther than |F| from its own of D. Residuals are widened by the bound of their rounding errors,
    n u/(1 - n u) times the sums of absolute values (Higham, Accuracy and Stability of Numerical Algorithms, 3.5).

    Parameters
    ----------
    links
        Link matrix, symmetric, shape (N, N).
    """
    n = len(links)
    adjacency = np.asarray(links, dtype=np.float64)
    laplacian = np.diag(adjacency.sum(axis=1)) - adjacency
    values, vectors = np.linalg.eigh(laplacian)
    rounding = (n + 2) * UNIT / (1.0 - (n + 2) * UNIT)
    size_l, size_v, size_d = np.abs(laplacian), np.abs(vectors), np.abs(values)
    residual = np.abs(laplacian @ vectors - vectors * values) + rounding * (size_l @ size_v + size_v * size_d)
    overlap = np.abs(vectors.T @ vectors - np.eye(n)) + rounding * (size_v.T @ size_v + np.eye(n))
    largest = float(size_l.sum(axis=1).max()) + float(size_d.max())
    radius = INFLATION * (_norm(residual) + largest * _norm(overlap))
    # The constant vector belongs to the eigenvalue zero, and no eigenvalue is negative.
    lo, hi = np.maximum(values - radius, 0.0), values + radius
    lo[0] = hi[0] = 0.0
    return Interval(lo, hi)


def _norm(matrix: Array) -> float:
    """A bound of the spectral norm of a matrix without negative elements."""
    return float(np.sqrt(matrix.sum(axis=0).max() * matrix.sum(axis=1).max()))
