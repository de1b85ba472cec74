"""Neighbour lists (Verlet lists) for tiles of 16 agents, with neighbours in rows of 16, so that loops vectorise.

Row k of a tile contains the k-th neighbour of each of its agents. An agent with fewer neighbours is padded with its own
number, which contributes nothing. For a graph with memory the top bit of an entry says whether the pair is linked.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import Array, Numbers, Numbers32, Reals
from flocking.engine.fixed_step.threads import Workers
from flocking.engine.tiles.neighbours.cell_list import Grid, cell_of
from flocking.engine.tiles.neighbours.nearest_image import to_nearest
from flocking.engine.tiles.simd.interleaved_arrays import column
from flocking.engine.tiles.simd.reductions import bits_of, first_bit, highest
from flocking.engine.tiles.simd.vectors import load, numbers_from, select, spread, store
from flocking.formula.native.functions import native

SPARE_ROWS = 1024
"""Rows by which reused memory may exceed twice the need; for small groups the excess is negligible."""
WIDTH = 16
"""Agents in a tile."""
TILES_IN_CHUNK = 64
"""Tiles whose rows are contiguous in memory; fixed, so that lists do not depend on the number of threads."""
LONGEST = 64
"""Largest number of cells in a row that the agents of a tile may span to be searched together."""
LINKED = np.uint32(1 << 31)
"""Bit of an entry that is set if the pair is linked."""
NUMBER = np.uint32((1 << 31) - 1)
"""Bits of an entry with the number of the neighbour."""
NOBODY = np.zeros(0, np.int32)
"""Cells of copies where there are none."""


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

    rows: NDArray[np.uint32]
    first: Numbers
    count: Numbers32

    def copy(self) -> TileLists:
        """A deep copy."""
        return TileLists(self.rows.copy(), self.first.copy(), self.count.copy())

    @property
    def nbytes(self) -> int:
        """Memory in use."""
        return int(self.rows.nbytes + self.first.nbytes + self.count.nbytes)


class Cells(NamedTuple):
    """Agents sorted by the cells of a grid.

    Parameters
    ----------
    agents
        Positions and velocities in sorted order, shape (16 tiles, 2m).
    n
        Number of agents.
    origin, inverse, shape
        See `flocking.engine.tiles.neighbours.cell_list.Grid`, as arrays.
    start
        Index of the first agent of each cell, and the number of agents, shape (cells + 1,).
    box
        See `flocking.engine.tiles.neighbours.nearest_image.box_of`.
    beside
        As ``start``, for copies of agents of other processes, which stand behind the agents; shape (0,) for none.
    offset
        Index of the first of them.
    """

    agents: Reals
    n: int
    origin: Array
    inverse: Array
    shape: Numbers
    start: Numbers32
    box: Reals
    beside: Numbers32
    offset: int


class Reach(NamedTuple):
    """Squared distance within which agents are listed, and that of each sensing agent if they differ."""

    square: np.floating
    each: Reals


class ListRoom(NamedTuple):
    """Memory for the lists of the chunks.

    Parameters
    ----------
    rows, first, many
        See `TileLists`; ``many`` is its ``count``, which is a method of tuples.
    stretch, capacity
        First row and number of rows of each chunk, shape (chunks,).
    need
        Receives the number of rows that each chunk needs, shape (chunks,).
    numbers
        Work space for the numbers of neighbours of a tile, shape (chunks, 16).
    """

    rows: NDArray[np.uint32]
    first: Numbers
    many: Numbers32
    stretch: Numbers
    capacity: Numbers
    need: Numbers
    numbers: NDArray[np.uint32]


@native
def _search(first_chunk: int, last_chunk: int, cells: Cells, reach: Reach, room: ListRoom) -> None:
    """Find the neighbours of all agents of some chunks."""
    tiles = room.first.shape[0]
    for chunk in range(first_chunk, last_chunk):
        cursor = room.stretch[chunk]
        end = cursor + room.capacity[chunk]
        needed = np.int64(0)
        found = room.numbers[chunk]
        for tile in range(chunk * TILES_IN_CHUNK, min((chunk + 1) * TILES_IN_CHUNK, tiles)):
            base = tile * WIDTH
            own = numbers_from(base)
            store(found, 0, own ^ own)
            _search_tile(cells, reach, room.rows, base, cursor, end, found)
            held = load(found, 0)
            most = np.int64(highest(held))
            needed += most
            if cursor + most > end:
                cursor = np.int64(end + 1)
                continue
            for number in range(most):
                entries = room.rows[cursor + number]
                store(entries, 0, select(held > np.uint32(number), load(entries, 0), own))
            room.first[tile] = cursor
            room.many[tile] = most
            cursor += most
        room.need[chunk] = needed


def _search_tile(
    cells: Cells, reach: Reach, rows: NDArray[np.uint32], base: int, cursor: int, end: int, found: NDArray[np.uint32]
) -> None:
    """Find the neighbours of the agents of one tile, from row ``cursor`` on; their numbers are written to ``found``."""
    agents, shape = cells.agents, cells.shape
    three = agents.shape[1] == 6
    many = min(WIDTH, cells.n - base)
    lane = 0
    while lane < many:
        # Agents in one row of cells have the same candidates.
        low, cy, cz = _cell(cells, base + lane)
        high = low
        last = lane + 1
        while last < many:
            c, y, z = _cell(cells, base + last)
            if c < high or c > low + LONGEST or y != cy or z != cz:
                break
            high = c
            last += 1
        members = (1 << last) - (1 << lane)
        for line in range(9 if three else 3):
            row = (cy + line % 3 - 1 + shape[1]) % shape[1]
            if three:
                row += shape[1] * ((cz + line // 3 - 1 + shape[2]) % shape[2])
            # Cells from low - 1 to high + 1 are one range of agents, or two if the row wraps.
            a, b, c = low - 1, high + 2, 0
            if b - a >= shape[0]:
                a, b = 0, shape[0]
            elif a < 0:
                a, c = 0, 1
            elif b > shape[0]:
                b, c = shape[0], 2
            for part in range(2 if c else 1):
                if part:
                    a, b = (shape[0] - 1, shape[0]) if c == 1 else (0, 1)
                first, behind = cells.start[row * shape[0] + a], cells.start[row * shape[0] + b]
                _test_candidates(agents, cells.box, reach, rows, base, members, first, behind, cursor, end, found)
                if cells.beside.shape[0]:
                    first = cells.offset + cells.beside[row * shape[0] + a]
                    behind = cells.offset + cells.beside[row * shape[0] + b]
                    _test_candidates(agents, cells.box, reach, rows, base, members, first, behind, cursor, end, found)
        lane = last


def _cell(cells: Cells, i: int) -> tuple[int, int, int]:
    """Cell of an agent along each axis; 0 along the third axis in two dimensions."""
    agents, origin, inverse, shape = cells.agents, cells.origin, cells.inverse, cells.shape
    x = cell_of(agents[i, 0], origin[0], inverse[0], shape[0])
    y = cell_of(agents[i, 1], origin[1], inverse[1], shape[1])
    z = cell_of(agents[i, 2], origin[2], inverse[2], shape[2]) if agents.shape[1] == 6 else 0
    return x, y, z


def _test_candidates(
    agents: Reals, box: Reals, reach: Reach, rows: NDArray[np.uint32], base: int, members: int, first: int,
    behind: int, cursor: int, end: int, found: NDArray[np.uint32],
) -> None:  # fmt: skip
    """List the candidates of a range within reach of some agents of a tile; these are tested together."""
    three = agents.shape[1] == 6
    own = numbers_from(base)
    own_x, own_y = column(agents, base, 0), column(agents, base, 1)
    own_z = column(agents, base, 2 if three else 1)
    limit = load(reach.each, base) if reach.each.shape[0] > 1 else spread(reach.square)
    for j in range(first, behind):
        dx = agents[j, 0] - own_x
        dy = agents[j, 1] - own_y
        if box.shape[0]:
            dx, dy = to_nearest(dx, box, 0, agents.shape[1] // 2), to_nearest(dy, box, 1, agents.shape[1] // 2)
        s = dx * dx + dy * dy
        if three:
            dz = agents[j, 2] - own_z
            if box.shape[0]:
                dz = to_nearest(dz, box, 2, 3)
            s = s + dz * dz
        bits = bits_of((s < limit) & (own != np.uint32(j))) & members
        while bits:
            at = first_bit(bits)
            bits &= bits - 1
            k = np.int64(found[at])
            found[at] = np.uint32(k + 1)
            if cursor + k < end:
                rows[cursor + k, at] = j


@native
def _begin_links(first_tile, last_tile, agents, n, box, limits, rows, first, count):  # type: ignore[no-untyped-def]
    """Link all listed pairs closer than the limit of the sensing agent."""
    m = agents.shape[1] // 2
    for tile in range(first_tile, last_tile):
        for row in range(first[tile], first[tile] + count[tile]):
            for lane in range(WIDTH):
                i, j = tile * WIDTH + lane, np.int64(rows[row, lane])
                if i == j or i >= n:
                    continue
                s = agents[i, 0] * 0
                for k in range(m):
                    d = agents[j, k] - agents[i, k]
                    if box.shape[0]:
                        d = to_nearest(d, box, k, m)
                    s += d * d
                if s < limits[i if limits.shape[0] > 1 else 0]:
                    rows[row, lane] |= LINKED


@native
def _carry_links(  # type: ignore[no-untyped-def]
    first_tile, last_tile, n, order, place, old_rows, old_first, old_count, rows, first, count, lost
):
    """Link the pairs that were linked before the sort; report a linked pair that is no longer listed."""
    for tile in range(first_tile, last_tile):
        for lane in range(min(WIDTH, n - tile * WIDTH)):
            i = tile * WIDTH + lane
            before, there = order[i] // WIDTH, order[i] % WIDTH
            for old in range(old_first[before], old_first[before] + old_count[before]):
                entry = old_rows[old, there]
                if entry <= NUMBER:
                    continue
                j = place[np.int64(entry & NUMBER)]
                here = False
                for row in range(first[tile], first[tile] + count[tile]):
                    if np.int64(rows[row, lane] & NUMBER) == j:
                        rows[row, lane] |= LINKED
                        here = True
                if not here:
                    # Return the pair to the caller.
                    lost[0] = i
                    lost[1] = j


class TooManyNeighboursError(Exception):
    """The lists would exceed their memory limit.

    Parameters
    ----------
    bytes_needed
        Memory that they would need.
    """

    def __init__(self, bytes_needed: float) -> None:
        self.bytes_needed = bytes_needed
        super().__init__(bytes_needed)


class ListBuilder:
    """Builds the lists of one moving graph; reuses and enlarges their memory.

    Parameters
    ----------
    n
        Number of agents.
    memory_limit
        Largest size of the lists in bytes.
    workers
        Threads to use.
    box
        See `flocking.engine.tiles.neighbours.nearest_image.box_of`.
    """

    def __init__(self, n: int, memory_limit: float, workers: Workers, box: Reals) -> None:
        self.n, self.workers, self.memory_limit, self.box = n, workers, memory_limit, box
        self.tiles = (n + WIDTH - 1) // WIDTH
        self.chunks = (self.tiles + TILES_IN_CHUNK - 1) // TILES_IN_CHUNK
        self.capacity = np.zeros(self.chunks, np.int64)
        self.spare: TileLists | None = None

    def build(
        self, agents: Reals, reach: float, each_reach: Reals, grid: Grid, start: Numbers32, old: TileLists | None,
        order: Numbers32, place: Numbers32, begin2: Reals | None, remember: bool, beside: Numbers32 = NOBODY,
    ) -> tuple[TileLists, tuple[int, int] | None]:  # fmt: skip
        """Build the lists of all pairs closer than ``reach``, or than the sensing agent's entry of ``each_reach``.

        Parameters
        ----------
        agents
            Positions and velocities in sorted order, shape (16 tiles, 2m).
        reach, each_reach
            Distances; ``each_reach`` has length 1 if ``reach`` applies to all, else 16 tiles.
        grid, start
            The cells of the sort.
        old, order, place
            The lists before the sort, the old index of each agent, and the new index of each.
        begin2
            Squared distance, or one per agent, below which pairs start linked; None if links are carried over.
        remember
            Whether the links of ``old`` are carried over.
        beside
            As ``start``, for copies of agents of other processes in the rows behind the tiles.

        Returns
        -------
        tuple
            The lists, and a linked pair (new indices) beyond the reach, or None.

        Raises
        ------
        TooManyNeighboursError
            If the lists would exceed the memory limit.
        """
        if not remember and old is not None:
            self.spare = old
        lists = self._searched(agents, reach, each_reach, grid, start, beside)
        lost = np.full(2, -1, np.int64)
        here = (lists.rows, lists.first, lists.count)
        if begin2 is not None:
            self.workers.each(_begin_links, self.tiles, agents, self.n, self.box, begin2, *here)
        elif remember and old is not None:
            before = (old.rows, old.first, old.count)
            self.workers.each(_carry_links, self.tiles, self.n, order, place, *before, *here, lost)
            self.spare = old
        return lists, (int(lost[0]), int(lost[1])) if lost[0] >= 0 else None

    def _searched(
        self, agents: Reals, reach: float, each_reach: Reals, grid: Grid, start: Numbers32, beside: Numbers32
    ) -> TileLists:
        """Lists without links, with sufficient capacity."""
        dtype = agents.dtype.type
        limits = np.asarray(each_reach, dtype=dtype) ** 2
        places = np.array(grid.origin), np.array(grid.inverse), np.array(grid.shape)
        cells = Cells(agents, self.n, *places, start, self.box, beside, self.tiles * WIDTH)
        distances = Reach(dtype(reach) ** 2, limits)
        numbers = np.empty((self.chunks, WIDTH), np.uint32)
        while True:
            total = int(self.capacity.sum())
            if total * WIDTH * 4.0 > self.memory_limit:
                raise TooManyNeighboursError(total * WIDTH * 4.0)
            lists = self._reuse(total)
            stretch = np.cumsum(self.capacity) - self.capacity
            need = np.zeros(self.chunks, np.int64)
            room = ListRoom(lists.rows, lists.first, lists.count, stretch, self.capacity, need, numbers)
            self.workers.each_large(_search, self.chunks, cells, distances, room)
            if (need <= self.capacity).all():
                return lists
            self.capacity = np.where(need > self.capacity, need + need // 8 + 8, self.capacity)
            self.spare = None

    def _reuse(self, total: int) -> TileLists:
        spare, self.spare = self.spare, None
        if spare is not None and len(spare.rows) >= total and len(spare.rows) <= 2 * total + SPARE_ROWS:
            return spare
        return TileLists(
            np.empty((max(total, 1), WIDTH), np.uint32), np.zeros(self.tiles, np.int64), np.zeros(self.tiles, np.int32)
        )
