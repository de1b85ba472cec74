"""Density of agents: smoothed counts on a grid, for groups too large to draw agent by agent."""

from __future__ import annotations

import math
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
"""Part of a cell by which a map may exceed a number of cells without another one, and by which agents below the border
of a cell are in the one above it."""


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
        Space of the agents. Where it repeats, every image of an agent that lies on the map counts, but for those on its
        upper ends, and images around the map are smoothed into it: a map of one box holds every agent once.

    Raises
    ------
    InvalidInput
        When agents or space are not in the plane, a number is not finite, the map has no area, or it would have too
        many cells.
    """
    from scipy.ndimage import gaussian_filter

    q = array("density_map", "q", q, ndim=2)
    if q.shape[1] != 2:
        raise InvalidInput("density_map", "q", "must have shape (N, 2)", q.shape)
    if len(space.lengths) not in (0, 2):
        raise InvalidInput("density_map", "space", "lengths must be 2, one for each axis", list(space.lengths))
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
    begin, end = corner - rim * size, upper + rim * size
    shown = _images(q, space, begin, end, ROUNDING * size)
    # Rounding puts images of one agent on the same side of the borders of cells.
    place = np.floor((shown - begin) / size + ROUNDING)
    cells = np.array([columns, rows]) + 2 * rim
    place = np.where((place == cells) & (shown <= end), cells - 1, place)
    place = place[((place >= 0) & (place < cells)).all(axis=1)].astype(np.int64)
    flat = np.bincount(place[:, 1] * cells[0] + place[:, 0], minlength=int(cells.prod()))
    found = flat.reshape(cells[1], cells[0]).astype(np.float64)
    if rim:
        found = gaussian_filter(found, blur / size, mode="constant")[rim:-rim, rim:-rim]
    return DensityMap(found / size**2, corner, upper)


def _images(q: Array, space: Space, low: Array, high: Array, rounding: float) -> Array:
    """Images of agents, among them all between two corners, shape (K, 2); none on the upper ends of axes that repeat.

    An agent there has an image on the lower end of the same map, or of the next one.
    """
    found = space.wrapped(q)
    for k, length in enumerate(space.lengths):
        if np.isfinite(length):
            begin, end = float(low[k]) - rounding, float(high[k]) - rounding
            copies = [
                found + length * number * np.eye(2)[k]
                for number in range(math.floor(begin / length), math.ceil(end / length))
            ]
            found = np.concatenate([x[(x[:, k] >= begin) & (x[:, k] < end)] for x in copies])
            found[:, k] = np.maximum(found[:, k], low[k])
    return found
