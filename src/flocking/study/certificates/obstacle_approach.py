"""How near agents come to obstacles, between the frames too."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flocking.arrays import Array, Indices
from flocking.engine.runs.run import Run
from flocking.model.leaders_and_obstacles.obstacles import Obstacle

PARTS = 8
"""Parts into which the time between two samples is divided: the closest approach of a cubic curve is then found to a
few thousandths of the way between them, and further parts follow where it is smallest."""

ROUNDS = 6
"""Rounds of further parts: 8^6 is 2^18, so that the place of a smooth minimum is found to 1e-5 and its value to 1e-10
of the way between two samples."""


def closest_to_obstacles(run: Run, obstacles: Sequence[Obstacle]) -> tuple[float, float]:
    """The smallest signed distance of an agent from an obstacle over a run, and the error of the curve that it is on.

    Between two samples an agent is taken to be on the cubic curve through its positions and velocities. Samples are the
    fine ones of the exact engine, eight in each of its steps, where the run has them (``fine=True``), else the frames:
    then the curve is the motion itself only where forces are held from frame to frame. The error is a sixteenth of the
    largest distance of samples from the curves through every other one: errors of cubic curves fall so where samples
    resolve the motion.

    Parameters
    ----------
    run
        The run.
    obstacles
        The obstacles.

    Returns
    -------
    tuple
        Smallest signed distance, and the error; infinite of fewer than three samples.
    """
    samples = run.fine if run.fine is not None and len(run.fine.t) else run
    t, q, p = (np.asarray(x, dtype=np.float64) for x in (samples.t, samples.q, samples.p))
    if run.scenario.agents.order == 1:
        p = np.gradient(q, t, axis=0) if len(t) > 1 else np.zeros_like(q)
    if len(t) < 2:
        return min(float(x.distance(q[0], float(t[0])).min()) for x in obstacles), np.inf
    return min(_least(x, t, q, p) for x in obstacles), _missed(t, q, p)


def _least(obstacle: Obstacle, t: Array, q: Array, p: Array) -> float:
    """The smallest distance on the curves through all samples."""
    count = q.shape[1]
    # One interval of one agent for each row; a round looks at those next to the smallest distance that was found.
    first = np.repeat(np.arange(len(t) - 1), count)
    agent = np.tile(np.arange(count), len(t) - 1)
    low, high = np.zeros(len(first)), np.ones(len(first))
    least = np.inf
    for _ in range(ROUNDS):
        shares = low[:, None] + (high - low)[:, None] * np.linspace(0.0, 1.0, PARTS + 1)
        places, times = _curve(t, q, p, first[:, None], agent[:, None], shares)
        found = _distances(obstacle, places.reshape(-1, q.shape[2]), times.ravel()).reshape(shares.shape)
        k = np.argmin(found, axis=1)
        rows = np.argsort(found.min(axis=1))[:PARTS]
        least = min(least, float(found.min()))
        low, high = (np.clip((k + s) / PARTS, 0, 1) * (high - low) + low for s in (-1, 1))
        first, agent, low, high = first[rows], agent[rows], low[rows], high[rows]
    return least


def _distances(obstacle: Obstacle, places: Array, times: Array) -> Array:
    if obstacle.mover is None:
        return np.asarray(obstacle.distance(places))
    found = np.empty(len(places))
    for time in np.unique(times):
        at = times == time
        found[at] = obstacle.distance(places[at], float(time))
    return found


def _curve(t: Array, q: Array, p: Array, first: Indices, agent: Indices, s: Array) -> tuple[Array, Array]:
    """Places and times on the cubic curves from samples ``first`` to the next ones, at shares ``s`` of the way."""
    h = (t[first + 1] - t[first])[..., None]
    x, y, v, w = q[first, agent], q[first + 1, agent], p[first, agent], p[first + 1, agent]
    share = s[..., None]
    # Differences to the first place: far from the origin nothing cancels.
    rise = y - x
    even = share**2 * (3.0 - 2.0 * share)
    places = x + rise * even + h * (v * share * (1.0 - share) ** 2 - w * share**2 * (1.0 - share))
    return places, t[first] + s * h[..., 0]


def _missed(t: Array, q: Array, p: Array) -> float:
    """A sixteenth of the largest distance of samples from the curves through every other one."""
    if len(t) < 3:
        return np.inf
    even = np.arange(0, len(t), 2)
    first = np.arange(len(even) - 1)[:, None]
    agent = np.arange(q.shape[1])[None]
    inner = t[2 * first + 1]
    shares = (inner - t[even][first]) / (t[even][first + 1] - t[even][first])
    places, _ = _curve(t[even], q[even], p[even], first, agent, np.broadcast_to(shares, (len(first), q.shape[1])))
    away = np.linalg.norm(places - q[1 : 2 * len(first) : 2], axis=2)
    return float(away.max(initial=0.0)) / 16.0
