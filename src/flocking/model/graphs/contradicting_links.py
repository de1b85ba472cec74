"""Links that contradict distances: those that a graph with a memory of them cannot have."""

from __future__ import annotations

import numpy as np

from flocking.model.checks import Array
from flocking.model.graphs.connectivity import Links
from flocking.model.graphs.distance_graphs import Graph


def contradicting_links(graph: Graph, links: Links, distance: Array, share: float) -> Links:
    """Pairs without a link nearer than links appear, or with one farther than links break, shape (N, N).

    Parameters
    ----------
    graph
        A graph whose links follow distances.
    links
        Link matrix, shape (N, N).
    distance
        Distances of the pairs, shape (N, N), infinite on the diagonal.
    share
        How far beyond its distance a pair may be, as a share of it.
    """
    enters, leaves = (np.asarray(x, dtype=np.float64)[..., None] for x in (graph.appear_radius, graph.break_radius))
    missing, beyond = distance < enters * (1.0 - share), distance > leaves * (1.0 + share)
    return np.asarray((~links & missing) | (links & beyond))
