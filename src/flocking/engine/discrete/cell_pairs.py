"""Pairs of agents within a distance of each other, from a cell list."""

from __future__ import annotations

import math

import numpy as np

from flocking.arrays import Array, Indices
from flocking.engine.kernels.displacements import nearest_difference
from flocking.formula.native.functions import native
from flocking.model.space import Space

AXES = 3
"""Numbers of a point in the kernels; those of axes that there are not are 0."""

WIDER = 1.0 + 1e-9
"""Share of the distance by which cells are wider at least."""

ROUNDINGS = 16.0
"""Rounding units of the largest coordinate by which cells are wider, since wrapping a coordinate rounds it."""

MOST_CELLS = 2
"""Largest number of cells for each agent, a bound on memory for a group that is spread thin."""

GROWTH = 1.2
"""Room for pairs, by the number found the last time."""

FEWEST = 16
"""Room for pairs at first, for each agent."""


@native
def _sort(points, lengths, origin, inverse, shape, cell, start, order):  # type: ignore[no-untyped-def]
    """Sort agents by their cells, those of a cell in their order; cells of axes that repeat are of wrapped places."""
    n, cells = points.shape[0], start.shape[0] - 1
    for c in range(cells + 1):
        start[c] = 0
    for i in range(n):
        found = 0
        for k in range(3):
            x = points[i, k] - origin[k]
            if lengths[k] > 0.0:
                x -= lengths[k] * math.floor(x / lengths[k])
            place = int(x * inverse[k])
            place = min(max(place, 0), shape[k] - 1)
            found = found * shape[k] + place
        cell[i] = found
        start[found + 1] += 1
    for c in range(cells):
        start[c + 1] += start[c]
    for i in range(n):
        order[start[cell[i]]] = i
        start[cell[i]] += 1
    for c in range(cells):
        start[cells - c] = start[cells - c - 1]
    start[0] = 0


@native
def _search(points, lengths, shape, cell, start, order, reach, senders, sensed, distances):  # type: ignore[no-untyped-def]
    """Ordered pairs up to ``reach`` apart as far as there is room, for points in the order of their cells.

    Those of one agent follow each other, sorted; returns how many there are.
    """
    n, room, total = points.shape[0], senders.shape[0], 0
    for place in range(n):
        i = order[place]
        c = cell[i]
        z = c % shape[2]
        y = (c // shape[2]) % shape[1]
        x = c // (shape[2] * shape[1])
        begin = total
        for a in range(min(shape[0], 3)):
            for b in range(min(shape[1], 3)):
                for e in range(min(shape[2], 3)):
                    u = (x + a + shape[0] - 1) % shape[0] if shape[0] > 2 else a
                    v = (y + b + shape[1] - 1) % shape[1] if shape[1] > 2 else b
                    w = (z + e + shape[2] - 1) % shape[2] if shape[2] > 2 else e
                    near = (u * shape[1] + v) * shape[2] + w
                    for at in range(start[near], start[near + 1]):
                        square = 0.0
                        for k in range(3):
                            d = points[at, k] - points[place, k]
                            if lengths[k] > 0.0:
                                d = nearest_difference(d, lengths[k])
                            square += d * d
                        r = math.sqrt(square)
                        if at != place and r <= reach:
                            j = order[at]
                            if total < room:
                                # Few are found for one agent: they are sorted as they come.
                                free = total
                                while free > begin and sensed[free - 1] > j:
                                    sensed[free] = sensed[free - 1]
                                    distances[free] = distances[free - 1]
                                    free -= 1
                                sensed[free] = j
                                distances[free] = r
                                senders[total] = i
                            total += 1
    return total


class CellPairs:
    """Search for pairs up to a distance apart.

    Parameters
    ----------
    space
        The space, of at most three dimensions.
    reach
        The distance; on axes that repeat below half their length.
    n
        Number of agents.
    """

    def __init__(self, space: Space, reach: float, n: int) -> None:
        self.space, self.reach, self.n = space, reach, n
        self._room = FEWEST * n
        self._cell = np.empty(n, dtype=np.int64)
        self._order = np.empty(n, dtype=np.int64)

    def near(self, q: Array) -> tuple[Indices, Indices, Array]:
        """Ordered pairs (i, j) up to the distance apart and their distances; those of one agent follow each other.

        Parameters
        ----------
        q
            Positions, shape (N, m).
        """
        n, m = q.shape
        points = np.zeros((n, AXES))
        points[:, :m] = q
        lengths = np.zeros(AXES)
        for k, length in enumerate(self.space.lengths):
            lengths[k] = length if np.isfinite(length) else 0.0
        origin, inverse, shape = self._grid(points, lengths)
        start = np.empty(int(shape.prod()) + 1, dtype=np.int64)
        _sort(points, lengths, origin, inverse, shape, self._cell, start, self._order)
        points = points[self._order]
        while True:
            senders, sensed = (np.empty(self._room, dtype=np.int64) for _ in range(2))
            distances = np.empty(self._room)
            total = int(
                _search(points, lengths, shape, self._cell, start, self._order, self.reach, senders, sensed, distances)
            )
            fits, self._room = total <= self._room, max(int(GROWTH * total), n)
            if fits:
                return senders[:total], sensed[:total], distances[:total]

    def _grid(self, points: Array, lengths: Array) -> tuple[Array, Array, Indices]:
        """Lowest corner, reciprocal width of the cells and their number along each axis.

        Cells are wider than the distance, so that neighbours are in cells that touch; those of axes that repeat fill
        the length.
        """
        low, high = points.min(axis=0), points.max(axis=0)
        largest = max(float(np.abs(points).max()), float(lengths.max()))
        width = self.reach * WIDER + ROUNDINGS * float(np.finfo(np.float64).eps) * largest
        extent = np.where(lengths > 0.0, lengths, high - low)
        shape = np.maximum(np.floor(extent / width), 1.0)
        most = max(MOST_CELLS * self.n, 1)
        while shape.prod() > most:
            widest = int(np.argmax(shape))
            shape[widest] = max(math.floor(shape[widest] * most / shape.prod()), math.floor(0.5 * shape[widest]), 1.0)
        origin = np.where(lengths > 0.0, 0.0, low)
        inverse = np.where(extent > 0.0, shape / np.where(extent > 0.0, extent, 1.0), 0.0)
        return origin, inverse, shape.astype(np.int64)
