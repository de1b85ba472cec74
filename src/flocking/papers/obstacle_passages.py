"""Measures of a passage of obstacles: paths between frames, and numbers of flocks among obstacles."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from flocking.arrays import Array, Reals
from flocking.engine.runs.run import Run
from flocking.model.leaders_and_obstacles.obstacles import Obstacle
from flocking.model.terms.avoidance import ObstacleTerm
from flocking.study.claims.claim import Measure, above, happens
from flocking.study.claims.subjects import Subject, about
from flocking.study.evidence import Evidence, NotResolvable

BETWEEN = 10
"""Number of interpolated points between two frames."""
AHEAD = 200
"""Number of places, half the range of an obstacle apart, at which agents are looked at that keep their velocities."""


def _terms(run: Run) -> list[ObstacleTerm]:
    return [term for term in run.scenario.law.body_terms if isinstance(term, ObstacleTerm)]


def obstacles_of(run: Run) -> tuple[Obstacle, ...]:
    """The obstacles in a run's law."""
    return tuple(o for term in _terms(run) for o in term.obstacles)


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


@lru_cache(maxsize=1)
def flock_counts(e: Evidence) -> tuple[int, int, int]:
    """Number of flocks when the first obstacle becomes active, its maximum until the last is left, and at the end.

    Raises
    ------
    NotResolvable
        When links in doubt change one of them.
    """
    from flocking.study.nets.matrices import flocks

    switches = e.all_switches
    times = switches["time"][switches["kind"] == "obstacle"]
    if len(times) == 0:
        now = flocks(e.end_links)
        return now, now, now
    found = set()
    # Without errors of the run the history is that of the motion as computed.
    for history in (e.link_history,) if e.run.accuracy is None else e.possible_histories:
        before, most = flocks(history[0][1]), 0
        for time, links in history:
            if time > times[-1]:
                break
            count = flocks(links)
            if time <= times[0]:
                before = count
            most = max(most, count if time >= times[0] else 0)
        found.add((before, max(most, before)))
    if len(found) > 1 or e.known_until < np.inf:
        raise NotResolvable(e.doubt_note() or e.loss_note)
    return *found.pop(), flocks(e.end_links)


@about(Subject.CONNECTIVITY)
def splits(e: Evidence) -> Measure:
    """Largest number of flocks while obstacles are active, against that when the first becomes active."""
    before, most, _ = flock_counts(e)
    return happens(above(most - before, 0.5, f"{before} flocks before the obstacles, {most} among them"))


@about(Subject.CONNECTIVITY, at_end=True)
def rejoins(e: Evidence) -> Measure:
    """Number of flocks at the end, against the largest number while obstacles were active."""
    _, most, after = flock_counts(e)
    return happens(above(most - after, 0.5, f"{most} flocks among the obstacles, {after} at the end"))


@lru_cache(maxsize=1)
def yet_to_pass(e: Evidence) -> str:
    """Which agent is beside an obstacle at the end, or will be if it keeps its velocity; empty where none is."""
    t, fastest = float(e.t[-1]), float(np.linalg.norm(e.p[-1], axis=1).max())
    for term in _terms(e.run):
        step = term.range / (2 * fastest) if fastest > 0.0 else 0.0
        for k, obstacle in enumerate(term.obstacles):
            for after in step * np.arange(AHEAD if step else 1):
                near = obstacle.distance(e.q[-1] + after * e.p[-1], t + float(after)) <= term.range
                if near.any():
                    where = "has yet to pass" if after else "is beside"
                    return f"at the end agent {int(np.argmax(near))} {where} obstacle {k + 1}"
    return ""


def once_passed(e: Evidence, measured: Measure) -> Measure:
    """What was ``measured`` of a passage of obstacles, left open while one is to come, unless it has happened."""
    if measured.somewhere and measured.holds:
        return measured
    return replace(measured, unsettled=measured.unsettled or yet_to_pass(e))
