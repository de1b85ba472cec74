"""Functionals of a graph: one number per agent from the links of all agents (Shi, Remark 3)."""

from __future__ import annotations

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import Array
from flocking.model.graphs.connectivity import Links


def left_eigenvector(weights: Array) -> Array:
    """The xi of Shi's Remark 3: xi^T L = 0, sum xi_i = 1, all positive, of a strongly connected graph.

    Computed by state reduction (Grassmann, Taksar and Heyman 1985), which avoids subtractions and therefore has a
    small relative error in every entry.

    Parameters
    ----------
    weights
        Weights w_ij >= 0 that agent i gives agent j, shape (N, N); the diagonal is ignored.

    Returns
    -------
    Array
        xi, shape (N,).

    Raises
    ------
    InvalidInput
        If the graph is not strongly connected, so that xi is not unique.
    """
    rates = np.array(weights, dtype=np.float64)
    np.fill_diagonal(rates, 0.0)
    if not is_strongly_connected(rates > 0):
        raise InvalidInput(
            "left_eigenvector", "weights", "must belong to a strongly connected graph", "a graph that is not",
            "Remark 3 assumes it; use a denser velocity graph.",
        )  # fmt: skip
    n = len(rates)
    for k in range(n - 1, 0, -1):
        rates[:k, k] /= rates[k, :k].sum()
        rates[:k, :k] += np.outer(rates[:k, k], rates[k, :k])
        np.fill_diagonal(rates[:k, :k], 0.0)
    xi = np.ones(n)
    for k in range(1, n):
        xi[k] = xi[:k] @ rates[:k, k]
    return np.asarray(xi / xi.sum())


def is_strongly_connected(links: Links) -> bool:
    """Whether a directed path leads from every agent to every other."""
    return _reaches_all(links) and _reaches_all(links.T)


def _reaches_all(links: Links) -> bool:
    reached = np.zeros(len(links), dtype=bool)
    reached[0] = True
    frontier = reached.copy()
    while frontier.any():
        frontier = links[frontier].any(axis=0) & ~reached
        reached |= frontier
    return bool(reached.all())
