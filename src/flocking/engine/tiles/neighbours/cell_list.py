"""Cell list: agents sorted by the cells of a grid that wraps around, by a stable parallel counting sort in two levels.

The number of cells is bounded by the number of agents. A group that is wider than the grid wraps around it: distant
places then share cells, which costs some unnecessary distance tests and does not change the result.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flocking.arrays import Numbers32, Reals, Vector
from flocking.engine.fixed_step.threads import Workers
from flocking.formula.native.functions import native

MOST_BUCKETS = 4096
"""Largest number of buckets in the first level of the sort; their counters fit into the cache of a processor."""
CHUNK = 16384
"""Agents per chunk; fixed, so that the order does not depend on the number of threads."""

ROUNDING = 1e-9
"""Cells are wider than the reach by this fraction, so that rounding never places a neighbour two cells away."""

PERIODIC_ROUNDING = 8.0 * float(np.finfo(np.float64).eps)
"""The same on an axis that repeats, as a share of the extent of the group, which may be many lengths: four roundings of
a coordinate in cells, twice."""


@dataclass(frozen=True)
class Grid:
    """A grid of cells.

    Parameters
    ----------
    origin
        Lowest corner, three coordinates (the last is 0 in the plane).
    inverse
        Reciprocal of the width of a cell along each axis. Cells are as wide as the reach, unless there are 3
        along an axis, which are all neighbours of each other.
    shape
        Cells along each axis, three numbers (the last is 1 in the plane); at least 3 along an axis in use.
    """

    origin: tuple[float, float, float]
    inverse: tuple[float, float, float]
    shape: tuple[int, int, int]

    @property
    def cells(self) -> int:
        """Number of cells."""
        return self.shape[0] * self.shape[1] * self.shape[2]


def choose_grid(low: Vector, high: Vector, reach: float, n: int, lengths: Sequence[float] = ()) -> Grid:
    """A grid of cells of width ``reach`` over the box from ``low`` to ``high``, wrapped if it would be too large.

    Parameters
    ----------
    low, high
        Corners of the box, shape (m,).
    reach
        Largest distance of neighbours.
    n
        Number of agents: the grid has at most about 2 n cells.
    lengths
        Length after which each axis repeats, infinite where it does not; empty where none does. Along an axis that
        repeats whole cells fill the length, so that the grid wraps around as space does.
    """
    m = len(low)
    width = reach * (1.0 + ROUNDING)
    extent = np.asarray(high) - np.asarray(low)
    per_axis = np.maximum(np.floor(extent / width) + 1.0, 3.0)
    repeats = [k for k, length in enumerate(lengths) if np.isfinite(length)]
    for k in repeats:
        per_axis[k] = max(np.floor(lengths[k] / (width + PERIODIC_ROUNDING * extent[k])), 3.0)
    most = max(2.0 * n, 3.0**m)
    if per_axis.prod() > most:
        # Shrink the longest axes first, so that the grid of a thin group keeps its shape.
        order = np.argsort(per_axis)
        left, axes = most, m
        for axis in order:
            share = left ** (1.0 / axes)
            per_axis[axis] = max(3.0, min(per_axis[axis], np.floor(share)))
            left /= per_axis[axis]
            axes -= 1
    shape = [int(k) for k in per_axis] + [1] * (3 - m)
    origin = [float(x) for x in low] + [0.0] * (3 - m)
    inverse = [shape[k] / lengths[k] if k in repeats else 1.0 / width for k in range(3)]
    return Grid((origin[0], origin[1], origin[2]), (inverse[0], inverse[1], inverse[2]), (shape[0], shape[1], shape[2]))


def cell_of(x: float, origin: float, inverse: float, count: int) -> int:
    """Cell of a coordinate along one axis, wrapped.

    Parameters
    ----------
    origin, inverse, count
        Origin of the cells, reciprocal of their width, and their number.
    """
    c = np.int64((np.float64(x) - origin) * inverse)
    return c if 0 <= c < count else c % count  # type: ignore[return-value]


@native
def _survey(first, last, agents, n, found):  # type: ignore[no-untyped-def]
    """Per chunk and axis: lowest and highest coordinate, and the sum of velocities."""
    m = agents.shape[1] // 2
    for chunk in range(first, last):
        for k in range(m):
            low, high, total = np.inf, -np.inf, 0.0
            for i in range(chunk * CHUNK, min((chunk + 1) * CHUNK, n)):
                x = np.float64(agents[i, k])
                low = x if x < low else low
                high = x if x > high else high
                total += np.float64(agents[i, m + k])
            found[chunk, k], found[chunk, m + k], found[chunk, 2 * m + k] = low, high, total


@native
def _count(first, last, agents, n, origin, inverse, shape, shift, key, counts):  # type: ignore[no-untyped-def]
    three = agents.shape[1] == 6
    for chunk in range(first, last):
        for bucket in range(counts.shape[1]):
            counts[chunk, bucket] = 0
        for i in range(chunk * CHUNK, min((chunk + 1) * CHUNK, n)):
            k = cell_of(agents[i, 1], origin[1], inverse[1], shape[1])
            if three:
                k += shape[1] * cell_of(agents[i, 2], origin[2], inverse[2], shape[2])
            k = k * shape[0] + cell_of(agents[i, 0], origin[0], inverse[0], shape[0])
            key[i] = k
            counts[chunk, k >> shift] += 1


@native
def _scatter(first, last, n, shift, key, places, key_buffer, index_buffer):  # type: ignore[no-untyped-def]
    for chunk in range(first, last):
        for i in range(chunk * CHUNK, min((chunk + 1) * CHUNK, n)):
            k = key[i]
            at = places[chunk, k >> shift]
            places[chunk, k >> shift] = at + 1
            key_buffer[at] = k
            index_buffer[at] = i


@native
def _settle(first, last, shift, cells, begins, key_buffer, index_buffer, parts, start, order, crowded):  # type: ignore[no-untyped-def]
    for bucket in range(first, last):
        low = bucket << shift
        high = min((bucket + 1) << shift, cells)
        for c in range(low, high):
            start[c] = 0
        for at in range(begins[bucket], begins[bucket + 1]):
            start[key_buffer[at]] += 1
        running, pairs = begins[bucket], 0.0
        for c in range(low, high):
            held = np.int64(start[c])
            start[c] = running
            running += held
            pairs += held * max(held / parts - 1.0, 0.0)
        crowded[bucket] = pairs
        for at in range(begins[bucket], begins[bucket + 1]):
            c = key_buffer[at]
            order[start[c]] = index_buffer[at]
            start[c] += 1
        for c in range(high - 1, low, -1):
            start[c] = start[c - 1]
        start[low] = begins[bucket]


@native
def _arrange(first, last, order, agents, ids, target, target_ids, reference, place):  # type: ignore[no-untyped-def]
    m = reference.shape[1]
    for i in range(first, last):
        o = order[i]
        place[o] = i
        target_ids[i] = ids[o]
        for k in range(m):
            reference[i, k] = agents[o, k]
            target[i, k] = agents[o, k]
            target[i, m + k] = agents[o, m + k]


@dataclass(frozen=True)
class Survey:
    """Extent and mean velocity of a group, computed by the sort.

    Parameters
    ----------
    low, high
        Corners of the box around it, shape (m,).
    velocity
        Mean velocity, shape (m,).
    """

    low: Vector
    high: Vector
    velocity: Vector


class Sorter:
    """The sort, with buffers that are reused at every rebuild.

    Parameters
    ----------
    n
        Number of agents.
    workers
        Threads to use.
    lengths
        As for `choose_grid`.
    """

    def __init__(self, n: int, workers: Workers, lengths: Sequence[float] = ()) -> None:
        self.n, self.workers, self.lengths = n, workers, lengths
        self.key = np.empty(n, np.int32)
        self.key_buffer = np.empty(n, np.int32)
        self.index_buffer = np.empty(n, np.int32)
        self.order: Numbers32 = np.empty(n, np.int32)
        self.start: Numbers32 = np.empty(1, np.int32)
        self.grid = Grid((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (3, 3, 1))
        self.crowding = 0.0

    @property
    def chunks(self) -> int:
        """Number of chunks of agents."""
        return (self.n + CHUNK - 1) // CHUNK

    def survey(self, agents: Reals) -> Survey:
        """Extent and mean velocity of agents, shape (at least n, 2m)."""
        m = agents.shape[1] // 2
        found = np.empty((self.chunks, 3 * m))
        self.workers.each_large(_survey, self.chunks, agents, self.n, found)
        return Survey(found[:, :m].min(axis=0), found[:, m : 2 * m].max(axis=0), found[:, 2 * m :].sum(axis=0) / self.n)

    def sort(self, agents: Reals, seen: Survey, reach: float, grid: Grid | None = None) -> None:
        """Sort agents, shape (at least n, 2m), into cells of width ``reach``: fills `order`, `start` and `crowding`.

        `crowding` estimates the number of ordered pairs within reach: those in equal parts of cells, 2^m parts to a
        cell, if the agents of every cell are spread evenly over its parts.

        Parameters
        ----------
        seen
            Extent of the agents.
        grid
            The cells; by default they are chosen for the extent.
        """
        n = self.n
        grid = self.grid = grid or choose_grid(seen.low, seen.high, reach, n, self.lengths)
        cells = grid.cells
        if not n:
            self.start, self.crowding = np.zeros(cells + 1, np.int32), 0.0
            return
        shift = 0
        while (cells >> shift) >= MOST_BUCKETS:
            shift += 1
        buckets = ((cells - 1) >> shift) + 1
        chunks = self.chunks
        counts = np.empty((chunks, buckets), np.int32)
        each = self.workers.each_large
        origin, inverse, shape = np.array(grid.origin), np.array(grid.inverse), np.array(grid.shape)
        each(_count, chunks, agents, n, origin, inverse, shape, shift, self.key, counts)
        ends = np.cumsum(counts.T.ravel(), dtype=np.int64)
        places = np.ascontiguousarray((ends - counts.T.ravel()).reshape(buckets, chunks).T)
        begins = np.append(places[0], n)
        each(_scatter, chunks, n, shift, self.key, places, self.key_buffer, self.index_buffer)
        if len(self.start) != cells + 1:
            self.start = np.empty(cells + 1, np.int32)
        crowded = np.empty(buckets)
        each(
            _settle, buckets, shift, cells, begins, self.key_buffer, self.index_buffer,
            2.0 ** len(seen.low), self.start,
            self.order, crowded,
        )  # fmt: skip
        self.start[cells] = n
        self.crowding = float(crowded.sum())

    def arrange(
        self, agents: Reals, ids: Numbers32, target: Reals, target_ids: Numbers32, reference: Reals
    ) -> Numbers32:
        """Copy agents, identities and reference positions to the new order; returns the new index of each old one.

        Parameters
        ----------
        agents, ids
            Agents and identities in the old order.
        target, target_ids
            The arrays in the new order, filled by this method.
        """
        place = self.key_buffer
        self.workers.each(_arrange, self.n, self.order, agents, ids, target, target_ids, reference, place)
        return place
