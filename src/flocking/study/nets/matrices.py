"""Matrices of a net: adjacency, degrees, Laplacian; connectivity and balance (Olfati-Saber, section 2).

Entry (i, j) of a matrix belongs to the link by which agent i senses agent j.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flocking.errors import InvalidInput
from flocking.model.checks import Array
from flocking.model.graphs.connectivity import Links, components
from flocking.model.graphs.distance_graphs import Graph, pair_distances
from flocking.model.graphs.functionals import left_eigenvector
from flocking.model.graphs.graph_weights import weight_function
from flocking.model.graphs.weights import PairWeights
from flocking.model.observables import density, flocks
from flocking.model.space import OPEN, Space

__all__ = [
    "adjacency", "agreement_limit", "algebraic_connectivity", "degree_matrix", "density", "flock_members", "flocks",
    "in_degree", "incidence", "is_balanced", "is_quasi_flock", "laplacian", "left_eigenvector", "out_degree",
]  # fmt: skip

ASYMMETRY = 1e-12
"""Largest difference of w_ij and w_ji, as a share of the largest weight, that counts as rounding."""


def _matrix(weights: ArrayLike) -> Array:
    matrix = np.array(weights, dtype=np.float64)
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1]:
        raise InvalidInput("nets", "weights", "must be a square matrix", f"shape {matrix.shape}")
    if matrix.diagonal().any():
        raise InvalidInput("nets", "weights", "must have a zero diagonal: no agent senses itself", matrix.diagonal())
    return matrix


def adjacency(
    graph: Graph, q: Array, headings: Array | None = None, links: Links | None = None, *, space: Space = OPEN
) -> Array:
    """Spatial adjacency matrix A(q) with the weights of the graph (Olfati-Saber (2), (8), (17), (18)).

    Parameters
    ----------
    graph
        The graph.
    q
        Positions, shape (N, m).
    headings
        Headings, for graphs that see them.
    links
        Link memory; the graph's initial rule decides when absent.
    space
        Space of the agents: lengths of links are those to nearest images.

    Returns
    -------
    Array
        a_ij, shape (N, N), 0 where there is no link.

    Raises
    ------
    InvalidInput
        When the graph supports open space alone, and space repeats.
    """
    linked = graph.links_in(space, q, headings) if links is None else np.asarray(links, dtype=bool)
    i, j = np.nonzero(linked)
    values = [
        value.of(headings, len(q))[i, j] if isinstance(value, PairWeights) else value
        for value in graph.parameters.values()
    ]
    weight = weight_function(graph)
    result = np.zeros((len(q), len(q)))
    with np.errstate(all="ignore"):
        result[i, j] = weight(pair_distances(q, space)[i, j], *values)
    return result


def out_degree(weights: ArrayLike) -> Array:
    """Row sums: what agent i senses, shape (N,) (Olfati-Saber (9))."""
    return np.asarray(_matrix(weights).sum(axis=1))


def in_degree(weights: ArrayLike) -> Array:
    """Column sums: by what agent i is sensed, shape (N,) (Olfati-Saber (9))."""
    return np.asarray(_matrix(weights).sum(axis=0))


def degree_matrix(weights: ArrayLike) -> Array:
    """Diagonal matrix of the out-degrees (Olfati-Saber (10))."""
    return np.diag(out_degree(weights))


def laplacian(weights: ArrayLike) -> Array:
    """L = Delta - A, shape (N, N) (Olfati-Saber (11))."""
    return degree_matrix(weights) - _matrix(weights)


def incidence(links: Links) -> Array:
    """Incidence matrix B, shape (N, E), of an undirected net: a column per link, -1 at one end and 1 at the other.

    The Laplacian of the net with weights w is B diag(w) B^T.

    Raises
    ------
    InvalidInput
        When a link is one-way.
    """
    matrix = np.asarray(links, dtype=bool)
    if (matrix != matrix.T).any():
        raise InvalidInput("nets.incidence", "links", "must be those of an undirected net", "a one-way link")
    i, j = np.nonzero(np.triu(matrix))
    result = np.zeros((len(matrix), len(i)))
    result[i, np.arange(len(i))] = -1.0
    result[j, np.arange(len(i))] = 1.0
    return result


def is_balanced(weights: ArrayLike, tolerance: float = 1e-12) -> bool:
    """Whether in- and out-degree agree at every agent: 1^T L = 0 (Olfati-Saber, Proposition 1).

    Parameters
    ----------
    weights
        Links or weights, shape (N, N).
    tolerance
        Accepted difference, as a fraction of the largest degree.
    """
    inward, outward = in_degree(weights), out_degree(weights)
    largest = float(np.maximum(np.abs(inward), np.abs(outward)).max())
    return bool((np.abs(inward - outward) <= tolerance * largest).all())


def flock_members(links: Links) -> list[NDArray[np.intp]]:
    """Agents of every flock, the largest flock first (Olfati-Saber, Definition 1)."""
    labels = components(np.asarray(links, dtype=bool))
    found = [np.flatnonzero(labels == k) for k in range(int(labels.max()) + 1)]
    return sorted(found, key=lambda members: (-len(members), int(members[0])))


def is_quasi_flock(links: Links, share: float = 0.9) -> bool:
    """Whether a net is not connected but its density is at least ``share`` (Olfati-Saber, after (7))."""
    return share <= density(np.asarray(links, dtype=bool)) < 1.0


def algebraic_connectivity(weights: ArrayLike) -> float:
    """Second smallest eigenvalue of the Laplacian of an undirected net; 0 up to rounding when it is not connected.

    Raises
    ------
    InvalidInput
        When the weights are not symmetric or there is one agent only.
    """
    matrix = _matrix(weights)
    if not (np.abs(matrix - matrix.T) <= ASYMMETRY * np.abs(matrix).max(initial=0.0)).all():
        raise InvalidInput("algebraic_connectivity", "weights", "must be finite and symmetric", "weights that are not")
    if len(matrix) < 2:
        raise InvalidInput("algebraic_connectivity", "weights", "must belong to at least 2 agents", len(matrix))
    return float(np.linalg.eigvalsh(laplacian(0.5 * (matrix + matrix.T)))[1])


def agreement_limit(weights: ArrayLike, theta: ArrayLike) -> Array:
    """Limit of the agreement protocol from ``theta`` on a strongly connected net: xi^T theta.

    On a balanced net that is the mean.

    Raises
    ------
    InvalidInput
        When the net is not strongly connected.
    """
    return left_eigenvector(_matrix(weights)) @ np.asarray(theta, dtype=np.float64)
