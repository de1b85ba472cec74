"""Quantities over all agents: displacements, extremes over tiles, cutoffs and links of the graphs."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Numbers, Numbers32, Reals
from flocking.engine.fixed_step.step_counts import LARGEST_SQUARE
from flocking.engine.tiles.kernels.spec import KernelSpec
from flocking.formula.native.functions import native
from flocking.model.graphs.distance_graphs import Fixed, Graph


@native
def squared_displacements(first, last, agents, reference, shift, n, out):  # type: ignore[no-untyped-def]
    """Largest squared displacement of the agents of each tile since the rebuild, in the frame of the group.

    Parameters
    ----------
    first, last
        Range of tiles, without the last.
    agents
        Positions and velocities, shape (size, 2 m).
    reference
        Positions at the rebuild, shape (size, m).
    shift
        Displacement of the frame of the group since then, shape (m,).
    out
        Receives one number per tile.
    """
    for tile in range(first, last):
        most = np.float64(0.0)
        for i in range(tile * 16, min(tile * 16 + 16, n)):
            square = np.float64(0.0)
            for k in range(reference.shape[1]):
                d = np.float64(agents[i, k]) - np.float64(reference[i, k]) - shift[k]
                square += d * d
            most = max(most, square) if square < LARGEST_SQUARE else np.float64(np.inf)
        out[tile] = most


@native
def extremes_of(tile_extremes, out):  # type: ignore[no-untyped-def]
    """Largest squared speed, smallest squared distance of linked agents and most breaks over all tiles.

    Parameters
    ----------
    tile_extremes
        Results of each tile, shape (tiles, 3).
    out
        Receives the three numbers.
    """
    fast, near, broken = 0.0, np.inf, 0.0
    for tile in range(tile_extremes.shape[0]):
        fast = max(fast, np.float64(tile_extremes[tile, 0]))
        near = min(near, np.float64(tile_extremes[tile, 1]))
        broken = max(broken, np.float64(tile_extremes[tile, 2]))
    out[0], out[1], out[2] = fast, near, broken


@native
def column_sums(values, out):  # type: ignore[no-untyped-def]
    """Sum of each column, from the first row to the last.

    Parameters
    ----------
    values
        Numbers, shape (rows, columns). NumPy sums such columns in the same order, many times more slowly.
    out
        Receives the sums, shape (columns,).
    """
    for k in range(values.shape[1]):
        out[k] = values[0, k] if values.shape[0] > 0 else 0.0
    for row in range(1, values.shape[0]):
        for k in range(values.shape[1]):
            out[k] += values[row, k]


def cutoffs_of(graphs: tuple[Graph, ...], spec: KernelSpec) -> list[float]:
    """Largest distance of linked agents under each graph; 0 for a fixed one.

    Parameters
    ----------
    graphs
        The graphs of a law.
    spec
        Specification of the kernel of that law.
    """
    return [
        0.0 if kind.fixed else float(np.max(np.maximum(graph.break_radius, graph.appear_radius)))
        for graph, kind in zip(graphs, spec.graphs, strict=True)
    ]


def sensed_offsets(graph: Fixed, n: int) -> tuple[Numbers, Numbers32]:
    """Sensed agents of each agent under a fixed graph, as offsets and neighbours."""
    edges = np.asarray(graph.edges, dtype=np.int64).reshape(-1, 2)
    if not graph.directed:
        edges = np.concatenate([edges, edges[:, ::-1]])
    edges = edges[np.lexsort((edges[:, 1], edges[:, 0]))]
    counts = np.bincount(edges[:, 0], minlength=n)
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64), edges[:, 1].astype(np.int32)


def fastest(velocities: Reals) -> float:
    """Largest speed of agents relative to their mean velocity, from velocities of shape (N, m)."""
    mean = velocities.mean(axis=0, dtype=np.float64)
    # In parts, so that a large group is never copied at once.
    parts = (velocities[k : k + 2**20] - mean for k in range(0, len(velocities), 2**20))
    with np.errstate(over="ignore"):
        return float(np.sqrt(max(float((part**2).sum(axis=1).max()) for part in parts)))
