"""Neighbour lists (Verlet lists) for tiles of 16 agents, with neighbours in rows of 16, so that loops vectorise.

Row k of a tile contains the k-th neighbour of each of its agents. An agent with fewer neighbours is padded with its own
number, which contributes nothing. For a graph with memory the top bit of an entry states whether the pair is linked.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import Numbers, Numbers32, Reals
from flocking.engine.fixed_step.threads import Workers
from flocking.engine.tiles.neighbours.cell_list import Grid
from flocking.engine.tiles.neighbours.cell_search import TILES_IN_CHUNK, Cells, ListRoom, Reach, search
from flocking.engine.tiles.neighbours.nearest_image import to_nearest
from flocking.engine.tiles.simd.aligned_memory import aligned
from flocking.engine.tiles.simd.reductions import bits_of
from flocking.engine.tiles.simd.vectors import load, select, store
from flocking.formula.native.functions import native

SPARE_ROWS = 1024
"""Rows by which reused memory may exceed twice the need; for small groups the excess is negligible."""
ALMOST_FULL = 16
"""A chunk is almost full if less than this part of its rows is free, half of the eighth that it got in excess."""
WIDTH = 16
"""Agents in a tile."""
ENTRY = 4
"""Memory of an entry of a list in bytes."""
LINKED = np.uint32(1 << 31)
"""Bit of an entry that is set if the pair is linked."""
NUMBER = np.uint32((1 << 31) - 1)
"""Bits of an entry with the number of the neighbour."""
NOBODY = np.zeros(0, np.int32)
"""Cells of copies where there are none."""
NO_VIEWS: Reals = np.zeros((0, 1))
"""Views of a graph under which agents see all around."""


class FirstLinks(NamedTuple):
    """Which pairs start linked.

    Parameters
    ----------
    limits
        Squared distance, or one per agent, below which they do.
    views
        Views of the agents, see `flocking.engine.tiles.particles.graph_radii.GraphRadii`.
    """

    limits: Reals
    views: Reals = NO_VIEWS


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


@native
def _begin_links(  # type: ignore[no-untyped-def]
    first_tile, last_tile, agents, n, box, limits, views, rows, first, count
):
    """Link all listed pairs closer than the limit of the sensing agent, and within its view."""
    m = agents.shape[1] // 2
    for tile in range(first_tile, last_tile):
        for row in range(first[tile], first[tile] + count[tile]):
            for lane in range(WIDTH):
                i, j = tile * WIDTH + lane, np.int64(rows[row, lane])
                if i == j or i >= n:
                    continue
                s = agents[i, 0] * 0
                ahead, speed = agents[i, 0] * 0, agents[i, 0] * 0 + (1 if views.shape[0] > 1 else 0)
                fastest = agents[i, 0] * 0
                for k in range(m):
                    fastest = max(fastest, abs(agents[i, m + k]))
                if not fastest > 0:
                    fastest = fastest * 0 + 1
                for k in range(m):
                    d = agents[j, k] - agents[i, k]
                    if box.shape[0]:
                        d = to_nearest(d, box, k, m)
                    s += d * d
                    if views.shape[0]:
                        heading = views[k + 1, i] if views.shape[0] > 1 else agents[i, m + k] / fastest
                        ahead += d * heading
                        speed += 0 if views.shape[0] > 1 else heading * heading
                if views.shape[0] and ahead * abs(ahead) < views[0, i] * s * speed:
                    continue
                if s < limits[i if limits.shape[0] > 1 else 0]:
                    rows[row, lane] |= LINKED


@native
def _carry_links(  # type: ignore[no-untyped-def]
    first_tile, last_tile, n, order, place, old_rows, old_first, old_count, rows, first, count, lost
):
    """Link the pairs that were linked before the sort; report a linked pair that is no longer listed."""
    sought, begin, many_old = np.empty(WIDTH, np.uint32), np.empty(WIDTH, np.int64), np.empty(WIDTH, np.int64)
    for tile in range(first_tile, last_tile):
        base = tile * WIDTH
        many = min(WIDTH, n - base)
        most = np.int64(0)
        for lane in range(WIDTH):
            many_old[lane] = 0
        for lane in range(many):
            before = order[base + lane] // WIDTH
            begin[lane], many_old[lane] = old_first[before] * WIDTH + order[base + lane] % WIDTH, old_count[before]
            most = max(most, many_old[lane])
        # Agents of a tile come from several tiles: the k-th of the old neighbours of each is looked for at a time.
        for old in range(most):
            for lane in range(WIDTH):
                sought[lane] = np.uint32(NUMBER)
                if old < many_old[lane]:
                    entry = old_rows[begin[lane] + old * WIDTH]
                    if entry > NUMBER:
                        sought[lane] = np.uint32(place[np.int64(entry & NUMBER)])
            linked = load(sought, 0)
            missing = linked != np.uint32(NUMBER)
            for row in range(first[tile], first[tile] + count[tile]):
                entries = load(rows[row], 0)
                here = (entries & np.uint32(NUMBER)) == linked
                store(rows[row], 0, select(here, entries | np.uint32(LINKED), entries))
                missing = missing & ~here
            if bits_of(missing):
                for lane in range(many):
                    if (bits_of(missing) >> lane) & 1:
                        # Return the pair to the caller.
                        lost[0] = base + lane
                        lost[1] = np.int64(sought[lane])


class Listed(NamedTuple):
    """Which pairs are listed.

    Parameters
    ----------
    reach, each
        All that are closer than ``reach``, or than the sensing agent's entry of ``each``, which has length 1 where
        ``reach`` holds for all, else 16 tiles.
    keep
        Takes pairs that are never linked, whatever their distance, out of the lists.
    entry_size
        Memory of an entry in bytes, with what is stored beside it.
    """

    reach: float
    each: Reals
    keep: Callable[[TileLists], None] | None = None
    entry_size: int = ENTRY


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
        self, agents: Reals, listed: Listed, grid: Grid, start: Numbers32, old: TileLists | None,
        order: Numbers32, place: Numbers32, begin: FirstLinks | None, remember: bool, beside: Numbers32 = NOBODY,
    ) -> tuple[TileLists, tuple[int, int] | None]:  # fmt: skip
        """Build the lists of all pairs within a reach.

        Parameters
        ----------
        agents
            Positions and velocities in sorted order, shape (16 tiles, 2m).
        listed
            Which pairs are listed.
        grid, start
            The cells of the sort.
        old, order, place
            The lists before the sort, the old index of each agent, and the new index of each.
        begin
            Which pairs start linked; None if links are carried over.
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
        lists = self._searched(agents, listed, grid, start, beside)
        if listed.keep is not None:
            listed.keep(lists)
        lost = np.full(2, -1, np.int64)
        here = (lists.rows, lists.first, lists.count)
        if begin is not None:
            self.workers.each(_begin_links, self.tiles, agents, self.n, self.box, *begin, *here)
        elif remember and old is not None:
            before = (old.rows.reshape(-1), old.first, old.count)
            self.workers.each(_carry_links, self.tiles, self.n, order, place, *before, *here, lost)
            self.spare = old
        return lists, (int(lost[0]), int(lost[1])) if lost[0] >= 0 else None

    def _searched(self, agents: Reals, listed: Listed, grid: Grid, start: Numbers32, beside: Numbers32) -> TileLists:
        """Lists without links, with sufficient capacity."""
        dtype = agents.dtype.type
        limits = np.asarray(listed.each, dtype=dtype) ** 2
        places = np.array(grid.origin), np.array(grid.inverse), np.array(grid.shape)
        cells = Cells(agents, self.n, *places, start, self.box, beside, self.tiles * WIDTH)
        distances = Reach(dtype(listed.reach) ** 2, limits)
        numbers = np.empty((self.chunks, WIDTH), np.uint32)
        while True:
            total = int(self.capacity.sum())
            if (needed := float(total * WIDTH * listed.entry_size)) > self.memory_limit:
                raise TooManyNeighboursError(needed)
            lists = self._reuse(total)
            stretch = np.cumsum(self.capacity) - self.capacity
            need = np.zeros(self.chunks, np.int64)
            room = ListRoom(lists.rows, lists.first, lists.count, stretch, self.capacity, need, numbers)
            self.workers.each_large(search, self.chunks, cells, distances, room)
            if (need <= self.capacity).all():
                return lists
            # Chunks that are almost full get room too: each of them would soon be a reason to search all again.
            almost = self.capacity - self.capacity // ALMOST_FULL
            self.capacity = np.where(need > almost, need + need // 8 + 8, self.capacity)
            self.spare = None

    def _reuse(self, total: int) -> TileLists:
        spare, self.spare = self.spare, None
        if spare is not None and len(spare.rows) >= total and len(spare.rows) <= 2 * total + SPARE_ROWS:
            # A new object: what was found for the old lists does not hold for these.
            return TileLists(spare.rows, spare.first, spare.count)
        return TileLists(
            aligned((max(total, 1), WIDTH), np.uint32), np.zeros(self.tiles, np.int64), np.zeros(self.tiles, np.int32)
        )
