"""Pairs of agents within a radius, from a gathered state on one rank."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array, Indices, Positions, Velocities
from flocking.engine.fixed_step.automatic_step import SAMPLE, SampledPairs
from flocking.model.law import Law


def near_pairs(q: Array, radius: float) -> tuple[Indices, Indices]:
    """Ordered pairs (i, j) of positions closer than a radius, each a row of indices."""
    from scipy.spatial import cKDTree

    found = cKDTree(q).query_pairs(radius, output_type="ndarray")
    # The tree includes pairs at exactly the radius.
    found = found[((q[found[:, 0]] - q[found[:, 1]]) ** 2).sum(axis=1) < radius**2]
    return np.concatenate([found[:, 0], found[:, 1]]), np.concatenate([found[:, 1], found[:, 0]])


def sampled_pairs(law: Law, q: Positions, p: Velocities) -> list[SampledPairs | None]:
    """All pairs, under each graph of a law, of sampled agents spread evenly over the group."""
    from scipy.spatial import cKDTree

    tree = cKDTree(q)
    # In the order of the tree's leaves, agents that are adjacent in memory are close in space.
    chosen = tree.indices[:: max(1, len(q) // SAMPLE)]
    found: list[SampledPairs | None] = []
    for graph in law.graphs:
        near = tree.query_ball_point(q[chosen], float(graph.break_radius))
        rows = [np.asarray(row, dtype=np.intp) for row in near]
        i = np.repeat(chosen, [row.size for row in rows])
        j = np.concatenate(rows)
        distance, speed = (np.linalg.norm(x[j] - x[i], axis=1) for x in (q, p))
        inside = (i != j) & (distance < float(graph.break_radius))
        found.append(SampledPairs(i[inside], distance[inside], speed[inside]))
    return found
