"""The six order parameters of a flock in an arena, at every frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flocking.engine.runs.run import Run
from flocking.model.checks import Array
from flocking.model.graphs.connectivity import components
from flocking.model.graphs.distance_graphs import pair_distances
from flocking.model.terms.braking import ShillWalls
from flocking.papers.vasarhelyi_2018 import system


@dataclass(frozen=True, eq=False)
class OrderParameters:
    """Order parameters at every frame, shape (F,) each.

    Parameters
    ----------
    correlation
        Mean of the cosine of the angle between the velocities of two agents of one cluster, over all such pairs; NaN
        where there are none.
    collision
        Share of the pairs that are closer than the collision radius.
    overrun
        Mean over the agents of their distance from the arena, 0 inside.
    speed
        Mean speed.
    disconnected
        Number of agents that are alone in their cluster.
    smallest
        Number of agents of the smallest cluster of two or more; 0 where there is none.
    """

    correlation: Array
    collision: Array
    overrun: Array
    speed: Array
    disconnected: Array
    smallest: Array


NAMES = ("correlation", "collision", "overrun", "speed", "disconnected", "smallest")
"""Names of the order parameters."""


def at(
    q: Array, p: Array, radius: float, half_width: float = system.HALF_WIDTH
) -> tuple[float, float, float, float, float, float]:
    """The order parameters of one state, in the order of `NAMES`.

    Parameters
    ----------
    q, p
        Positions and velocities, shape (N, 2).
    radius
        That of clusters.
    half_width
        Half the width of the arena.
    """
    distances = pair_distances(np.asarray(q, dtype=np.float64))
    labels = components(distances < radius)
    sizes = np.bincount(labels)
    speeds = np.linalg.norm(p, axis=1)
    unit = p / np.where(speeds > 0.0, speeds, 1.0)[:, None]
    # Over the pairs of a cluster the cosines add up to (|sum of unit vectors|^2 - sum of their squares)/2.
    sums = np.stack([np.bincount(labels, unit[:, k], minlength=len(sizes)) for k in range(q.shape[1])], axis=1)
    pairs = float((sizes * (sizes - 1) / 2.0).sum())
    cosines = 0.5 * float((sums**2).sum() - (unit**2).sum())
    near = int(np.count_nonzero(distances < system.COLLISION_RADIUS))
    outside = np.linalg.norm(np.maximum(np.abs(q) - half_width, 0.0), axis=1)
    groups = sizes[sizes > 1]
    return (
        cosines / pairs if pairs else float("nan"), near / max(len(q) * (len(q) - 1), 1), float(outside.mean()),
        float(speeds.mean()), float((sizes == 1).sum()), float(groups.min()) if len(groups) else 0.0,
    )  # fmt: skip


def order_parameters(run: Run) -> OrderParameters:
    """Order parameters of a run at its frames; empty without frames.

    Parameters
    ----------
    run
        The run, of agents in the plane. Its links are those of clusters; without an arena nobody overruns it.
    """
    law = run.scenario.law
    radius = float(np.max(np.asarray(law.graph.break_radius)))
    half_width = next((term.half_width for term in law.terms if isinstance(term, ShillWalls)), np.inf)
    rows = np.array([at(q, p, radius, half_width) for q, p in zip(run.q, run.p, strict=True)])
    return OrderParameters(*rows.reshape(-1, len(NAMES)).T)
