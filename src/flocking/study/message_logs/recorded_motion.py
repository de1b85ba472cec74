"""Motion between the frames of a run, by interpolation, with estimates of its error."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flocking.arrays import Array, Indices
from flocking.engine.runs.message_log import MessageLog
from flocking.engine.runs.run import FineSamples, Run
from flocking.model.world.times import NANOSECOND

JUMP_SHARE = 4.0
"""Largest error of the acceleration of a cubic over the jump between two of them at a frame, where the acceleration
jumps once: at most 2, for a jump halfway between two frames. Twice that leaves room for two of them."""

BEND_SHARE = 0.5
"""The same over the second difference of the accelerations at frames, where the acceleration is smooth: 1/12, for the
error of a cubic through two values and slopes is the fourth derivative times s**2 (h - s)**2 / 24. Six times that
leaves room for its change."""


FORCE_SHARE = 2.0
"""The same over a jump of the acceleration between the two frames: at most 1, beside a jump at one of them. Twice that
leaves room for another one."""


class Between(NamedTuple):
    """States of agents between frames.

    Parameters
    ----------
    q, p
        Positions and velocities, shape (..., m).
    off_q, off_p
        Estimated errors of their lengths, shape (...); infinite where nothing is known.
    """

    q: Array
    p: Array
    off_q: Array
    off_p: Array


def cubic(x: Array | float, h: Array, q0: Array, q1: Array, p0: Array, p1: Array) -> Array:
    """Places on cubic curves with given ends and velocities there (Hermite interpolation), shape of the ends.

    Parameters
    ----------
    x, h
        Where on the curves, in [0, 1], and how long they take; both broadcast against the ends.
    q0, q1, p0, p1
        Positions at the ends, and velocities there.
    """
    return (1 + 2 * x) * (1 - x) ** 2 * q0 + x**2 * (3 - 2 * x) * q1 + h * x * (1 - x) * ((1 - x) * p0 - x * p1)


class RecordedMotion:
    """Where agents were, by their frames alone: cubics with the positions and velocities of two frames.

    Frames hold no velocities of agents of order 1: differences of neighbouring positions stand for them. Before the
    start agents moved in straight lines, those of order 1 stood still. At a frame, and before the start, the error is
    that of rounding; between two frames it is estimated from how far the accelerations of neighbouring cubics differ
    and bend, and by how much logged forces change there.

    Parameters
    ----------
    run
        The run.
    log
        Its log, if its forces are to count. No neighbour shows a jump just after the start or before the end.
    samples
        What stands for the frames, as the fine samples of the run do; the frames when absent.
    """

    def __init__(self, run: Run, log: MessageLog | None = None, samples: Run | FineSamples | None = None) -> None:
        start, known = run.scenario.start, run if samples is None else samples
        self._t: Array = np.asarray(known.t, dtype=np.float64) - start.t
        self._q: Array = np.asarray(known.q, dtype=np.float64)
        self._p: Array = np.asarray(known.p, dtype=np.float64)
        self._slopes = run.scenario.agents.order == 2
        """Whether frames hold the slopes of positions."""
        self._start = start.q, start.p if self._slopes else np.zeros_like(start.p)
        if not self._slopes and len(self._t) > 1:
            self._p = np.gradient(self._q, self._t, axis=0)
        self._unsure = self._differences()
        if log is not None and len(self._unsure):
            masses = np.broadcast_to(np.asarray(run.scenario.agents.masses, dtype=np.float64), self._q.shape[1])
            self._unsure = np.maximum(self._unsure, self._jumps(log, masses))

    def _jumps(self, log: MessageLog, masses: Array) -> Array:
        """Largest error of the acceleration between two frames by which a force jumps there, shape (F - 1, N)."""
        found, h = np.zeros((len(self._t) - 1, self._q.shape[1])), np.diff(self._t)
        for agent in range(self._q.shape[1]):
            rows = np.flatnonzero(log.ticks[:, 1] == agent)
            times = log.ticks[rows, 0] * NANOSECOND
            change = np.linalg.norm(np.diff(np.asarray(log.forces, dtype=np.float64)[rows], axis=0), axis=-1)
            k = np.clip(np.searchsorted(self._t, times[1:], side="right") - 1, 0, len(h) - 1)
            # Of order 1 the velocity jumps: of a line through two frames the error is h x (1 - x) of that.
            jump = change / masses[agent] if self._slopes else change / h[k]
            np.maximum.at(found[:, agent], k, FORCE_SHARE * jump)
        return found

    def _differences(self) -> Array:
        """Estimated largest error of the acceleration between two frames, shape (F - 1, N)."""
        if len(self._t) < 2:
            return np.zeros((0, self._q.shape[1]))
        h = np.diff(self._t)[:, None, None]
        rise, p0, p1 = np.diff(self._q, axis=0) / h, self._p[:-1], self._p[1:]
        first, last = (6.0 * rise - 4.0 * p0 - 2.0 * p1) / h, (2.0 * p0 + 4.0 * p1 - 6.0 * rise) / h
        if len(h) < 2:
            return np.full((1, self._q.shape[1]), np.inf)
        jumps = np.linalg.norm(first[1:] - last[:-1], axis=-1)
        nodes = np.concatenate([first[:1], 0.5 * (first[1:] + last[:-1]), last[-1:]])
        bends = np.linalg.norm(np.diff(nodes, 2, axis=0), axis=-1)
        unsure = JUMP_SHARE * jumps + BEND_SHARE * bends
        # Of an interval the frames at its two ends count, and those next to them.
        padded = np.concatenate([unsure[:1], unsure[:1], unsure, unsure[-1:], unsure[-1:]])
        return np.asarray(np.max([padded[k : k + len(h)] for k in range(4)], axis=0))

    def at(self, seconds: Array, agents: Indices) -> Between:
        """States of ``agents`` at times in seconds from the start, arrays of one shape.

        Parameters
        ----------
        seconds
            The times.
        agents
            Whose states, by their numbers.
        """
        seconds, agents = np.broadcast_arrays(np.asarray(seconds, dtype=np.float64), agents)
        before = seconds <= 0.0
        line = self._start[0][agents] + seconds[..., None] * self._start[1][agents], self._start[1][agents]
        if len(self._t) < 2:
            lost = np.where(before, 0.0, np.inf)
            return Between(*line, lost, lost)
        k = np.clip(np.searchsorted(self._t, seconds, side="right") - 1, 0, len(self._t) - 2)
        h = self._t[k + 1] - self._t[k]
        x = (seconds - self._t[k]) / h
        q0, q1, p0, p1 = self._q[k, agents], self._q[k + 1, agents], self._p[k, agents], self._p[k + 1, agents]
        s, d = x[..., None], h[..., None]
        q = cubic(s, d, q0, q1, p0, p1)
        p = 6 * s * (1 - s) * (q1 - q0) / d + (1 - s) * (1 - 3 * s) * p0 + s * (3 * s - 2) * p1
        # Values and slopes are right at both ends: with an error of the acceleration of at most e, those of position
        # and velocity are at most e h**2 / 16 and e h / 4, and less near an end.
        near, unsure = np.clip(np.minimum(x, 1.0 - x), 0.0, None), self._unsure[k, agents]
        unsure = np.where(near > 0.0, unsure, 0.0)
        beyond = (seconds < self._t[0]) | (seconds > self._t[-1])
        off_q = unsure * h**2 * np.minimum(0.5 * near**2, 1.0 / 16.0)
        off_p = unsure * h * np.minimum(near, 0.25)
        if not self._slopes:
            # Where slopes are not known at the ends, e h**2 x (1 - x)/2 and e h/2.
            off_q, off_p = 0.5 * unsure * h**2 * near * (1.0 - near), 0.5 * unsure * h
        places, velocities = (np.where(before[..., None], a, b) for a, b in zip(line, (q, p), strict=True))
        errors = [np.where(before, 0.0, np.where(beyond, np.inf, e)) for e in (off_q, off_p)]
        return Between(places, velocities, *errors)
