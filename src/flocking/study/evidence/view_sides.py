"""Pairs so near a side of a field of view that errors of their places decide on which side of it they are."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array
from flocking.model.graphs.connectivity import Links
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.graphs.views import FieldOfView


def beside_view(graph: Graph, headings: Array | None, offsets: Array, error: float) -> Links:
    """Pairs whose bearing is within an error of the side of the view of the first, shape (N, N).

    Of graphs without views along constant headings there are none.

    Parameters
    ----------
    graph, headings
        The graph, and the constant headings of the agents, as in `Agents`.
    offsets
        Displacements from each agent to each other one, shape (N, N, m).
    error
        Largest error of such a displacement.
    """
    n = len(offsets)
    if not isinstance(graph, FieldOfView) or graph.heading_column:
        return np.zeros((n, n), dtype=bool)
    cosines = graph.cosines(n)[:, None]
    ahead = np.einsum("ijk,ik->ij", offsets, graph.directions(headings, n))
    with np.errstate(invalid="ignore"):  # Views all around have no side.
        beyond = cosines * np.linalg.norm(offsets, axis=2) - ahead
    # What is ahead changes by the error at most, and the distance too.
    return np.asarray((np.abs(beyond) <= error * (1.0 + np.abs(cosines))) & (cosines > -1.0))
