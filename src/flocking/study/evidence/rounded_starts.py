"""Connectivity of a given start of many agents, whose links engines in single precision find at rounded positions."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array, Indices, Mask
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.graphs.views import Cone
from flocking.model.space import Space
from flocking.model.state import State
from flocking.study.evidence.basis import NotResolvable

BEYOND = 1e-9
"""Relative room of the search among images, whose coordinates are rounded; displacements then decide."""


def connected_by_distances(graph: Graph, start: State, space: Space, headings: Array | None = None) -> bool:
    """Whether a graph whose links appear and break at distances is connected at a start, in double precision.

    Parameters
    ----------
    graph
        A graph whose links change as agents move.
    start, space
        The start, without given links, and the space of its agents.
    headings
        Constant headings of the agents, which cones compare.

    Raises
    ------
    NotResolvable
        When links that the distances leave open decide it: of fields of view, and of pairs at a radius.
    """
    n = start.n
    enters, leaves = (
        np.broadcast_to(np.asarray(r, dtype=np.float64), (n,)) for r in (graph.appear_radius, graph.break_radius)
    )
    surely, possibly = leaves if graph.follows_radii else np.minimum(enters, leaves), np.maximum(enters, leaves)
    if np.isfinite(possibly).all():
        i, j, r = _near(start.q, float(possibly.max()), space)
        # An agent that senses another joins both to one flock, whichever of them senses.
        sure, possible = ((r < reach[i]) | (r < reach[j]) for reach in (surely, np.nextafter(possibly, np.inf)))
        if isinstance(graph, Cone) and headings is not None:
            similar = graph.similar(headings, i, j), graph.similar(headings, j, i)
            sure = _sensed(r, surely, (i, j), similar)
            possible = _sensed(r, np.nextafter(possibly, np.inf), (i, j), similar)
        elif graph.sees_headings:
            sure = np.zeros(len(r), dtype=bool)
        if _joined(n, i[sure], j[sure]):
            return True
        if not _joined(n, i[possible], j[possible]):
            return False
    raise NotResolvable(
        f"single precision rounds the start of {n} agents, and their distances alone do not decide whether its graph "
        "is connected"
    )


def _near(q: Array, radius: float, space: Space) -> tuple[Indices, Indices, Array]:
    """Pairs i < j of agents within a radius and a little beyond, and their distances."""
    from scipy.spatial import cKDTree

    sides = [length if np.isfinite(length) else 0.0 for length in space.lengths]
    tree = cKDTree(space.wrapped(q), boxsize=sides or None)  # type: ignore[arg-type]  # its stub lacks the box
    found = tree.query_pairs(radius * (1.0 + BEYOND), output_type="ndarray")
    i, j = found[:, 0], found[:, 1]
    return i, j, np.linalg.norm(space.displacement(q[i] - q[j]), axis=1)


def _sensed(r: Array, reach: Array, pairs: tuple[Indices, Indices], similar: tuple[Mask, Mask]) -> Mask:
    """Pairs of which one senses the other: within its reach, and of similar heading to its own."""
    return np.asarray(((r < reach[pairs[0]]) & similar[0]) | ((r < reach[pairs[1]]) & similar[1]))


def _joined(n: int, i: Indices, j: Indices) -> bool:
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    pairs = coo_array((np.ones(len(i), dtype=bool), (i, j)), shape=(n, n))
    return int(connected_components(pairs, directed=False)[0]) == 1
