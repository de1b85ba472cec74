"""Choice of the Verlet skin: the cost of longer lists against that of rebuilds.

The length of the lists with each skin is counted on a sample of tiles, not estimated from a density: in a lattice a
wider skin costs nothing until it reaches the next shell.
"""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array, Numbers, Reals
from flocking.engine.tiles.neighbours.cell_list import Sorter
from flocking.engine.tiles.neighbours.nearest_image import box_of, to_nearest
from flocking.engine.tiles.simd.vectors import WIDTH
from flocking.formula.native.functions import native
from flocking.model.space import OPEN, Space

LEAST_STRIDE = 1e-12
"""Stride in a step, relative to the cutoff, that counts as the least: a group at rest keeps its lists for good."""

SKIN_SHARES = tuple(0.04 * 1.25**k for k in range(15))
"""Skins tried, as fractions of the cutoff."""

FIRST_SKIN = 0.25
"""Skin for the first sort, before any estimate exists, as a fraction of the cutoff."""

SAMPLE = 16
"""Number of sampled tiles."""

PASS_COST = 2.0
"""Cost of a step apart from its list rows, in rows. Costs are constants, so that results do not depend on timing."""
REBUILD_COST, REBUILD_ROW_COST = 30.0, 6.0
"""Cost of a rebuild, per tile and per row, in rows of a step."""


def _cells_around(sorter: Sorter, q: Reals, far: int) -> Numbers:
    """Cells at most ``far`` cells from those of positions q, shape (k, m), each once; shape (k, cells)."""
    grid, m = sorter.grid, q.shape[1]
    # As in the sort; on wrapped axes every cell is taken once.
    cells = np.floor((q.astype(np.float64) - grid.origin[:m]) * np.array(grid.inverse[:m])).astype(np.int64)
    steps = [np.arange(min(2 * far + 1, count)) - far for count in grid.shape[:m]]
    offsets = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, m)
    near = (cells[:, None] + offsets) % np.array(grid.shape[:m])
    cell = near[..., 0] + grid.shape[0] * near[..., 1]
    if m == 3:
        cell += grid.shape[0] * grid.shape[1] * near[..., 2]
    return np.ascontiguousarray(cell)


@native
def _count_by_distance(first, last, agents, order, part, cells, start, box, squares, found):  # type: ignore[no-untyped-def]
    """Number of agents in the cells around each of some agents, by the first squared distance that is above theirs."""
    m = agents.shape[1] // 2
    most = squares.shape[0]
    for k in range(first, last):
        i = np.int64(order[part[k]])
        for c in range(cells.shape[1]):
            for at in range(start[cells[k, c]], start[cells[k, c] + 1]):
                j = np.int64(order[at])
                square = agents[i, 0] * 0
                for axis in range(m):
                    d = agents[j, axis] - agents[i, axis]
                    if box.shape[0]:
                        d = to_nearest(d, box, axis, m)
                    square += d * d
                if np.float64(square) < squares[most - 1]:
                    limit = 0
                    while squares[limit] <= np.float64(square):
                        limit += 1
                    found[k, limit] += 1


def _lengths(agents: Reals, sorter: Sorter, limits: Array, space: Space = OPEN) -> Array:
    """Mean number of rows of the lists of the sampled tiles for each distance of ``limits``."""
    m, n = agents.shape[1] // 2, sorter.n
    count = (n + WIDTH - 1) // WIDTH
    tiles = np.unique(np.linspace(0, count - 1, min(SAMPLE, count)).astype(np.int64))
    part = (tiles[:, None] * WIDTH + np.arange(WIDTH)).ravel()
    part = part[part < n]
    cells = _cells_around(sorter, agents[sorter.order[part], :m], 2)
    found = np.zeros((len(part), len(limits)), np.int64)
    box = box_of(space, m, agents.dtype.type)
    _count_by_distance(0, len(part), agents, sorter.order, part, cells, sorter.start, box, limits**2, found)
    within = np.cumsum(found, axis=1) - 1
    first = np.unique(part // WIDTH, return_index=True)[1]
    rows: Array = np.maximum.reduceat(within, first, axis=0).sum(axis=0)
    return rows / len(tiles)


def best_skin(
    agents: Reals, sorter: Sorter, cutoff: float, stride: float, space: Space = OPEN, passes: float = 1.0
) -> float:
    """The skin with the lowest cost per step.

    Parameters
    ----------
    agents
        Positions and velocities in the order before the sort, shape (at least n, 2m).
    sorter
        The sort, just applied to them.
    cutoff
        Largest distance of linked agents.
    stride
        Largest change of the distance of two agents in one step.
    space
        Their space.
    passes
        Cost of what a step does with the lists, in passes of a step under ideal control.
    """
    # The sample covers two cells in each direction, and all of an axis of at most five.
    m, grid = agents.shape[1] // 2, sorter.grid
    axes = zip(grid.inverse[:m], grid.shape, space.lengths or (np.inf,) * m, strict=False)
    inverse = max((x for x, count, length in axes if count > 5 or not np.isfinite(length)), default=0.0)
    skins = np.array([s for s in SKIN_SHARES if cutoff * (1.0 + s) * inverse <= 2.0] or SKIN_SHARES[:1]) * cutoff
    rows = _lengths(agents, sorter, cutoff + skins, space)
    steps = np.maximum(1.0, skins / max(stride, LEAST_STRIDE * cutoff))
    cost = passes * (PASS_COST + rows) + (REBUILD_COST + REBUILD_ROW_COST * rows) / steps
    return float(skins[np.argmin(cost)])
