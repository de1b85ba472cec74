"""All eigenvalues of the Laplacian of an undirected graph, enclosed."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Links
from flocking.formula.intervals import Interval
from flocking.study.certificates.enclosed_matrices import exact, symmetric_eigenvalues


def laplacian_spectrum(links: Links) -> Interval:
    """Enclosures of the eigenvalues of the Laplacian, ascending, shape (N,).

    Parameters
    ----------
    links
        Link matrix, symmetric, shape (N, N).
    """
    adjacency = np.asarray(links, dtype=np.float64)
    values, radius = symmetric_eigenvalues(exact(np.diag(adjacency.sum(axis=1)) - adjacency))
    # The constant vector belongs to the eigenvalue zero, and no eigenvalue is negative.
    lo, hi = np.maximum(values - radius, 0.0), values + radius
    lo[0] = hi[0] = 0.0
    return Interval(lo, hi)


def has_two_sides(links: Links) -> bool:
    """Whether agents fall into two parts without links inside; then 2 k is an eigenvalue where all have k neighbours.

    Parameters
    ----------
    links
        Link matrix, symmetric, of a connected graph, shape (N, N).
    """
    from scipy.sparse.csgraph import shortest_path

    odd = shortest_path(links, unweighted=True, indices=0) % 2 == 1
    return not (links & (odd[:, None] == odd[None, :])).any()
