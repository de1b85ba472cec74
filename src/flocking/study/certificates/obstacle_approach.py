"""How near agents come to obstacles at rest, between the frames too."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flocking.arrays import Array
from flocking.engine.runs.run import Run
from flocking.model.leaders_and_obstacles.obstacles import Obstacle
from flocking.model.world.safety_filters import SafetyFilter
from flocking.model.world.times import NANOSECOND
from flocking.study.curve_distances import MOST_PARTS, RESOLVED, searched_curves
from flocking.study.message_logs.recorded_motion import RecordedMotion


class _Samples(NamedTuple):
    """Samples of a motion.

    Parameters
    ----------
    t
        Times, shape (F,).
    q, p
        Positions and velocities, shape (F, N, m).
    off
        By how much agents may be away from the cubic curves between samples, shape (F - 1, N).
    """

    t: Array
    q: Array
    p: Array
    off: Array


def closest_to_obstacles(run: Run, obstacles: Sequence[Obstacle]) -> tuple[float, float]:
    """The smallest signed distance of an agent from an obstacle at rest over a run, and its error.

    Behind a safety filter, where forces are held from tick to tick, motions are the parabolas of the logged forces.
    Otherwise an agent is taken to be on the cubic curve through its positions and velocities at two samples. Samples
    are the fine ones of the exact engine, eight in each of its steps, where the run has them (``fine=True``), else the
    frames. How far it may be from the curve is estimated as in `RecordedMotion`: from how much accelerations of
    neighbouring curves differ and bend.

    Parameters
    ----------
    run
        The run.
    obstacles
        The obstacles, convex and at rest.

    Returns
    -------
    tuple
        Smallest signed distance on the curves, and the error: by how much it may be smaller, or larger, in the motion
        itself. Infinite of fewer than three samples that no log connects.
    """
    samples = _held(run) or _recorded(run)
    places = samples.q.reshape(-1, samples.q.shape[2])
    least = min(float(x.distance(places, float(samples.t[0])).min()) for x in obstacles)
    if not np.isfinite(samples.off).all() or len(samples.t) < 2:
        off = np.zeros_like(samples.off)
        found = [_least(x, samples._replace(off=off)) for x in obstacles]
        return min([least, *(near for near, _ in found)]), np.inf
    found = [_least(x, samples) for x in obstacles]
    near, lowest = min(x for x, _ in found), min(x for _, x in found)
    return near, near - lowest


def _recorded(run: Run) -> _Samples:
    """The fine samples of a run, or its frames."""
    samples = run.fine if run.fine is not None and len(run.fine.t) else run
    t, q, p = (np.asarray(x, dtype=np.float64) for x in (samples.t, samples.q, samples.p))
    if run.scenario.agents.order == 1:
        p = np.gradient(q, t, axis=0) if len(t) > 1 else np.zeros_like(q)
    if len(t) < 2:
        return _Samples(t, q, p, np.zeros((0, q.shape[1])))
    start = run.scenario.start
    motion = RecordedMotion(run, samples=samples)
    middle = (0.5 * (t[1:] + t[:-1]) - start.t)[:, None]
    # In the middle between two samples the estimate is largest.
    return _Samples(t, q, p, motion.at(middle, np.arange(q.shape[1])[None]).off_q)


def _held(run: Run) -> _Samples | None:
    """States at the ticks and the frames of a run behind a safety filter; None where no log holds its forces.

    A filter is for undamped point masses: under a force that is held they are on parabolas. From every frame the motion
    is computed anew; by how much it misses the next one is its error.
    """
    control, start = run.scenario.control, run.scenario.start
    if not isinstance(control, SafetyFilter) or run.log is None or np.any(control.latencies(start.n)):
        return None
    log = run.log
    ticks: dict[float, list[int]] = {}
    for row, instant in enumerate(log.ticks[:, 0].tolist()):
        ticks.setdefault(start.t + instant * NANOSECOND, []).append(row)
    frames = {float(t): k for k, t in enumerate(run.t)}
    times = np.array(sorted({start.t, *frames, *(t for t in ticks if t < run.t[-1])}))
    masses = np.broadcast_to(np.asarray(run.scenario.agents.masses, dtype=np.float64), start.n)[:, None]
    forces = np.zeros_like(start.q)
    q, p, now, missed = start.q, start.p, float(start.t), 0.0
    places, speeds = [], []
    for t in times.tolist():
        q, p = q + p * (t - now) + 0.5 * forces / masses * (t - now) ** 2, p + forces / masses * (t - now)
        if (frame := frames.get(t)) is not None:
            missed = max(missed, float(np.linalg.norm(q - run.q[frame], axis=1).max(initial=0.0)))
            q, p = np.asarray(run.q[frame], dtype=np.float64), np.asarray(run.p[frame], dtype=np.float64)
        rows = ticks.get(t, [])
        forces[log.ticks[rows, 1]] = log.forces[rows]
        places.append(q)
        speeds.append(p)
        now = t
    return _Samples(times, np.array(places), np.array(speeds), np.full((len(times) - 1, start.n), missed))


def _least(obstacle: Obstacle, samples: _Samples) -> tuple[float, float]:
    """The smallest distance on the curves through all samples, and a bound from below of that of the motion itself."""
    t, q, p, off = samples
    h = np.diff(t)[:, None, None] / 3.0
    # Each cubic curve lies in the hull of four points.
    points = np.stack([q[:-1], q[:-1] + p[:-1] * h, q[1:] - p[1:] * h, q[1:]], axis=2).reshape(-1, 4, q.shape[2])
    tolerance = RESOLVED * max(float(np.abs(points).max(initial=0.0)), np.finfo(np.float64).tiny)
    ends = obstacle.distance(q.reshape(-1, q.shape[2]), float(t[0])).reshape(len(t), -1)
    nearest, lowest = float(ends.min()), float(ends.min())
    if len(off):
        lowest = min(lowest, float((np.minimum(ends[1:], ends[:-1]) - off).min()))
    aways = off.ravel()
    hidden = np.inf
    for first in range(0, len(points), MOST_PARTS):
        block = slice(first, first + MOST_PARTS)
        nearest, lowest, missed = searched_curves(
            obstacle, t[0], points[block], aways[block], nearest, lowest, tolerance
        )
        hidden = min(hidden, missed)
    return nearest, min(lowest, hidden)
