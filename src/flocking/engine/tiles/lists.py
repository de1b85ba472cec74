"""Neighbour lists in tiles: 16 agents side by side, their neighbours in rows of 16, so that loops vectorise.

Row k of a tile holds the k-th neighbour of each of its agents; where an agent has fewer, its own number
stands there and adds nothing. A graph with memory keeps whether a pair is linked in the top bit of the entry.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numba
import numpy as np

from flocking.engine.tiles.cells import Grid, cell_of
from flocking.engine.tiles.lanes import load, numbers_from, spread
from flocking.engine.tiles.reductions import bits_of, first_bit
from flocking.engine.tiles.threads import Workers

WIDTH = 16
"""Agents in a tile."""
TILES_IN_CHUNK = 64
"""Tiles that share one stretch of memory; fixed, so that lists never depend on the number of threads."""
LINKED = np.uint32(1 << 31)
"""Bit of an entry that says that the pair is linked."""
NUMBER = np.uint32((1 << 31) - 1)
"""Bits of an entry that say who the neighbour is."""

_compiled = numba.njit(cache=True, nogil=True, error_model="numpy")


@dataclass
class TileLists:
    """Neighbour lists of one graph.

    Parameters
    ----------
    rows
        Entries, shape (rows, 16), uint32.
    first
        First row of each tile, shape (tiles,), int64.
    count
        Rows of each tile, shape (tiles,), int32.
    """

    rows: Any
    first: Any
    count: Any

    def copy(self) -> TileLists:
        """A copy that shares nothing."""
        return TileLists(self.rows.copy(), self.first.copy(), self.count.copy())

    @property
    def nbytes(self) -> int:
        """Memory in use."""
        return int(self.rows.nbytes + self.first.nbytes + self.count.nbytes)


def empty_lists(tiles: int) -> TileLists:
    """Lists without a single entry."""
    return TileLists(np.empty((0, WIDTH), np.uint32), np.zeros(tiles, np.int64), np.zeros(tiles, np.int32))


@_compiled
def _held_links(i, rows, first, count, place, held):  # type: ignore[no-untyped-def]
    """New places of the agents that ``i`` (old place) was linked with."""
    tile, lane = i // WIDTH, i % WIDTH
    found = 0
    for row in range(first[tile], first[tile] + count[tile]):
        entry = rows[row, lane]
        if entry > NUMBER:
            held[found] = place[np.int64(entry & NUMBER)]
            found += 1
    return found


@_compiled
def _search_alone(tile, x, y, z, three, n, reach2, each_reach2, origin, inverse, shape, start, deep, found, numbers):  # type: ignore[no-untyped-def]
    """Neighbours of the agents of a tile, each by itself: for tiles at the ends of rows of cells."""
    nx, ny, nz = shape[0], shape[1], shape[2]
    for lane in range(WIDTH):
        i = tile * WIDTH + lane
        numbers[lane] = 0
        if i >= n:
            continue
        xi, yi, zi = x[i], y[i], z[i]
        limit = each_reach2[i] if each_reach2.shape[0] > 1 else reach2
        cx = cell_of(xi, origin[0], inverse, nx)
        cy = cell_of(yi, origin[1], inverse, ny)
        cz = cell_of(zi, origin[2], inverse, nz) if three else 0
        k = 0
        for layer in range(-1 if three else 0, 2 if three else 1):
            oz = (cz + layer + nz) % nz
            for line in range(-1, 2):
                base = (oz * ny + (cy + line + ny) % ny) * nx
                # Three cells in a row are one run of agents, or two where the row wraps.
                for part in range(2):
                    if cx == 0:
                        a, b = (0, 2) if part == 0 else (nx - 1, nx)
                    elif cx == nx - 1:
                        a, b = (cx - 1, nx) if part == 0 else (0, 1)
                    elif part == 0:
                        a, b = cx - 1, cx + 2
                    else:
                        a, b = 0, 0
                    for j in range(start[base + a], start[base + b]):
                        dx = x[j] - xi
                        dy = y[j] - yi
                        s = dx * dx + dy * dy
                        if three:
                            dz = z[j] - zi
                            s += dz * dz
                        if s < limit and j != i:
                            if k < deep:
                                found[k, lane] = j
                            k += 1
        numbers[lane] = k


@_compiled
def _search_together(tile, x, y, z, three, reach2, each_reach2, origin, inverse, shape, start, deep, found, numbers):  # type: ignore[no-untyped-def]
    """Neighbours of 16 agents in one row of cells, tested side by side; false where they are not in one row.

    Finds the neighbours of each agent in the order in which `_search_alone` does.
    """
    nx, ny, nz = shape[0], shape[1], shape[2]
    i, last = tile * WIDTH, tile * WIDTH + WIDTH - 1
    cy = cell_of(y[i], origin[1], inverse, ny)
    cz = cell_of(z[i], origin[2], inverse, nz) if three else 0
    low, high = cell_of(x[i], origin[0], inverse, nx), cell_of(x[last], origin[0], inverse, nx)
    if cy != cell_of(y[last], origin[1], inverse, ny) or low < 1 or high > nx - 2 or high - low > 64:
        return False
    if three and cz != cell_of(z[last], origin[2], inverse, nz):
        return False
    numbers[:] = 0
    own_x, own_y, own_z, own = load(x, i), load(y, i), load(z, i), numbers_from(i)
    limit = load(each_reach2, i) if each_reach2.shape[0] > 1 else spread(reach2)
    for layer in range(-1 if three else 0, 2 if three else 1):
        oz = (cz + layer + nz) % nz
        for line in range(-1, 2):
            base = (oz * ny + (cy + line + ny) % ny) * nx
            for j in range(start[base + low - 1], start[base + high + 2]):
                dx = x[j] - own_x
                dy = y[j] - own_y
                s = dx * dx + dy * dy
                if three:
                    dz = z[j] - own_z
                    s = s + dz * dz
                bits = bits_of((s < limit) & (own != np.uint32(j)))
                while bits:
                    lane = first_bit(bits)
                    bits &= bits - 1
                    k = numbers[lane]
                    if k < deep:
                        found[k, lane] = j
                    numbers[lane] = k + 1
    return True


@_compiled
def _build(  # type: ignore[no-untyped-def]
    first_chunk, last_chunk, q, n, reach2, each_reach2, origin, inverse, shape, start, deep,
    rows, first, count, stretch, room, need, deepest,
    carry, begin, begin2, order, place, old_rows, old_first, old_count, lost,
):  # fmt: skip
    three = q.shape[0] == 3
    x = q[0]
    y = q[1]
    z = q[2] if three else q[1]
    found = np.empty((deep, WIDTH), np.uint32)
    held = np.empty(deep if carry else 1, np.int64)
    numbers = np.empty(WIDTH, np.int64)
    tiles = first.shape[0]
    for chunk in range(first_chunk, last_chunk):
        cursor = stretch[chunk]
        end = cursor + room[chunk]
        wanted = 0
        for tile in range(chunk * TILES_IN_CHUNK, min((chunk + 1) * TILES_IN_CHUNK, tiles)):
            if (tile + 1) * WIDTH > n or not _search_together(
                tile, x, y, z, three, reach2, each_reach2, origin, inverse, shape, start, deep, found, numbers
            ):
                _search_alone(
                    tile, x, y, z, three, n, reach2, each_reach2, origin, inverse, shape, start, deep, found, numbers
                )
            most = numbers.max()
            deepest[chunk] = max(deepest[chunk], most)
            wanted += most
            if most > deep or cursor + most > end:
                cursor = end + 1
                continue
            for lane in range(WIDTH):
                i = tile * WIDTH + lane
                if begin:
                    limit = begin2[min(i, n - 1)] if begin2.shape[0] > 1 else begin2[0]
                    for k in range(numbers[lane]):
                        j = np.int64(found[k, lane])
                        dx = x[j] - x[i]
                        dy = y[j] - y[i]
                        s = dx * dx + dy * dy
                        if three:
                            dz = z[j] - z[i]
                            s += dz * dz
                        if s < limit:
                            found[k, lane] |= LINKED
                elif carry and i < n:
                    links = _held_links(order[i], old_rows, old_first, old_count, place, held)
                    for h in range(links):
                        here = False
                        for k in range(numbers[lane]):
                            if np.int64(found[k, lane] & NUMBER) == held[h]:
                                found[k, lane] |= LINKED
                                here = True
                        if not here:
                            # A linked pair has left the reach: say who, where the caller can see it.
                            lost[0] = i
                            lost[1] = held[h]
                for k in range(numbers[lane]):
                    rows[cursor + k, lane] = found[k, lane]
                for k in range(numbers[lane], most):
                    rows[cursor + k, lane] = np.uint32(i)
            first[tile] = cursor
            count[tile] = most
            cursor += most
        need[chunk] = wanted


class TooManyNeighboursError(Exception):
    """The lists would exceed the memory allowed to them.

    Parameters
    ----------
    bytes_needed
        What they would take.
    """

    def __init__(self, bytes_needed: float) -> None:
        self.bytes_needed = bytes_needed
        super().__init__(bytes_needed)


class ListBuilder:
    """Builds the lists of one moving graph again and again, growing where they must.

    Parameters
    ----------
    n
        Number of agents.
    memory_limit
        Largest size of the lists in bytes.
    workers
        Threads to use.
    """

    def __init__(self, n: int, memory_limit: float, workers: Workers) -> None:
        self.n, self.workers, self.memory_limit = n, workers, memory_limit
        self.tiles = (n + WIDTH - 1) // WIDTH
        self.chunks = (self.tiles + TILES_IN_CHUNK - 1) // TILES_IN_CHUNK
        self.room = np.zeros(self.chunks, np.int64)
        self.deep = 32
        self.spare: TileLists | None = None

    def build(
        self, q: Any, reach: float, each_reach: Any, grid: Grid, start: Any, old: TileLists | None, order: Any,
        place: Any, begin2: Any | None, remember: bool,
    ) -> tuple[TileLists, tuple[int, int] | None]:  # fmt: skip
        """Lists of all pairs closer than ``reach``, or than the sensing agent's entry of ``each_reach``.

        Parameters
        ----------
        q
            Positions in sorted order, shape (m, n or more).
        reach, each_reach
            Distances; ``each_reach`` has length 1 where ``reach`` holds for all.
        grid, start
            The sort's cells.
        old, order, place
            The lists before the sort, old place of each agent, and new place of each.
        begin2
            Squared distance, or one per agent, below which pairs start linked; None where links are carried over.
        remember
            Carry the links of ``old`` over.

        Returns
        -------
        tuple
            The lists, and a linked pair (new places) that has left the reach, or None.

        Raises
        ------
        TooManyNeighboursError
            When the lists would exceed the memory limit.
        """
        carry = remember and old is not None
        before = old if carry and old is not None else empty_lists(1)
        if old is not None and not carry:
            self.spare = old
        if carry:
            self.deep = max(self.deep, int(before.count.max(initial=0)))
        dtype = q.dtype.type
        limits = np.asarray(each_reach, dtype=q.dtype) ** 2
        origin, shape = np.array(grid.origin), np.array(grid.shape)
        while True:
            total = int(self.room.sum())
            if total * WIDTH * 4.0 > self.memory_limit:
                raise TooManyNeighboursError(total * WIDTH * 4.0)
            lists = self._reuse(total)
            stretch = np.cumsum(self.room) - self.room
            need = np.zeros(self.chunks, np.int64)
            deepest = np.zeros(self.chunks, np.int64)
            lost = np.full(2, -1, np.int64)
            self.workers.each_large(
                _build, self.chunks, q, self.n, dtype(reach) ** 2, limits, origin, grid.inverse, shape, start,
                self.deep,
                lists.rows, lists.first, lists.count, stretch, self.room, need, deepest,
                carry, begin2 is not None, limits if begin2 is None else begin2, order, place,
                before.rows, before.first, before.count, lost,
            )  # fmt: skip
            most = int(deepest.max(initial=0))
            if most <= self.deep and (need <= self.room).all():
                if carry:
                    self.spare = old
                return lists, (int(lost[0]), int(lost[1])) if lost[0] >= 0 else None
            self.deep = max(self.deep, most + most // 4)
            grown = need + need // 8 + 8
            self.room = np.where(need > self.room, grown, self.room)
            self.spare = None

    def _reuse(self, total: int) -> TileLists:
        spare, self.spare = self.spare, None
        if spare is not None and len(spare.rows) >= total and len(spare.rows) <= 2 * total + 1024:
            return spare
        return TileLists(
            np.empty((max(total, 1), WIDTH), np.uint32), np.zeros(self.tiles, np.int64), np.zeros(self.tiles, np.int32)
        )


@_compiled
def _fixed(first_tile, last_tile, n, ids, place, offsets, neighbours, rows, first, count):  # type: ignore[no-untyped-def]
    for tile in range(first_tile, last_tile):
        for lane in range(WIDTH):
            i = tile * WIDTH + lane
            k = 0
            if i < n:
                for at in range(offsets[ids[i]], offsets[ids[i] + 1]):
                    rows[first[tile] + k, lane] = np.uint32(place[neighbours[at]]) | LINKED
                    k += 1
            for rest in range(k, count[tile]):
                rows[first[tile] + rest, lane] = np.uint32(i)


def fixed_lists(ids: Any, place: Any, offsets: Any, neighbours: Any, workers: Workers) -> TileLists:
    """Lists of given links.

    Parameters
    ----------
    ids
        Identity of the agent in each place, shape (n or more,).
    place
        Place of each identity, shape (n,).
    offsets, neighbours
        Sensed identities of identity i are ``neighbours[offsets[i] : offsets[i + 1]]``.
    """
    n = len(place)
    tiles = (n + WIDTH - 1) // WIDTH
    degree = np.zeros(tiles * WIDTH, np.int64)
    degree[:n] = np.diff(offsets)[ids[:n]]
    count = degree.reshape(tiles, WIDTH).max(axis=1).astype(np.int32)
    first = (np.cumsum(count) - count).astype(np.int64)
    lists = TileLists(np.empty((max(int(count.sum()), 1), WIDTH), np.uint32), first, count)
    workers.each(_fixed, tiles, n, ids, place, offsets, neighbours, lists.rows, first, count)
    return lists
