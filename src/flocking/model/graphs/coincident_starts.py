"""Agents that start at the same point: linked pairs among them, found without a matrix of all pairs."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

from flocking.model.checks import Array
from flocking.model.graphs.all_pairs import Complete
from flocking.model.graphs.distance_graphs import Fixed, Graph, Hysteresis, Proximity
from flocking.model.graphs.smooth_cones import SmoothCone
from flocking.model.graphs.smooth_graphs import PerAgentRadii, Smooth
from flocking.model.graphs.views import Cone, FieldOfView, heading_gaps

Indices = NDArray[np.int64]

LINKS_ALL = (Complete, Proximity, Hysteresis, Smooth, PerAgentRadii, FieldOfView)
"""Graphs that link all agents at the same point."""
BLOCK = 1000
"""Number of agents whose headings are compared at once."""


def coincident_groups(q: Array) -> list[Indices]:
    """Groups of agents at exactly the same point, by their numbers, ascending in each group."""
    order = np.lexsort(q.T)
    same = (q[order[1:]] == q[order[:-1]]).all(axis=1)
    if not same.any():
        return []
    starts = np.flatnonzero(np.concatenate([[True], ~same, [True]]))
    sizes = np.diff(starts)
    several = np.flatnonzero(sizes > 1)
    return [np.sort(order[starts[k] : starts[k] + sizes[k]]) for k in several]


def linked_pair(graph: Graph, groups: list[Indices], q: Array, headings: Array | None) -> tuple[int, int] | None:
    """A pair of agents of one group that the graph links at the start, or None.

    Parameters
    ----------
    groups
        Agents at the same points; see `coincident_groups`.
    """
    if not groups:
        return None
    kind = type(graph)
    if kind in LINKS_ALL:
        return int(groups[0][0]), int(groups[0][1])
    if isinstance(graph, Fixed) and kind is Fixed:
        return _linked_edge(graph, groups, len(q))
    if isinstance(graph, Cone | SmoothCone) and kind in (Cone, SmoothCone) and headings is not None:
        return next((pair for group in groups for pair in _similar(graph, group, np.asarray(headings))), None)
    links = graph.start_links(q, headings)
    for group in groups:
        among = links[np.ix_(group, group)]
        i, j = np.nonzero(np.triu(among | among.T, 1))
        if len(i):
            return int(group[i[0]]), int(group[j[0]])
    return None


def _linked_edge(graph: Fixed, groups: list[Indices], n: int) -> tuple[int, int] | None:
    if not graph.edges:
        return None
    place = np.full(n, -1)
    for number, group in enumerate(groups):
        place[group] = number
    i, j = np.array(graph.edges).T
    same = np.flatnonzero((place[i] == place[j]) & (place[i] >= 0))
    return (int(i[same[0]]), int(j[same[0]])) if len(same) else None


def _similar(graph: Cone | SmoothCone, group: Indices, headings: Array) -> Iterator[tuple[int, int]]:
    """Pairs of a group whose headings satisfy the condition of the graph."""
    blocks = [group[k : k + BLOCK] for k in range(0, len(group), BLOCK)]
    for first, second in combinations_with_replacement(blocks, 2):
        members = np.union1d(first, second)
        gaps = heading_gaps(headings[members], graph.measure)
        opening = np.broadcast_to(np.asarray(graph.opening), len(headings))[members][:, None]
        near = gaps <= opening if isinstance(graph, Cone) else gaps < opening
        i, j = np.nonzero(np.triu(near | near.T, 1))
        yield from zip(members[i].tolist(), members[j].tolist(), strict=True)
