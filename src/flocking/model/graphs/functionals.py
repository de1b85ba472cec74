"""Functionals of a graph: what the links of the whole group give each agent (Shi, Remark 3)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import Array
from flocking.model.graphs.connectivity import Links

if TYPE_CHECKING:
    from flocking.model.law import Law


def left_eigenvector(weights: Array) -> Array:
    """The xi of Shi's Remark 3: xi^T L = 0, sum xi_i = 1, all positive, of a strongly connected graph.

    Computed by state reduction (Grassmann, Taksar and Heyman 1985), which subtracts nothing and so keeps
    the relative accuracy of every entry.

    Parameters
    ----------
    weights
        Weights w_ij >= 0 that agent i gives agent j, shape (N, N); the diagonal is not looked at.

    Returns
    -------
    Array
        xi, shape (N,).

    Raises
    ------
    InvalidInput
        When the graph is not strongly connected: then there is no single positive xi.
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
    """Whether a directed path leads from every agent to every other.

    Parameters
    ----------
    links
        Link matrix, shape (N, N).
    """
    return _reaches_all(links) and _reaches_all(links.T)


def _reaches_all(links: Links) -> bool:
    reached = np.zeros(len(links), dtype=bool)
    reached[0] = True
    frontier = reached.copy()
    while frontier.any():
        frontier = links[frontier].any(axis=0) & ~reached
        reached |= frontier
    return bool(reached.all())


def uses_functional(law: Law, number: int) -> bool:
    """Whether a term over graph ``number`` of a law uses the functional of that graph."""
    return any(getattr(t, "functional", False) and law.graph_number(t) == number for t in law.pair_terms)


def graph_functional(law: Law, number: int, links: Links) -> Array | None:
    """Values s_i of the functional of graph ``number`` of a law, or None where no term uses it.

    The weights are those of the terms that use it, gains included.

    Parameters
    ----------
    law
        The law.
    number
        Which of its graphs.
    links
        Links of that graph, shape (N, N).

    Raises
    ------
    InvalidInput
        When the graph is not strongly connected.
    """
    if not uses_functional(law, number):
        return None
    n = len(links)
    weights = np.zeros((n, n))
    for term in law.pair_terms:
        if getattr(term, "functional", False) and law.graph_number(term) == number:
            if getattr(term, "weighted", False):
                raise InvalidInput(
                    "Consensus", "functional", "must not be combined with weighted=True", term,
                    "xi would change with every distance; use a hard graph.",
                )  # fmt: skip
            gain = np.broadcast_to(np.asarray(getattr(term, "gain", 1.0), dtype=np.float64), n)
            pairs = getattr(term, "weights", None)
            weights += gain[:, None] * (pairs.matrix(n) if pairs is not None else 1.0)
    return law.graphs[number].functional(links, weights)
