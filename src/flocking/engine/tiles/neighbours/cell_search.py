"""Search for the neighbours of each tile among the agents of the cells around it.

The candidates of some agents of a tile are first held against the box around these agents, sixteen at a time, and what
is left is kept by coordinates. Then each agent is held against sixteen of them at a time. Neighbours of an agent are
found in the order of the cells around it and, within a row of cells, of their numbers.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import Array, Numbers, Numbers32, Reals
from flocking.engine.tiles.neighbours.cell_list import cell_of
from flocking.engine.tiles.neighbours.nearest_image import to_nearest
from flocking.engine.tiles.simd.packing import pack, room_like
from flocking.engine.tiles.simd.reductions import bits_of, highest
from flocking.engine.tiles.simd.row_transposition import LOADERS
from flocking.engine.tiles.simd.vectors import WIDTH, load, narrow, numbers_from, select, spread, store
from flocking.formula.native.functions import native

load_four, load_six = LOADERS[4], LOADERS[6]

TILES_IN_CHUNK = 64
"""Tiles whose rows are contiguous in memory; fixed, so that lists do not depend on the number of threads."""
LONGEST = 64
"""Largest number of cells in a row that the agents of a tile may span to be searched together."""
ROOM = 512
"""Candidates that are kept before agents are held against them: they stay in the fastest cache in either precision."""
BEHIND = ROOM + WIDTH
"""Length of the memory for them: sixteen are written at a time."""
DOUBT = 1e-6
"""What a distance from a box may be too long by, relative to the coordinates' differences: some eight units of rounding
in single precision, of a difference, of the image taken, and of half an extent. A candidate is kept in doubt."""
OWN_IMAGE = 0.49
"""Share of a length that repeats up to which a difference of coordinates is that to the nearest image: half of it less
far more than rounding. `to_nearest` then gives the difference itself, bit for bit."""


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
        See `flocking.engine.tiles.neighbours.neighbour_lists.TileLists`; ``many`` is its ``count``, which is a method
        of tuples.
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


class Candidates(NamedTuple):
    """Candidates near a tile: numbers, coordinates, and the neighbours of one agent among them, shape (BEHIND,)."""

    who: NDArray[np.uint32]
    x: Reals
    y: Reals
    z: Reals
    hits: NDArray[np.uint32]


class Box(NamedTuple):
    """Corners of a box around some agents of a tile, and the largest squared reach of them."""

    low_x: float
    low_y: float
    low_z: float
    high_x: float
    high_y: float
    high_z: float
    limit: float


@native
def search(first_chunk: int, last_chunk: int, cells: Cells, reach: Reach, room: ListRoom) -> None:
    """Find the neighbours of all agents of some chunks.

    Parameters
    ----------
    first_chunk, last_chunk
        The chunks.
    cells, reach
        The agents, and how far they are looked for.
    room
        Takes the lists. Where there is not enough room only the need is right.
    """
    tiles = room.first.shape[0]
    agents = cells.agents
    candidates = Candidates(
        np.empty(BEHIND, np.uint32), room_like(agents, BEHIND), room_like(agents, BEHIND), room_like(agents, BEHIND),
        np.empty(BEHIND, np.uint32),
    )  # fmt: skip
    for chunk in range(first_chunk, last_chunk):
        cursor = room.stretch[chunk]
        end = cursor + room.capacity[chunk]
        needed = np.int64(0)
        found = room.numbers[chunk]
        for tile in range(chunk * TILES_IN_CHUNK, min((chunk + 1) * TILES_IN_CHUNK, tiles)):
            base = tile * WIDTH
            own = numbers_from(base)
            store(found, 0, own ^ own)
            _search_tile(cells, reach, candidates, room.rows, base, cursor, end, found)
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
    cells: Cells, reach: Reach, candidates: Candidates, rows: NDArray[np.uint32], base: int, cursor: int, end: int,
    found: NDArray[np.uint32],
) -> None:  # fmt: skip
    """Find the neighbours of the agents of one tile, from row ``cursor`` on; their numbers are written to ``found``."""
    shape = cells.shape
    three = cells.agents.shape[1] == 6
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
        low_x, low_y, low_z, high_x, high_y, high_z, limit = _box(cells.agents, reach, base + lane, base + last)
        around = Box(low_x, low_y, low_z, high_x, high_y, high_z, limit)
        filled, images = 0, np.int64(0)
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
                for copies in range(2 if cells.beside.shape[0] else 1):
                    if copies:
                        at = cells.offset + int(cells.beside[row * shape[0] + a])
                        behind = cells.offset + int(cells.beside[row * shape[0] + b])
                    else:
                        at = int(cells.start[row * shape[0] + a])
                        behind = int(cells.start[row * shape[0] + b])
                    while at < behind:
                        if filled > ROOM - WIDTH:
                            _test(cells, reach, candidates, filled, rows, base, lane, last, cursor, end, found, images)
                            filled, images = 0, np.int64(0)
                        kept, some = _keep(cells, around, candidates, filled, at, behind)
                        filled, images = filled + kept, images | some
                        at += WIDTH
        _test(cells, reach, candidates, filled, rows, base, lane, last, cursor, end, found, images)
        lane = last


def _cell(cells: Cells, i: int) -> tuple[int, int, int]:
    """Cell of an agent along each axis; 0 along the third axis in two dimensions."""
    agents, origin, inverse, shape = cells.agents, cells.origin, cells.inverse, cells.shape
    x = cell_of(agents[i, 0], origin[0], inverse[0], shape[0])
    y = cell_of(agents[i, 1], origin[1], inverse[1], shape[1])
    z = cell_of(agents[i, 2], origin[2], inverse[2], shape[2]) if agents.shape[1] == 6 else 0
    return x, y, z


def _box(agents: Reals, reach: Reach, first: int, behind: int):  # type: ignore[no-untyped-def]
    """Fields of the `Box` around some agents; in two dimensions its third axis has no meaning."""
    limit = reach.each[first] if reach.each.shape[0] > 1 else reach.square
    low_x, low_y, low_z = agents[first, 0], agents[first, 1], agents[first, 2]
    high_x, high_y, high_z = low_x, low_y, low_z
    for i in range(first + 1, behind):
        x, y, z = agents[i, 0], agents[i, 1], agents[i, 2]
        low_x, high_x = x if x < low_x else low_x, x if x > high_x else high_x
        low_y, high_y = y if y < low_y else low_y, y if y > high_y else high_y
        low_z, high_z = z if z < low_z else low_z, z if z > high_z else high_z
        if reach.each.shape[0] > 1:
            limit = reach.each[i] if reach.each[i] > limit else limit
    return low_x, low_y, low_z, high_x, high_y, high_z, limit


def _far(under: float, over: float, box: Reals, k: int, m: int) -> bool:
    """Lanes for which an image along one axis may be nearer than the agent itself to some agent of a box.

    Parameters
    ----------
    under, over
        Coordinates' distances below the box and above it, negative where they are not.
    box, k, m
        As for `to_nearest`.
    """
    return select(under < over, -under, -over) * box[1 + m + k] > narrow(spread(OWN_IMAGE), under)  # type: ignore[no-any-return]


def _gap(under: float, over: float, box: Reals, k: int, m: int) -> float:
    """Lanes not above the distance along one axis from agents, or the nearest of their images, to those of a box.

    Parameters
    ----------
    under, over, box, k, m
        As for `_far`. Nobody is nearer than the distance from one end of the box less its extent.
    """
    none = narrow(spread(0.0), under)
    extent = -(under + over)
    one, two = to_nearest(under, box, k, m), to_nearest(over, box, k, m)
    one, two = select(one < none, -one, one), select(two < none, -two, two)
    away = select(one > two, one, two) - extent
    under, over = select(under < none, -under, under), select(over < none, -over, over)
    away = away - narrow(spread(DOUBT), under) * (under + over)
    return select(away > none, away, none)  # type: ignore[no-any-return]


def _own_gap(under: float, over: float) -> float:
    """Lanes of the distance along one axis from agents to a box; for the parameters see `_far`."""
    none = narrow(spread(0.0), under)
    away = select(under > over, under, over)
    return select(away > none, away, none)  # type: ignore[no-any-return]


def _keep(cells: Cells, around: Box, candidates: Candidates, filled: int, at: int, behind: int):  # type: ignore[no-untyped-def]
    """Keep the candidates near a box among the agents from ``at`` on, at most 16, those before ``behind``.

    How many, and whether an image of one may be nearer than itself to an agent of the box.
    """
    agents, box = cells.agents, cells.box
    first = min(at, agents.shape[0] - WIDTH)
    who = numbers_from(first)
    if agents.shape[1] == 6:
        x, y, z, _, _, _ = load_six(agents, first)
    else:
        x, y, z, _ = load_four(agents, first)
    m = agents.shape[1] // 2
    here = (who >= np.uint32(at)) & (who < np.uint32(behind))
    under_x, over_x, under_y, over_y = around.low_x - x, x - around.high_x, around.low_y - y, y - around.high_y
    under_z, over_z = around.low_z - z, z - around.high_z
    images = np.int64(0)
    if box.shape[0]:
        images = bits_of(here & (_far(under_x, over_x, box, 0, m) | _far(under_y, over_y, box, 1, m)))
        if agents.shape[1] == 6:
            images = images | bits_of(here & _far(under_z, over_z, box, 2, m))
    if images:
        beyond_x, beyond_y = _gap(under_x, over_x, box, 0, m), _gap(under_y, over_y, box, 1, m)
    else:
        beyond_x, beyond_y = _own_gap(under_x, over_x), _own_gap(under_y, over_y)
    square = beyond_x * beyond_x + beyond_y * beyond_y
    if agents.shape[1] == 6:
        beyond_z = _gap(under_z, over_z, box, 2, m) if images else _own_gap(under_z, over_z)
        square = square + beyond_z * beyond_z
    limit = narrow(spread(np.float64(around.limit) * (1.0 + DOUBT)), x)
    near = (square < limit) & here
    pack(candidates.x, filled, x, near)
    pack(candidates.y, filled, y, near)
    if agents.shape[1] == 6:
        pack(candidates.z, filled, z, near)
    return pack(candidates.who, filled, who, near), images


def _test(
    cells: Cells, reach: Reach, candidates: Candidates, filled: int, rows: NDArray[np.uint32], base: int,
    first: int, last: int, cursor: int, end: int, found: NDArray[np.uint32], images: np.int64,
) -> None:  # fmt: skip
    """List the candidates that are kept and within reach of the agents ``first`` to ``last - 1`` of a tile.

    Where no image is nearer than the agent itself, ``images`` is 0.
    """
    agents, box = cells.agents, cells.box
    three = agents.shape[1] == 6
    m = agents.shape[1] // 2
    for lane in range(first, last):
        i = base + lane
        own_x, own_y, own_z = agents[i, 0], agents[i, 1], agents[i, 2]
        limit = reach.each[i] if reach.each.shape[0] > 1 else reach.square
        count = np.int64(0)
        for k in range(0, filled, WIDTH):
            dx, dy = load(candidates.x, k) - own_x, load(candidates.y, k) - own_y
            if images:
                dx, dy = to_nearest(dx, box, 0, m), to_nearest(dy, box, 1, m)
            square = dx * dx + dy * dy
            if three:
                dz = load(candidates.z, k) - own_z
                if images:
                    dz = to_nearest(dz, box, 2, m)
                square = square + dz * dz
            who = load(candidates.who, k)
            near = (square < limit) & (who != np.uint32(i)) & (numbers_from(k) < np.uint32(filled))
            count += pack(candidates.hits, count, who, near)
        before = np.int64(found[lane])
        for number in range(min(count, end - cursor - before)):
            rows[cursor + before + number, lane] = candidates.hits[number]
        found[lane] = np.uint32(before + count)
