"""Units of a potential: powers of two near the distances at which something happens, and near the values there."""

from __future__ import annotations

import numpy as np

from flocking.formula.derivatives import derivative
from flocking.formula.precise import evaluator
from flocking.model.potentials.potential import Potential

DISTANCES = (1e-6, 1e6)
"""Nearest and farthest distance at which the formula must have a real value."""

POWERS = 200
"""Powers of two from 2^-200 to 2^200 at which it is looked where the slope changes its sign: 1e-60 to 1e60."""

ABOUT = (0.3, 0.5, 0.7, 0.9, 1.2, 1.7, 2.5)
"""Distances, in the length, about which values are of the size of the potential: the median is next to no pole."""

MOST_TURNS = 40
"""Changes of sign that are looked at with many digits, a bound on time."""


def lengths_of(potential: Potential, radius: float | None) -> tuple[float, float]:
    """Where something happens, and the unit in which distances are searched: powers of two.

    The first is near the radius, or the least distance at which the slope changes its sign, or 1. The second is the
    first where that lies beyond `DISTANCES`, else 1.

    Parameters
    ----------
    potential
        The potential.
    radius
        The sensing radius, where there is one.
    """
    import sympy

    if radius is not None:
        place = _power_of_two(radius)
        return place, 1.0 if DISTANCES[0] <= radius <= DISTANCES[1] else place
    grid = 2.0 ** np.arange(-POWERS, POWERS + 1)
    signs = np.sign(potential.slope(grid))
    known = np.isfinite(signs) & (signs != 0.0)
    grid, signs = grid[known], signs[known]
    turns = np.flatnonzero(signs[:-1] * signs[1:] < 0.0)[:MOST_TURNS]
    r = sympy.Symbol("r", positive=True)
    slope = evaluator(derivative(potential.expression(r), r), r)
    # Many digits distinguish a turn from rounding.
    certain = [float(grid[k]) for k in turns if slope(float(grid[k])) * slope(float(grid[k + 1])) < 0]
    inside = [x for x in certain if DISTANCES[0] <= x <= DISTANCES[1]]
    return (inside[0], 1.0) if inside else (certain[0], certain[0]) if certain else (1.0, 1.0)


def energy_of(potential: Potential, place: float) -> float:
    """A power of two near the values of a potential about a distance; 1 where they are zero.

    Parameters
    ----------
    potential, place
        The potential and the distance.
    """
    values = np.abs(potential(place * np.array(ABOUT)))
    values = values[np.isfinite(values) & (values > 0.0)]
    return _power_of_two(float(np.median(values))) if len(values) else 1.0


def _power_of_two(x: float) -> float:
    return float(2.0 ** np.round(np.log2(x)))
