"""Pairs of agents within a radius, from a gathered state on one rank."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array, Indices, Positions, Velocities
from flocking.engine.fixed_step.automatic_step import SAMPLE, SampledPairs
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.law import Law
from flocking.model.position_tree import IMAGE_ROUNDING, tree_of
from flocking.model.space import OPEN, Space


def radius_of(graph: Graph) -> float:
    """Distance below which two agents are linked: the next number above the radius of a closed graph.

    Parameters
    ----------
    graph
        A graph with one radius.
    """
    radius = float(graph.break_radius)
    return float(np.nextafter(radius, np.inf)) if getattr(graph, "closed", False) else radius


def near_pairs(q: Array, radius: float, space: Space = OPEN) -> tuple[Indices, Indices]:
    """Ordered pairs (i, j) of positions closer than a radius in a space, each a row of indices."""
    found = tree_of(q, space).query_pairs(radius * (1.0 + IMAGE_ROUNDING), output_type="ndarray")
    # The tree includes pairs at exactly the radius.
    found = found[(space.displacement(q[found[:, 0]] - q[found[:, 1]]) ** 2).sum(axis=1) < radius**2]
    return np.concatenate([found[:, 0], found[:, 1]]), np.concatenate([found[:, 1], found[:, 0]])


def sampled_pairs(law: Law, q: Positions, p: Velocities, space: Space = OPEN) -> list[SampledPairs | None]:
    """All pairs in a space, under each graph of a law, of sampled agents spread evenly over the group."""
    tree = tree_of(q, space)
    places = np.asarray(tree.data)
    # In the order of the tree's leaves, agents that are adjacent in memory are close in space.
    chosen = tree.indices[:: max(1, len(q) // SAMPLE)]
    found: list[SampledPairs | None] = []
    for graph in law.graphs:
        radius = radius_of(graph)
        near = tree.query_ball_point(places[chosen], radius * (1.0 + IMAGE_ROUNDING))
        rows = [np.asarray(row, dtype=np.intp) for row in near]
        i = np.repeat(chosen, [row.size for row in rows])
        j = np.concatenate(rows)
        distance = np.linalg.norm(space.displacement(q[j] - q[i]), axis=1)
        speed = np.linalg.norm(p[j] - p[i], axis=1)
        inside = (i != j) & (distance < radius)
        found.append(SampledPairs(i[inside], j[inside], distance[inside], speed[inside]))
    return found
