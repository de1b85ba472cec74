"""The smallest value of a potential within reach of a graph."""

from __future__ import annotations

import numpy as np

from flocking.model.potentials.potential import Potential
from flocking.study.evidence import NotResolvable

MINIMUM_ERROR = 1e-12
"""Absolute tolerance of the located minimum; near one a value depends on its place by the square of the error."""

FARTHEST = 1e4
"""Where the search ends for a graph without a break radius, a convention: in most units distances of agents
are near 1."""

GRID = 4001
"""Points of the logarithmic and of the linear grid: minima further apart than 0.4 % of their distance are separated."""

NEAREST = 1e-6
"""Smallest distance of the grid, as a share of the largest."""


def distance_of(potential: Potential, value: float, lowest: float, highest: float) -> float:
    """Distance in a range at which a potential has a value.

    Parameters
    ----------
    potential
        The potential, above the value at one end of the range and below it at the other.
    value
        The value.
    lowest, highest
        Logarithms of the ends of the range.

    Raises
    ------
    NotResolvable
        When it is above or below the value at both ends.
    """
    from scipy.optimize import brentq

    def excess(s: float) -> float:
        return float(potential(np.exp(s))) - value

    with np.errstate(all="ignore"):
        if not excess(lowest) * excess(highest) <= 0:
            raise NotResolvable(f"no distance in reach at which the potential is {value:.4g}")
        return float(np.exp(brentq(excess, lowest, highest)))


def smallest_value(potential: Potential, radius: float = FARTHEST) -> tuple[float, float]:
    """Distance and value of the smallest minimum on (0, radius): a dense grid, then refinement.

    Parameters
    ----------
    potential
        The potential.
    radius
        Largest distance of neighbours.

    Returns
    -------
    tuple of float
        Distance and value.
    """
    from scipy.optimize import minimize_scalar

    end = min(radius, FARTHEST)
    grid = np.unique(np.concatenate([np.geomspace(NEAREST * end, end, GRID)[:-1], np.linspace(0, end, GRID)[1:-1]]))
    values = potential(grid)
    k = int(np.nanargmin(np.where(np.isfinite(values), values, np.inf)))
    a, b = grid[max(k - 1, 0)], grid[min(k + 1, len(grid) - 1)]
    found = minimize_scalar(
        lambda r: float(potential(r)), bounds=(a, b), method="bounded", options={"xatol": MINIMUM_ERROR}
    )
    return float(found.x), float(found.fun)
