"""Density of agents: smoothed counts on a grid, for groups too large to draw agent by agent."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flocking.errors import InvalidInput
from flocking.model.checks import Array, array, number
from flocking.model.space import OPEN, Space

MOST_CELLS = 50_000_000
"""Most cells of a map, a bound on memory: 400 MB of counts."""

REACH = 4.0
"""Standard deviations at which the smoothing of SciPy cuts its Gaussian off by default."""

FASTER = 8.0
"""Products of matrices in the time of one product of a sum over neighbouring cells, a measured order of magnitude."""

ROUNDING = 1e-9
"""Part of a cell by which a map may exceed a number of cells without another one, and by which agents below the border
of a cell are in the one above it."""

MOST_IMAGES = 50_000_000
"""Most images of agents that are looked at, a bound on memory: 800 MB of positions."""


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
        When agents or space are not in the plane, a number is not finite, the map has no area, it would have too many
        cells with those around it that smoothing reaches, or show too many images of agents, or cells are smaller
        than the rounding of coordinates, or too small or large for their area.
    """
    q = array("density_map", "q", q, ndim=2)
    if q.shape[1] != 2:
        raise InvalidInput("density_map", "q", "must have shape (N, 2)", q.shape)
    if len(space.lengths) not in (0, 2):
        raise InvalidInput("density_map", "space", "lengths must be 2, one for each axis", list(space.lengths))
    blur = number("density_map", "blur", blur, least=0.0)
    corner, upper_right = (array("density_map", name, x, ndim=1) for name, x in (("low", low), ("high", high)))
    for name, found in (("low", corner), ("high", upper_right)):
        if found.shape != (2,):
            raise InvalidInput("density_map", name, "must be two numbers", found.tolist())
    size = number("density_map", "cell", cell, above=0.0)
    if not np.finfo(np.float64).tiny <= size * size < np.inf:
        raise InvalidInput("density_map", "cell", "must have an area that is a floating-point number", cell)
    if size < (rounding := float(np.spacing(max(np.abs(corner).max(), np.abs(upper_right).max())))):
        raise InvalidInput(
            "density_map", "cell", f"must be at least {rounding:.3g}, by which coordinates of the corners are rounded",
            cell, "Take larger cells, or move agents and corners to the origin.",
        )  # fmt: skip
    if (upper_right <= corner).any():
        raise InvalidInput("density_map", "high", "must lie above and to the right of low", high)
    with np.errstate(over="ignore"):
        counts = np.maximum(np.ceil((upper_right - corner) / size - ROUNDING), 1.0)
        most = counts.prod()
        around = np.ceil(REACH * blur / size) if blur > 0 else 0.0
        reached = (counts + 2.0 * around).prod()
    if most > MOST_CELLS:
        raise InvalidInput("density_map", "cell", f"must give at most {MOST_CELLS} cells", cell, "Take larger cells.")
    # Agents around the map are counted too: smoothing carries some of them over the border.
    if reached > MOST_CELLS:
        raise InvalidInput(
            "density_map", "blur", f"must reach over at most {MOST_CELLS} cells, those around the map included", blur,
            "Take larger cells.",
        )  # fmt: skip
    columns, rows = (int(k) for k in counts)
    upper = corner + size * counts
    rim = int(around)
    begin, end = corner - rim * size, upper + rim * size
    cells = np.array([columns, rows]) + 2 * rim
    shown = _images(q, space, begin, end, ROUNDING * size)
    # Rounding puts images of one agent on the same side of the borders of cells.
    place = np.floor((shown - begin) / size + ROUNDING)
    place = np.where((place == cells) & (shown <= end), cells - 1, place)
    place = place[((place >= 0) & (place < cells)).all(axis=1)].astype(np.int64)
    found = _smoothed(place, cells, rim, blur / size) if rim else _counts(place, cells)
    return DensityMap(found / size**2, corner, upper)


def _counts(place: NDArray[np.int64], cells: NDArray[np.int64]) -> Array:
    """Agents in each cell, shape (rows, columns), from their columns and rows, shape (K, 2)."""
    flat = np.bincount(place[:, 1] * cells[0] + place[:, 0], minlength=int(cells.prod()))
    return flat.reshape(cells[1], cells[0]).astype(np.float64)


def _smoothed(place: NDArray[np.int64], cells: NDArray[np.int64], rim: int, deviation: float) -> Array:
    """The smoothed counts without the ``rim`` cells around the map.

    A Gaussian is a product of one along each axis. Where it is wide and cells with agents are few, products with the
    rows and columns that hold agents take less than a sum over neighbouring cells.
    """
    columns, rows = cells - 2 * rim
    across, up = (np.unique(place[:, k], return_inverse=True) for k in range(2))
    held = len(across[0]), len(up[0])
    if rows * held[0] * (held[1] + columns) > FASTER * cells.prod(dtype=np.float64) * 4 * rim:
        from scipy.ndimage import gaussian_filter

        wide: Array = gaussian_filter(_counts(place, cells), deviation, mode="constant", truncate=REACH)
        return wide[rim:-rim, rim:-rim]
    sums = _counts(np.stack([across[1], up[1]], axis=1), np.array(held))
    return np.asarray(_bell(up[0], int(rows), rim, deviation) @ sums @ _bell(across[0], int(columns), rim, deviation).T)


def _bell(cells: NDArray[np.int64], count: int, rim: int, deviation: float) -> Array:
    """Shares of the agents of some ``cells`` that ``count`` cells behind the rim get, shape (count, cells)."""
    reach = int(REACH * deviation + 0.5)
    away = np.arange(-reach, reach + 1)
    total = np.exp(-0.5 * (away / deviation) ** 2).sum()
    off = np.arange(count)[:, None] + rim - cells
    shares: Array = np.where(abs(off) <= reach, np.exp(-0.5 * (off / deviation) ** 2), 0.0) / total
    return shares


def _images(q: Array, space: Space, low: Array, high: Array, rounding: float) -> Array:
    """Images of agents, among them all between two corners, shape (K, 2); none on the upper ends of axes that repeat.

    An agent there has an image on the lower end of the same map, or of the next one.

    Raises
    ------
    InvalidInput
        When there are more than `MOST_IMAGES`.
    """
    with np.errstate(over="ignore"):
        boxes = [
            np.ceil(high[k] / length) - np.floor(low[k] / length) + 1.0
            for k, length in enumerate(space.lengths)
            if np.isfinite(length)
        ]
        images = len(q) * float(np.prod(boxes))
    if images > MOST_IMAGES:
        raise InvalidInput(
            "density_map", "space", f"must have at most {MOST_IMAGES} images of agents on the map", f"{images:.3g}",
            "Take a smaller map: after the lengths of space it repeats.",
        )  # fmt: skip
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
