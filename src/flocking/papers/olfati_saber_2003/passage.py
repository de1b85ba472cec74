"""Measures of the passage of the last two obstacles: the gap between them, and agents through it."""

from __future__ import annotations

import numpy as np

from flocking.engine.runs.run import Run
from flocking.papers.obstacle_passages import between_frames
from flocking.papers.olfati_saber_2003 import system


def gap_width() -> float:
    """Width of the gap between the last two obstacles, d_56."""
    b, radius = system.OBSTACLES[:2, -2:].T, system.OBSTACLES[2, -2:]
    return float(np.linalg.norm(b[1] - b[0]) - radius.sum())


def through_gap(run: Run) -> int:
    """Number of agents whose path crosses the line between the centres of the last two obstacles, inside the gap."""
    low, high = system.OBSTACLES[:, -2], system.OBSTACLES[:, -1]
    _, points = between_frames(run.t, run.q, run.p)
    x, y = points[..., 0], points[..., 1]
    crossed = (x[:-1] < low[0]) & (x[1:] >= low[0])
    between = (y[:-1] > low[1] + low[2]) & (y[:-1] < high[1] - high[2])
    return int((crossed & between).any(axis=0).sum())
