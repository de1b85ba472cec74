"""Pairs that may cross a distance soon; of all others it is proven that they do not.

A list holds every pair that is linked, within a watched distance, or closer than a distance `BASE` beyond the largest
one and a skin. As long as no agent has moved by more than half the skin relative to the mean of the group, any other
pair is farther apart than `BASE`. The displacements are bounds over whole steps, so nothing between them is missed.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from flocking.arrays import Array, Indices, Mask
from flocking.engine.adaptive_steps.segment import Motion
from flocking.engine.exact.crossings.watch_tables import PairWatches, slack_at
from flocking.formula.native.functions import native_apart

BASE, SKIN, TOP = range(3)
"""What ``bounds`` holds: the distance that pairs not listed keep, by how much all may come closer before the list is
made anew, and the largest distance that is watched."""

SHARE = 0.3
"""Skin, as a share of the largest distance: with more of it the list is longer, with less it is made more often."""

PAD = 0.01
"""Share of the largest distance by which `BASE` exceeds it: above rounding and errors, as long as these are small."""

ROUNDED = 1e-12
"""Relative margin of bounds on distances, above their rounding."""


class NearbyPairs(NamedTuple):
    """Pairs that are looked at.

    Parameters
    ----------
    starts, partners
        Those of agent i are ``partners[starts[i]:starts[i + 1]]``, ascending; shape (N + 1,) and (room,).
    moved
        Bounds on the displacements since the list was made, relative to the mean of the group, shape (N,).
    bounds
        See `BASE`, shape (3,).
    """

    starts: Indices
    partners: Indices
    moved: Array
    bounds: Array


@lru_cache(maxsize=4)
def all_pairs(n: int) -> NearbyPairs:
    """The list of all pairs of ``n`` agents, which stays valid."""
    agents = np.arange(n)
    partners = np.broadcast_to(agents, (n, n))[agents[:, None] != agents]
    return NearbyPairs(
        np.arange(n + 1) * max(n - 1, 0), partners.copy(), np.zeros(n), np.array([np.inf, np.inf, np.inf])
    )


def unknown_pairs(watches: PairWatches, n: int) -> NearbyPairs:
    """An empty list for ``n`` agents under some ``watches``, to be made before its first use."""
    levels = np.concatenate([watches.enter.ravel(), watches.leave.ravel()])
    top = float(levels[np.isfinite(levels)].max(initial=0.0))
    room = max(n * (n - 1), 1)
    bounds = np.array([top * (1.0 + PAD), -1.0, top])
    return NearbyPairs(np.zeros(n + 1, dtype=np.int64), np.empty(room, dtype=np.int64), np.zeros(n), bounds)


@native_apart
def require_pairs(nearby: NearbyPairs, motion: Motion, watches: PairWatches, linked: Mask, extent: float) -> None:
    """Make the list anew where it might miss a pair on a step.

    Parameters
    ----------
    nearby
        The list; updated.
    motion
        How the agents move on the step.
    watches, linked
        Watched distances, and the links of each graph, shape (graphs, N, N).
    extent
        The largest coordinate on the step.
    """
    bounds, moved, far, B = nearby.bounds, nearby.moved, motion.far, motion.positions
    n, m, made = far.shape[0], B.shape[2], True
    for w in range(watches.slack.shape[0]):
        needed = bounds[TOP] + slack_at(watches.slack[w], extent)
        if needed > bounds[BASE]:
            bounds[BASE], made = needed * (1.0 + PAD), False
    farthest, widest = 0.0, 0.0
    for i in range(n):
        farthest, widest = max(farthest, moved[i] + far[i]), max(widest, far[i])
    if made and 2.0 * farthest * (1.0 + ROUNDED) <= bounds[SKIN]:
        return
    bounds[SKIN] = max(SHARE * bounds[TOP], 2.0 * widest * (1.0 + 2.0 * ROUNDED))
    cutoff = (bounds[BASE] + bounds[SKIN]) * (1.0 + ROUNDED)
    axes, squares = np.empty((m, n)), np.empty(n)
    for i in range(n):
        moved[i] = 0.0
        for k in range(m):
            axes[k, i] = B[0, i, k]
    count, tied = 0, 0
    for i in range(n):
        # Whole rows, so that these loops run over vectors.
        for j in range(n):
            squares[j] = 0.0
        for k in range(m):
            for j in range(n):
                squares[j] += (axes[k, j] - axes[k, i]) ** 2
        tied += marks_of_row(watches.near, i) + marks_of_row(linked, i)
        nearby.starts[i] = count
        for j in range(n):
            if squares[j] <= cutoff * cutoff and i != j:
                nearby.partners[count] = j
                count += 1
                tied -= marks_of_pair(watches.near, i, j) + marks_of_pair(linked, i, j)
    nearby.starts[n] = count
    if tied > 0:
        _list_with_links(nearby, B, watches, linked, cutoff)


def marks_of_row(marks: Mask, i: int) -> int:
    """How many pairs (i, j) are marked, in all matrices of ``marks``, shape (K, N, N); for native functions."""
    found = 0
    for k in range(marks.shape[0]):
        for j in range(marks.shape[2]):
            found += 1 if marks[k, i, j] else 0
    return found


def marks_of_pair(marks: Mask, i: int, j: int) -> int:
    """In how many matrices of ``marks``, shape (K, N, N), the pair (i, j) is marked; for native functions."""
    found = 0
    for k in range(marks.shape[0]):
        found += 1 if marks[k, i, j] else 0
    return found


def _list_with_links(nearby: NearbyPairs, B: Array, watches: PairWatches, linked: Mask, cutoff: float) -> None:
    """Make the list where pairs farther apart than ``cutoff`` belong to it in one order or the other.

    It reads matrices in both orders of a pair, which takes long for large groups.
    """
    n, m, count = B.shape[1], B.shape[2], 0
    for i in range(n):
        nearby.starts[i] = count
        for j in range(n):
            if i == j:
                continue
            d2 = 0.0
            for k in range(m):
                d2 += (B[0, j, k] - B[0, i, k]) ** 2
            close = d2 <= cutoff * cutoff
            close = close or marks_of_pair(watches.near, i, j) + marks_of_pair(linked, i, j) > 0
            close = close or marks_of_pair(watches.near, j, i) + marks_of_pair(linked, j, i) > 0
            if close:
                nearby.partners[count] = j
                count += 1
    nearby.starts[n] = count


def note_displacements(nearby: NearbyPairs, far: Array) -> None:
    """Note that no agent of ``nearby`` moved by more than ``far``, shape (N,), on a step; for native functions."""
    for i in range(far.shape[0]):
        nearby.moved[i] += far[i]
