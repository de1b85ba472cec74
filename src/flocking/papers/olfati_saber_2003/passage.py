"""Measures of a passage of obstacles: clearance between frames, flocks among obstacles, agents through the gap."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from flocking.arrays import Array, Reals
from flocking.engine.runs.run import Run
from flocking.model.leaders_and_obstacles.obstacles import Obstacle
from flocking.model.terms.avoidance import ObstacleTerm
from flocking.papers.olfati_saber_2003 import system

if TYPE_CHECKING:
    from flocking.study.evidence import Evidence

BETWEEN = 10
"""Number of interpolated points between two frames."""


def obstacles_of(run: Run) -> tuple[Obstacle, ...]:
    """The obstacles in a run's law."""
    return tuple(o for term in run.scenario.law.body_terms if isinstance(term, ObstacleTerm) for o in term.obstacles)


def between_frames(t: Array, q: Reals, p: Reals, count: int = BETWEEN) -> tuple[Array, Array]:
    """Times and positions at and between frames, by cubic Hermite interpolation.

    Parameters
    ----------
    t, q, p
        Frame times (F,), positions and velocities (F, N, m).
    count
        Number of steps between two frames.
    """
    s = (np.arange(count) / count)[None, :, None, None]
    h = np.diff(t)[:, None, None, None]
    a, b, va, vb = q[:-1, None], q[1:, None], p[:-1, None] * h, p[1:, None] * h
    inside = a + s * va + s**2 * (3 * (b - a) - 2 * va - vb) + s**3 * (2 * (a - b) + va + vb)
    times = (t[:-1, None] + np.diff(t)[:, None] * s[..., 0, 0]).ravel()
    points = inside.reshape(-1, *q.shape[1:])
    return np.append(times, t[-1]), np.concatenate([points, q[-1:]])


def clearance(run: Run) -> tuple[float, float]:
    """Smallest signed distance of any agent from any obstacle, and its error.

    Positions between frames are interpolated by cubic Hermite polynomials. The error is that of the interpolation at
    a frame when every second frame is omitted, near obstacles, plus half the largest distance of successive points.
    """
    times, points = between_frames(run.t, run.q, run.p)
    every_second = run.q[::2], run.p[::2], run.t[::2]
    _, coarse = between_frames(every_second[2], every_second[0], every_second[1], 2)
    missed = np.linalg.norm(coarse[1::2] - run.q[1::2][: len(coarse[1::2])], axis=2)
    least, error = np.inf, 0.0
    n = run.q.shape[1]
    for obstacle in obstacles_of(run):
        distances = _distances(obstacle, times, points)
        least = min(least, float(distances.min()))
        # Only paths that come close can enter an obstacle.
        close = distances[: len(distances) // (2 * BETWEEN) * 2 * BETWEEN].reshape(-1, 2 * BETWEEN, n).min(axis=1)
        near = close < system.BETA_RANGE / 2
        error = max(error, float(missed[: len(near)][near[: len(missed)]].max(initial=0.0)))
    return least, error + float(np.linalg.norm(np.diff(points, axis=0), axis=2).max()) / 2


def _distances(obstacle: Obstacle, times: Array, points: Array) -> Array:
    """Signed distances of points, shape (K, N, m), each row at its own time; shape (K, N)."""
    k, n, m = points.shape
    values = [np.full(k * n, value) for value in obstacle.parameters.values()]
    return obstacle.distance_function()(points.reshape(k * n, m), np.repeat(times, n), values).reshape(k, n)


@lru_cache(maxsize=1)
def flock_counts(e: Evidence) -> tuple[int, int, int]:
    """Number of flocks when the first obstacle becomes active, its maximum until the last is left, and at the end."""
    from flocking.study.nets.matrices import flocks

    switches = e.all_switches
    times = switches["time"][switches["kind"] == "obstacle"]
    if len(times) == 0:
        now = flocks(e.end_links)
        return now, now, now
    before, most = flocks(e.link_history[0][1]), 0
    for time, links in e.link_history:
        if time > times[-1]:
            break
        count = flocks(links)
        if time <= times[0]:
            before = count
        most = max(most, count if time >= times[0] else 0)
    return before, max(most, before), flocks(e.end_links)


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
