"""Connectivity of a given start of many agents, whose links engines in single precision find at rounded positions."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array, Indices, Mask
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.graphs.views import Cone
from flocking.model.position_tree import IMAGE_ROUNDING, tree_of
from flocking.model.space import Space
from flocking.model.state import State
from flocking.study.evidence.basis import NotResolvable


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
        known = not graph.sees_headings
        allowed: tuple[Mask, Mask] = np.ones(len(r), dtype=bool), np.ones(len(r), dtype=bool)
        if isinstance(graph, Cone) and headings is not None:
            known, allowed = True, (graph.similar(headings, i, j), graph.similar(headings, j, i))
        possible = _sensed(r, np.nextafter(possibly, np.inf), (i, j), allowed)
        sure = possible & known & _sensed(r, surely, (i, j), allowed)
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
    found = tree_of(q, space).query_pairs(radius * (1.0 + IMAGE_ROUNDING), output_type="ndarray")
    i, j = found[:, 0], found[:, 1]
    return i, j, np.linalg.norm(space.displacement(q[i] - q[j]), axis=1)


def _sensed(r: Array, reach: Array, pairs: tuple[Indices, Indices], allowed: tuple[Mask, Mask]) -> Mask:
    """Pairs of which one senses the other, which joins both to one flock: within its reach, if headings allow it."""
    return np.asarray(((r < reach[pairs[0]]) & allowed[0]) | ((r < reach[pairs[1]]) & allowed[1]))


def _joined(n: int, i: Indices, j: Indices) -> bool:
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    pairs = coo_array((np.ones(len(i), dtype=bool), (i, j)), shape=(n, n))
    return int(connected_components(pairs, directed=False)[0]) == 1
