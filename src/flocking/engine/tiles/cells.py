"""Agents sorted by cells of a grid that wraps around: a counting sort in two levels, in parallel and stable.

The grid never holds more cells than agents call for. A group that is wider than the grid wraps around it:
far places then share cells, which costs a few needless distance tests and nothing else.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numba
import numpy as np

from flocking.engine.tiles.threads import Workers

MOST_BUCKETS = 4096
CHUNK = 16384
"""Agents counted together; fixed, so that the order never depends on the number of threads."""

ROUNDING = 1e-9
"""Cells are wider than the reach by this fraction, so that rounding never hides a neighbour two cells away."""

Ints = np.ndarray[Any, np.dtype[np.int32]]


@dataclass(frozen=True)
class Grid:
    """A grid of cells.

    Parameters
    ----------
    origin
        Lowest corner, three coordinates (the last is 0 in the plane).
    inverse
        One over the width of a cell.
    shape
        Cells along each axis, three numbers (the last is 1 in the plane); at least 3 along an axis in use.
    """

    origin: tuple[float, float, float]
    inverse: float
    shape: tuple[int, int, int]

    @property
    def cells(self) -> int:
        """Number of cells."""
        return self.shape[0] * self.shape[1] * self.shape[2]


def choose_grid(low: Any, high: Any, reach: float, n: int) -> Grid:
    """A grid of cells of width ``reach`` over the box from ``low`` to ``high``, wrapped where it would be too large.

    Parameters
    ----------
    low, high
        Corners of the box, shape (m,).
    reach
        Largest distance at which agents must find each other.
    n
        Number of agents: the grid has at most about 2 n cells.
    """
    m = len(low)
    width = reach * (1.0 + ROUNDING)
    wanted = np.maximum(np.floor((np.asarray(high) - np.asarray(low)) / width) + 1.0, 3.0)
    most = max(2.0 * n, 3.0**m)
    if wanted.prod() > most:
        # Shrink the longest axes first: a thin crowd keeps its own shape.
        order = np.argsort(wanted)
        left, axes = most, m
        for axis in order:
            share = left ** (1.0 / axes)
            wanted[axis] = max(3.0, min(wanted[axis], np.floor(share)))
            left /= wanted[axis]
            axes -= 1
    shape = [int(k) for k in wanted] + [1] * (3 - m)
    origin = [float(x) for x in low] + [0.0] * (3 - m)
    return Grid((origin[0], origin[1], origin[2]), 1.0 / width, (shape[0], shape[1], shape[2]))


_compiled = numba.njit(cache=True, nogil=True, error_model="numpy")


@_compiled
def cell_of(x, origin, inverse, count):  # type: ignore[no-untyped-def]
    """Cell of a coordinate along one axis, wrapped."""
    c = np.int64((np.float64(x) - origin) * inverse)
    return c if c < count else c % count


@_compiled
def _count(first, last, q, n, origin, inverse, shape, shift, key, counts):  # type: ignore[no-untyped-def]
    three = q.shape[0] == 3
    for chunk in range(first, last):
        counts[chunk, :] = 0
        for i in range(chunk * CHUNK, min((chunk + 1) * CHUNK, n)):
            k = cell_of(q[1, i], origin[1], inverse, shape[1])
            if three:
                k += shape[1] * cell_of(q[2, i], origin[2], inverse, shape[2])
            k = k * shape[0] + cell_of(q[0, i], origin[0], inverse, shape[0])
            key[i] = k
            counts[chunk, k >> shift] += 1


@_compiled
def _scatter(first, last, n, shift, key, places, key_there, index_there):  # type: ignore[no-untyped-def]
    for chunk in range(first, last):
        for i in range(chunk * CHUNK, min((chunk + 1) * CHUNK, n)):
            k = key[i]
            at = places[chunk, k >> shift]
            places[chunk, k >> shift] = at + 1
            key_there[at] = k
            index_there[at] = i


@_compiled
def _settle(first, last, shift, cells, begins, key_there, index_there, start, order):  # type: ignore[no-untyped-def]
    for bucket in range(first, last):
        low = bucket << shift
        high = min((bucket + 1) << shift, cells)
        fill = np.zeros(high - low + 1, np.int32)
        for at in range(begins[bucket], begins[bucket + 1]):
            fill[key_there[at] - low + 1] += 1
        fill[0] = begins[bucket]
        for c in range(high - low):
            fill[c + 1] += fill[c]
            start[low + c] = fill[c]
        for at in range(begins[bucket], begins[bucket + 1]):
            c = key_there[at] - low
            order[fill[c]] = index_there[at]
            fill[c] += 1


@_compiled
def _permute(first, last, order, source, target):  # type: ignore[no-untyped-def]
    for row in range(source.shape[0]):
        a = source[row]
        b = target[row]
        for i in range(first, last):
            b[i] = a[order[i]]


class Sorter:
    """Buffers of the sort, kept from one rebuild to the next.

    Parameters
    ----------
    n
        Number of agents.
    workers
        Threads to use.
    """

    def __init__(self, n: int, workers: Workers) -> None:
        self.n, self.workers = n, workers
        self.key = np.empty(n, np.int32)
        self.key_there = np.empty(n, np.int32)
        self.index_there = np.empty(n, np.int32)
        self.order: Ints = np.empty(n, np.int32)
        self.start: Ints = np.empty(1, np.int32)
        self.grid = Grid((0.0, 0.0, 0.0), 1.0, (3, 3, 1))

    def sort(self, q: Any, reach: float) -> None:
        """Sort agents at ``q``, shape (m, at least n), into cells of width ``reach``: fills `order` and `start`."""
        n = self.n
        low, high = extent(q[:, :n])
        grid = self.grid = choose_grid(low, high, reach, n)
        cells = grid.cells
        shift = 0
        while (cells >> shift) >= MOST_BUCKETS:
            shift += 1
        buckets = ((cells - 1) >> shift) + 1
        chunks = (n + CHUNK - 1) // CHUNK
        counts = np.empty((chunks, buckets), np.int32)
        each = self.workers.each_large
        origin, shape = np.array(grid.origin), np.array(grid.shape)
        each(_count, chunks, q, n, origin, grid.inverse, shape, shift, self.key, counts)
        ends = np.cumsum(counts.T.ravel(), dtype=np.int64)
        places = np.ascontiguousarray((ends - counts.T.ravel()).reshape(buckets, chunks).T)
        begins = np.append(places[0], n)
        each(_scatter, chunks, n, shift, self.key, places, self.key_there, self.index_there)
        if len(self.start) != cells + 1:
            self.start = np.empty(cells + 1, np.int32)
        each(
            _settle, buckets, shift, cells, begins, self.key_there, self.index_there, self.start, self.order
        )  # fmt: skip
        self.start[cells] = n

    def permute(self, source: Any, target: Any) -> None:
        """Rows of ``source``, shape (k, n), into the new order."""
        self.workers.each(_permute, self.n, self.order, source, target)


def extent(q: Any) -> tuple[Any, Any]:
    """Lowest and highest coordinates of positions of shape (m, n), as float64."""
    return q.min(axis=1).astype(np.float64), q.max(axis=1).astype(np.float64)


def crowding(start: Ints, dimension: int) -> float:
    """A lower bound of the number of ordered pairs within reach, from the cell counts alone.

    A cell splits into 2^m parts whose agents are all within reach of each other.
    """
    counts = np.diff(start).astype(np.float64)
    parts = 2.0**dimension
    return float((counts * np.maximum(counts / parts - 1.0, 0.0)).sum())
