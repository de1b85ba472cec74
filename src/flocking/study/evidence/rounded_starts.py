"""Connectivity of a given start of many agents, whose links engines in single precision find at rounded positions."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Indices
from flocking.engine.lammps.neighbours import near_pairs
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.space import Space
from flocking.model.state import State
from flocking.study.evidence.basis import NotResolvable


def connected_by_distances(graph: Graph, start: State, space: Space) -> bool:
    """Whether a graph whose links appear and break at distances is connected at a start, in double precision.

    Parameters
    ----------
    graph
        A graph whose links change as agents move.
    start, space
        The start, without given links, and the space of its agents.

    Raises
    ------
    NotResolvable
        When links that the distances leave open decide it: of fields of view and cones, and of pairs at a radius.
    """
    n = start.n
    enters, leaves = (
        np.broadcast_to(np.asarray(r, dtype=np.float64), (n,)) for r in (graph.appear_radius, graph.break_radius)
    )
    surely, possibly = leaves if graph.follows_radii else np.minimum(enters, leaves), np.maximum(enters, leaves)
    if graph.sees_headings:
        surely = np.zeros(n)
    if np.isfinite(possibly).all():
        i, j = near_pairs(start.q, float(np.nextafter(possibly.max(), np.inf)), space)
        r = np.linalg.norm(space.displacement(start.q[i] - start.q[j]), axis=1)
        # An agent that senses another joins both to one flock, whichever of them senses.
        if _joined(n, i[r < surely[i]], j[r < surely[i]]):
            return True
        if not _joined(n, i[r <= possibly[i]], j[r <= possibly[i]]):
            return False
    raise NotResolvable(
        f"single precision rounds the start of {n} agents, and their distances alone do not decide whether its graph "
        "is connected"
    )


def _joined(n: int, i: Indices, j: Indices) -> bool:
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    pairs = coo_array((np.ones(len(i), dtype=bool), (i, j)), shape=(n, n))
    return int(connected_components(pairs, directed=False)[0]) == 1
