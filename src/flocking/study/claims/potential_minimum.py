"""The smallest value of a potential within reach of a graph."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array
from flocking.errors import FormulaError
from flocking.model.potentials.potential import Potential
from flocking.study.evidence import NotResolvable
from flocking.study.potentials.potential_bounds import lower_value
from flocking.study.potentials.potential_units import POWERS, lengths_of

MINIMUM_ERROR = 1e-12
"""Tolerance of the located minimum, relative to its bracket; near one a value depends on its place by the square of the
error."""

SEARCHED = 1e-9, 1e9
"""Distances that are searched for a graph without a break radius, in the unit in which something happens; a
convention."""

PER_DECADE = 667
"""Points of the logarithmic grid in a decade: minima further apart than 0.4 % of their distance are separated."""

GRID = 4001
"""Points of the linear grid of distances below a radius."""

NEAREST = 1e-6
"""Smallest distance of the grid, as a share of the radius."""

DEEPER, NEARER = 3, 4002
"""How often smaller distances follow where the least value is at the smallest, and their number: six decades each."""

FARTHEST_LOGARITHM = 700.0
"""Largest logarithm of a distance: beyond it distances overflow."""

NEAREST_LOGARITHM = -40.0
"""Logarithm of the smallest distance at which an energy is looked for, 4e-18, in units of length and of the best
distance: the inverse square is 6e34 there."""

BESIDE, JUMP = 1e-9, 1e-3
"""Relative distance below a place where a potential reaches a value, and the share of the value by which it is less
there if it jumps: rounding of numbers that overflow is distinguished from a steep rise."""

BROAD, FINE = 1.05, 20_001
"""Range beside a place that is looked at again, relative to it, and its places, of which the first grid has 14."""

AGAIN, MOST_DIPS = 1e6, 16
"""Range beyond it in which intervals look for lower values, relative to it, and how often they are followed."""


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


def nearest_distance(potential: Potential, value: float, best: float) -> float:
    """The smallest distance at which a potential is not above a value: nearer places store more.

    Parameters
    ----------
    potential
        The potential.
    value
        The value.
    best
        The distance at which it is least.

    Raises
    ------
    NotResolvable
        When it is above the value even there, or nowhere in reach.
    """
    end = float(np.log(best))
    start = min(NEAREST_LOGARITHM, end + NEAREST_LOGARITHM)
    grid = np.linspace(start, end, round(PER_DECADE * (end - start) / np.log(10.0)))
    with np.errstate(all="ignore"):
        # The last place is the least one, whatever the rounding of its value.
        allowed = np.append(potential(np.exp(grid[:-1])) <= value, True)
    k = int(np.argmax(allowed))
    return distance_of(potential, value, float(grid[max(k - 1, 0)]), float(grid[k]))


def farthest_distance(potential: Potential, value: float) -> float:
    """The largest distance at which a potential is not above a value; infinite where it stays below, or comes back.

    A dense grid up to the largest distances there are, then finer ones about the last place below the value, and
    further places where intervals find that it is below the value again.

    Parameters
    ----------
    potential
        The potential.
    value
        The value.

    Raises
    ------
    NotResolvable
        When the value is below the smallest one.
    """
    start = float(np.log(smallest_value(potential)[0]))
    decades = (FARTHEST_LOGARITHM - start) / np.log(10.0)
    with np.errstate(all="ignore"):
        grid = np.linspace(start, FARTHEST_LOGARITHM, round(PER_DECADE * decades))
        below = potential(np.exp(grid)) < value
        if below[-1]:
            return np.inf
        k = int(np.flatnonzero(below)[-1]) if below.any() else 0
        found = distance_of(potential, value, float(grid[k]), float(grid[k + 1]))
        for _ in range(MOST_DIPS):
            found = _last_beside(potential, value, found)
            again = _lower_beyond(potential, value, found)
            if np.isnan(again):
                break
            found = again
        # Where squares of distances overflow the potential seems to jump there.
        inside = float(potential(found * (1.0 - BESIDE)))
    return np.inf if value - inside > JUMP * abs(value) else found


def _lower_beyond(potential: Potential, value: float, place: float) -> float:
    """A distance beyond a place at which a potential is below a value; NaN where none was found."""
    try:
        return lower_value(potential, place * (1.0 + BESIDE), place * AGAIN, value).at
    except FormulaError:
        # Its numbers are too extreme for exact ones: what the grids show is all that is known.
        return float("nan")


def _last_beside(potential: Potential, value: float, place: float) -> float:
    """The last distance near a place at which a potential has a value; the place itself where there is none."""
    fine = np.linspace(place, place * BROAD, FINE)
    below = np.flatnonzero(potential(fine) < value)
    if not len(below) or below[-1] == FINE - 1:
        return place
    low, high = fine[below[-1]], fine[below[-1] + 1]
    return distance_of(potential, value, float(np.log(low)), float(np.log(high)))


def _unit(potential: Potential) -> float:
    """The unit in which distances are searched, see `lengths_of`; also of numbers too extreme for many digits."""
    try:
        return lengths_of(potential, None)[1]
    except FormulaError:
        grid = 2.0 ** np.arange(-POWERS, POWERS + 1)
        with np.errstate(all="ignore"):
            rises = potential.slope(grid) > 0.0
        turns = grid[:-1][~rises[:-1] & rises[1:]]
        usual = turns[(turns >= SEARCHED[0]) & (turns <= SEARCHED[1])]
        return 1.0 if len(usual) or not len(turns) else float(turns[0])


def _least(potential: Potential, grid: Array) -> int:
    """Number of the place at which a potential is least, of those at which it is finite."""
    values = potential(grid)
    return int(np.nanargmin(np.where(np.isfinite(values), values, np.inf)))


def smallest_value(potential: Potential, radius: float = np.inf) -> tuple[float, float]:
    """Distance and value of the smallest minimum on (0, radius): a dense grid, then refinement.

    Parameters
    ----------
    potential
        The potential.
    radius
        Largest distance of neighbours; `SEARCHED` is searched where it is infinite. Below it the search goes down to
        1e-24 of it where it has to.

    Returns
    -------
    tuple of float
        Distance and value.
    """
    from scipy.optimize import minimize_scalar

    if np.isfinite(radius):
        low, end = NEAREST * radius, radius
    else:
        low, end = (x * _unit(potential) for x in SEARCHED)
    grid = np.geomspace(low, end, round(PER_DECADE * np.log10(end / low)))[:-1]
    if np.isfinite(radius):
        grid = np.unique(np.concatenate([grid, np.linspace(0, end, GRID)[1:-1]]))
    k = _least(potential, grid)
    for _ in range(DEEPER if np.isfinite(radius) else 0):
        if k:
            break
        # It may fall further below the first distance: that much nearer again.
        grid = np.concatenate([np.geomspace(grid[0] * NEAREST, grid[0], NEARER)[:-1], grid])
        k = _least(potential, grid)
    a, b = grid[max(k - 1, 0)], grid[min(k + 1, len(grid) - 1)]
    found = minimize_scalar(
        lambda r: float(potential(r)), bounds=(a, b), method="bounded", options={"xatol": MINIMUM_ERROR * b}
    )
    return float(found.x), float(found.fun)
