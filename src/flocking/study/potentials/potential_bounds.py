"""Whether a potential has lower values or larger slopes than were found: intervals between the places looked at."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import TYPE_CHECKING

import numpy as np

from flocking.arrays import Array, Mask
from flocking.errors import FormulaError
from flocking.formula.derivatives import derivative
from flocking.formula.interval_values import enclosed
from flocking.formula.intervals import Interval
from flocking.model.potentials.potential import Potential

if TYPE_CHECKING:
    import sympy

BOXES, PARTS, ROUNDS = 1024, 8, 12
"""Ranges of the first division, parts of each that is looked at again, and rounds: 8^12 is 2^36."""

PLACES, NARROWED = 33, 20
"""Places of a range at which the lowest value is looked for, and how often it is narrowed to an eighth."""

MOST_BOXES = 16_384
"""Ranges that a round looks at most at again: values within rounding of the bound cannot be distinguished from it."""

MOST_STORED = 64
"""Answers that are stored: several definitions ask the same of one potential."""


@dataclass(frozen=True)
class Lower:
    """A value below those that were found, or none.

    Parameters
    ----------
    at, value
        A distance and an upper bound of the value there; NaN where none was found.
    excluded
        Whether it is proven that there is none in the range.
    """

    at: float = np.nan
    value: float = np.nan
    excluded: bool = False


@lru_cache(maxsize=MOST_STORED)
def lower_value(potential: Potential, first: float, last: float, value: float) -> Lower:
    """A distance between two at which a potential is below a value, or the proof that there is none.

    Parameters
    ----------
    potential
        The potential.
    first, last
        The distances.
    value
        The value.
    """
    import sympy

    r = sympy.Symbol("r", positive=True)
    return _lower(potential.expression(r), potential, r, (first, last), value)


@lru_cache(maxsize=MOST_STORED)
def steeper_slope(potential: Potential, first: float, last: float, bound: float) -> Lower:
    """A distance between two at which a slope is larger than a bound, or the proof that there is none.

    Parameters
    ----------
    potential
        The potential.
    first, last
        The distances.
    bound
        The bound of the absolute value of the slope.

    Returns
    -------
    Lower
        Its value is minus the absolute value of the slope.
    """
    import sympy

    r = sympy.Symbol("r", positive=True)
    excluded = True
    slope = derivative(potential.expression(r), r)
    for sign in (1, -1):
        found = _lower(sign * slope, partial(_signed_slope, potential, sign), r, (first, last), -bound)
        if not np.isnan(found.at):
            return found
        excluded = excluded and found.excluded
    return Lower(excluded=excluded)


def _signed_slope(potential: Potential, sign: int, x: Array) -> Array:
    return sign * potential.slope(x)


def _lower(
    psi: sympy.Expr, values: Callable[[Array], Array], r: sympy.Symbol, ends: tuple[float, float], value: float
) -> Lower:
    """A distance between two ends at which a formula is below a value, or the proof that there is none."""
    try:
        slope = derivative(psi, r)
        edges = np.geomspace(*ends, BOXES + 1)
        low, high = edges[:-1], edges[1:]
        for _ in range(ROUNDS):
            middle = 0.5 * (low + high)
            at = enclosed(psi, r, Interval.of(middle))
            if (at.hi < value).any():
                k = int(np.argmin(at.hi))
                return _lowest_near(values, float(middle[k]), 0.5 * float(high[k] - low[k]))
            box = Interval.of(low, high)
            found = enclosed(psi, r, box).lo
            with np.errstate(all="ignore"):
                line = (at + enclosed(slope, r, box) * (box - Interval.of(middle))).lo
            # Where pieces meet a slope does not bound the values.
            found = np.where(_of_one_piece(psi, r, box), np.fmax(found, line), found)
            near = ~(found >= value)
            if not near.any():
                return Lower(excluded=True)
            low, high = low[near], high[near]
            if len(low) * PARTS > MOST_BOXES:
                break
            places = low[:, None] + (high - low)[:, None] * np.linspace(0.0, 1.0, PARTS + 1)
            places[:, -1] = high
            low, high = places[:, :-1].ravel(), places[:, 1:].ravel()
    except FormulaError:
        return Lower()
    return Lower()


def _of_one_piece(psi: sympy.Expr, r: sympy.Symbol, box: Interval) -> Mask:
    """In which ranges every formula of pieces is one of them."""
    import sympy

    found = np.ones(len(box.lo), dtype=bool)
    for each in psi.atoms(sympy.Piecewise):
        number = sympy.Piecewise(*((sympy.Integer(k), condition) for k, (_, condition) in enumerate(each.args)))
        pieces = enclosed(number, r, box)
        found &= pieces.lo == pieces.hi
    return found


def _lowest_near(values: Callable[[Array], Array], at: float, width: float) -> Lower:
    """The lowest value near a distance, computed ever nearer to it."""
    for _ in range(NARROWED):
        places = np.linspace(at - width, at + width, PLACES)
        at = float(places[np.nanargmin(values(places))])
        width *= 4.0 / (PLACES - 1)
    return Lower(at, float(values(np.array(at))))
