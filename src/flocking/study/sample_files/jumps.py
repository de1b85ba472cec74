"""Positions that jump between two samples: wrapped into a box, of renumbered agents, lost and found again."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flocking.arrays import Mask
from flocking.model.checks import Array

TOLERATED = 0.05
"""Share of the largest speed that steps may be off by beside what velocities explain: forces may jump within them."""

FAR = 10.0
"""Multiples of the typical difference of a step from what velocities explain beyond which it is a jump. Of normal
noise, whose median is two thirds of a standard deviation, one difference in 10^10 is that large."""

ROUNDING = 1e-12
"""Differences below this share of the largest coordinate are rounding."""

WINDOW = 5
"""Steps whose median is the velocity where none are given: bursts of one or two steps do not change it."""


@dataclass(frozen=True)
class Jump:
    """The largest jump of a coordinate between two samples.

    Parameters
    ----------
    size
        How far the coordinate is from where its velocity leads.
    time
        Time of the sample after it.
    agent
        Number of the agent.
    """

    size: float
    time: float
    agent: int

    @property
    def words(self) -> str:
        """What it is, what it may come from, and what follows, in words."""
        return (
            f"positions jump by up to {self.size:.2g} beside their velocities (agent {self.agent}, "
            f"t = {self.time:.12g}), which counts as their error: they may be wrapped into a box, rounded, or of "
            "agents that changed their names, or samples are too far apart for the motion"
        )


def largest_jump(t: Array, q: Array, p: Array | None, *, discrete: bool = False) -> Jump | None:
    """The largest jump of sampled positions; None where there is none.

    A step between two samples is off by what velocities do not explain. With velocities that do not leave the range of
    those at the four samples about it, it is off by at most this range times its duration. Where velocities are not
    given, a step is compared with the median of those about it. What is off by far more than other steps is a jump.

    Parameters
    ----------
    t
        Times, ascending, shape (F,).
    q
        Positions, shape (F, N, m).
    p
        Velocities, shape (F, N, m); None where none are given.
    discrete
        Whether velocities are set at ticks, of which few may lie at samples: between two samples they may then be any
        that are as large as the largest one that is given.
    """
    steps, moved = np.diff(t)[:, None, None], np.diff(q, axis=0)
    if p is None:
        expected = np.median(_neighbours(moved / steps, WINDOW), axis=0)
        bounds, fastest = np.zeros_like(moved), np.linalg.norm(expected, axis=2).max()
    else:
        about = _neighbours(p, 4)[:, :-1]
        expected = 0.5 * (p[1:] + p[:-1])
        bounds = np.ptp(about, axis=0) * steps
        if discrete:
            bounds = 2.0 * np.linalg.norm(p, axis=2).max() * steps
        fastest = np.linalg.norm(p - p.mean(axis=1, keepdims=True), axis=2).max()
    off = np.abs(moved - expected * steps)
    typical = np.maximum(np.median(off), np.median(off, axis=0))
    rounding = ROUNDING * float(np.abs(q).max())
    far: Mask = off > bounds + TOLERATED * fastest * steps + FAR * typical + rounding
    if not far.any():
        return None
    k, agent, _ = np.unravel_index(int(np.where(far, off, 0.0).argmax()), off.shape)
    return Jump(float(off[far].max()), float(t[k + 1]), int(agent))


def _neighbours(values: Array, count: int) -> Array:
    """Values about each entry of the first axis, ``count`` of them, the ends repeated; shape (count, ...)."""
    before = (count - 1) // 2
    ends = [(before, count - 1 - before), *[(0, 0)] * (values.ndim - 1)]
    padded = np.pad(values, ends, mode="edge")
    return np.stack([padded[k : k + len(values)] for k in range(count)])
