"""Measures of the passage of the last two obstacles: the gap between them, and agents through it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flocking.engine.runs.run import Run
from flocking.model.leaders_and_obstacles.obstacles import Ball
from flocking.papers.obstacle_passages import between_frames, obstacles_of, once_passed, rejoins, splits
from flocking.papers.olfati_saber_2003 import system
from flocking.study.claims.claim import Measure
from flocking.study.claims.subjects import Subject, about
from flocking.study.evidence import Evidence


def gap_width() -> float:
    """Width of the gap between the last two obstacles, d_56."""
    b, radius = system.OBSTACLES[:2, -2:].T, system.OBSTACLES[2, -2:]
    return float(np.linalg.norm(b[1] - b[0]) - radius.sum())


def has_gap(run: Run) -> bool:
    """Whether the last two obstacles of a run's law are those of (59)."""
    last = obstacles_of(run)[-2:]
    if len(last) < 2 or not all(isinstance(o, Ball) for o in last):
        return False
    expected = [(*column[:2], column[2]) for column in system.OBSTACLES[:, -2:].T]
    times = run.t[[0, -1]]
    return all(
        np.array_equal(np.append(o.centre.at(float(t))[0], o.radius), known)
        for o, known in zip(last, expected, strict=True)
        for t in times
        if isinstance(o, Ball)
    )


def through_gap(run: Run) -> int:
    """Number of agents whose path crosses the line between the centres of the last two obstacles, inside the gap."""
    low, high = system.OBSTACLES[:, -2], system.OBSTACLES[:, -1]
    _, points = between_frames(run.t, run.q, run.p)
    x, y = points[..., 0], points[..., 1]
    crossed = (x[:-1] < low[0]) & (x[1:] >= low[0])
    between = (y[:-1] > low[1] + low[2]) & (y[:-1] < high[1] - high[2])
    return int((crossed & between).any(axis=0).sum())


@about(Subject.CONNECTIVITY)
def splits_net(e: Evidence) -> Measure:
    """The same as `splits`, left open while obstacles are ahead."""
    return once_passed(e, splits(e))


@about(Subject.CONNECTIVITY, at_end=True)
def rejoins_behind(e: Evidence) -> Measure:
    """The same as `rejoins`, left open while obstacles are ahead: those who rejoin among them may part again."""
    return once_passed(e, replace(rejoins(e), everywhere=False, somewhere=False))
