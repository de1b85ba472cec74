"""Density of agents: smoothed counts on a grid, for groups too large to draw agent by agent."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import Array, array, number
from flocking.model.space import OPEN, Space

MOST_CELLS = 50_000_000
"""Most cells of a map, a bound on memory: 400 MB of counts."""

REACH = 4.0
"""Standard deviations at which the smoothing of SciPy cuts its Gaussian off by default."""

ROUNDING = 1e-9
"""Part of a cell by which a map may exceed a number of cells without another one."""


@dataclass(frozen=True, eq=False)
class DensityMap:
    """Agents per unit of area on a grid of square cells.

    Parameters
    ----------
    values
        Density of each cell, shape (rows, columns); rows go up.
    low, high
        Lower left and upper right corner of the grid, shape (2,).
    """

    values: Array
    low: Array
    high: Array

    @property
    def agents(self) -> float:
        """Number of agents on the map; smoothing carries some over its border."""
        return float(self.values.sum() * np.prod(self.high - self.low) / self.values.size)


def density_map(
    q: Array, *, low: Sequence[float] | Array, high: Sequence[float] | Array, cell: float, blur: float = 0.0,
    space: Space = OPEN,
) -> DensityMap:  # fmt: skip
    """Density of agents in the plane.

    Parameters
    ----------
    q
        Positions, shape (N, 2).
    low, high
        Corners of the map; the upper right one is moved out to the next multiple of a cell.
    cell
        Side of a cell.
    blur
        Standard deviation of the Gaussian that smooths the counts; none when 0.
    space
        Space of the agents. Where it repeats, every image of an agent that lies on the map counts, and images around
        the map are smoothed into it.

    Raises
    ------
    InvalidInput
        When agents are not in the plane, the map has no area, or it would have too many cells.
    """
    from scipy.ndimage import gaussian_filter

    q = np.asarray(q, dtype=np.float64)
    if q.ndim != 2 or q.shape[1] != 2:
        raise InvalidInput("density_map", "q", "must have shape (N, 2)", q.shape)
    corner, size = array("density_map", "low", low, ndim=1), number("density_map", "cell", cell, above=0.0)
    counts = np.ceil((array("density_map", "high", high, ndim=1) - corner) / size - ROUNDING)
    if counts.shape != (2,) or (counts < 1).any():
        raise InvalidInput("density_map", "high", "must lie above and to the right of low", high)
    if counts.prod() > MOST_CELLS:
        raise InvalidInput("density_map", "cell", f"must give at most {MOST_CELLS} cells", cell, "Take larger cells.")
    columns, rows = (int(k) for k in counts)
    upper = corner + size * counts
    # Agents around the map are counted too: smoothing carries some of them over the border.
    rim = int(np.ceil(REACH * blur / size)) if number("density_map", "blur", blur, least=0.0) > 0 else 0
    shown = _images(q, space, corner - rim * size, upper + rim * size)
    found, _, _ = np.histogram2d(
        shown[:, 1], shown[:, 0], bins=(rows + 2 * rim, columns + 2 * rim),
        range=[(corner[k] - rim * size, upper[k] + rim * size) for k in (1, 0)],
    )  # fmt: skip
    if rim:
        found = gaussian_filter(found, blur / size, mode="constant")[rim:-rim, rim:-rim]
    return DensityMap(found / size**2, corner, upper)


def _images(q: Array, space: Space, low: Array, high: Array) -> Array:
    """Images of agents, among them all between two corners, shape (K, 2)."""
    found = space.wrapped(q)
    for k, length in enumerate(space.lengths):
        if np.isfinite(length):
            first, last = int(np.floor(low[k] / length)), int(np.ceil(high[k] / length))
            copies = [found + length * number * np.eye(2)[k] for number in range(first, last)]
            found = np.concatenate([x[(x[:, k] >= low[k]) & (x[:, k] <= high[k])] for x in copies])
    return found
