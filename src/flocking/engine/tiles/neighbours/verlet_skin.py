"""The Verlet skin of the neighbour lists: its cost in list rows against what it saves in rebuilds.

The length that lists would have with each skin is counted on a sample of tiles, not guessed from a density: in a
lattice a wider skin costs nothing until it meets the next shell.
"""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array, Numbers, Reals
from flocking.engine.tiles.neighbours.cell_list import Sorter
from flocking.engine.tiles.simd.vectors import WIDTH

SKINS = tuple(0.04 * 1.25**k for k in range(15))
"""Skins tried, as fractions of the cutoff."""

FIRST_SKIN = 0.25
"""Skin for which agents are sorted when nothing is known."""

SAMPLE = 16
"""Tiles looked at."""

PASS_COST = 2.0
"""Cost of a step besides its list rows, in rows. These costs are constants: results must not depend on a clock."""
REBUILD_COST, REBUILD_ROW_COST = 30.0, 6.0
"""Cost of a rebuild, per tile and per row, in rows of a step."""


def _candidates(sorter: Sorter, q: Reals, far: float) -> tuple[Numbers, Numbers]:
    """Agents in the cells within ``far`` cells of positions q, shape (k, m): whom each is near, and its place."""
    grid, m = sorter.grid, q.shape[1]
    # As the sort does; wrapped axes show every cell once.
    cells = np.floor((q.astype(np.float64) - grid.origin[:m]) * grid.inverse).astype(np.int64)
    steps = [np.arange(min(2 * far + 1, count)) - far for count in grid.shape[:m]]
    offsets = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, m)
    near = (cells[:, None] + offsets) % np.array(grid.shape[:m])
    cell = near[..., 0] + grid.shape[0] * near[..., 1]
    if m == 3:
        cell += grid.shape[0] * grid.shape[1] * near[..., 2]
    first = sorter.start[cell].ravel().astype(np.int64)
    many = sorter.start[cell + 1].ravel() - first
    whose = np.repeat(np.repeat(np.arange(len(q)), len(offsets)), many)
    ends = np.cumsum(many)
    return whose, np.arange(len(whose)) + np.repeat(first - (ends - many), many)


def _lengths(agents: Reals, sorter: Sorter, limits: Array) -> Array:
    """Mean number of rows that the lists of the sampled tiles would have with each distance of ``limits``."""
    m, n = agents.shape[1] // 2, sorter.n
    count = (n + WIDTH - 1) // WIDTH
    tiles = np.unique(np.linspace(0, count - 1, min(SAMPLE, count)).astype(np.int64))
    rows = np.zeros(len(limits))
    for some in np.array_split(tiles, -(-len(tiles) // 4)):
        part = (some[:, None] * WIDTH + np.arange(WIDTH)).ravel()
        part = part[part < n]
        q = agents[sorter.order[part], :m]
        whose, there = _candidates(sorter, q, 2)
        square = ((agents[sorter.order[there], :m] - q[whose]) ** 2).sum(axis=1)
        inside = np.searchsorted(limits**2, square, side="right")
        own = np.bincount(whose * (len(limits) + 1) + inside, minlength=len(part) * (len(limits) + 1))
        within = np.cumsum(own.reshape(len(part), -1)[:, :-1], axis=1) - 1
        first = np.unique(part // WIDTH, return_index=True)[1]
        rows += np.maximum.reduceat(within, first, axis=0).sum(axis=0)
    return rows / len(tiles)


def best_skin(agents: Reals, sorter: Sorter, cutoff: float, stride: float) -> float:
    """The skin that makes a step cheapest.

    Parameters
    ----------
    agents
        Positions and velocities in the order before the sort, shape (at least n, 2m).
    sorter
        Has just sorted them.
    cutoff
        Largest distance of linked agents.
    stride
        Share of the skin that two agents may use up in one step, as a length.
    """
    # The sample sees two cells far.
    skins = np.array([s for s in SKINS if cutoff * (1.0 + s) * sorter.grid.inverse <= 2.0] or SKINS[:1]) * cutoff
    rows = _lengths(agents, sorter, cutoff + skins)
    steps = np.maximum(1.0, skins / max(stride, 1e-12 * cutoff))
    cost = PASS_COST + rows + (REBUILD_COST + REBUILD_ROW_COST * rows) / steps
    return float(skins[np.argmin(cost)])
