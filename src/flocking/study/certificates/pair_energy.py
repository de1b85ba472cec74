"""The energy of a pair as a function of its distance, enclosed: least value, and distances that an energy allows."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from flocking.arrays import Array
from flocking.formula.derivatives import derivative
from flocking.formula.interval_values import enclosed
from flocking.formula.intervals import Interval
from flocking.study.certificates.pieces import factored

if TYPE_CHECKING:
    import sympy

MOST_ENERGIES = 64
"""Pair energies that are stored: those of a law, which all its certificates ask for; each holds its boxes."""

BOXES = 512
"""Intervals into which a range of distances is divided at first, and of which each round looks at most at 8 times as
many."""

ROUNDS = 60
"""Most rounds of refinement; each divides the intervals that matter by `PARTS`."""

PARTS = 16
"""Parts into which an interval that matters is divided."""

FINEST = 1e-13
"""Relative width at which refinement ends, some hundred units of rounding."""

SHORTEST = (1e-300, 1e-150, 1e-100, 1e-60, 1e-30)
"""Distances next to zero: what holds from zero to any of them holds in the limit. Powers of the smallest underflow."""

TOUCHING = 1e-16
"""Distances below this share of the largest one are not distinguished from zero."""

HALVINGS = 14
"""Rounds that divide a range by `PARTS` until two doubles of one scale are neighbours, and some more: 16^14 is 2^56."""

EDGE_PARTS = 128
"""Parts of an interval in which an edge is looked for: a formula takes hardly longer on 128 intervals than on 16."""

POWERS = 2.0 ** np.arange(-200, 201)
"""Distances of all scales, 1e-60 to 1e60, at which an energy is looked at; the longest is as good as no bound."""

CELLS = 2**16
"""Cells of the integral of a slope. Every number of them encloses it; the width falls as its inverse, and an array of
each bound takes half a megabyte."""

NEAREST, FARTHEST = 1e-9, 1e9
"""Share of a range below which the first division has one interval, and the least distance beyond which energies that
never rise are bounded at once."""


@dataclass(frozen=True, eq=False)
class PairEnergy:
    """The energy of a pair and its slope, as formulas of the distance.

    Below the end the energy is continuous, and the slope is its derivative at all distances but some: energies differ
    by the integral of the slope.

    Parameters
    ----------
    symbol
        The distance.
    value, slope
        Energy and its derivative; all their numbers are known.
    end
        The distance up to which the pair has this energy, infinite where there is no such.
    """

    symbol: sympy.Symbol
    value: sympy.Expr
    slope: sympy.Expr
    end: float

    def on(self, r: Interval) -> Interval:
        """Energies at distances in intervals."""
        found = self._values(r)
        if np.array_equal(r.lo, r.hi):
            return found
        with np.errstate(all="ignore"):
            middle, slope = 0.5 * r.lo + 0.5 * r.hi, self.slope_on(r)
            places = Interval.of(np.stack(np.broadcast_arrays(r.lo, r.hi, middle)))
            values = self._values(places)
            first, last, centre = (Interval(values.lo[k], values.hi[k]) for k in range(3))
            other = centre + slope * (r - Interval.of(middle))
        known = np.isfinite(middle) & (middle > 0.0)
        found = found.meet(Interval(np.where(known, other.lo, -np.inf), np.where(known, other.hi, np.inf)))
        # Where it falls or rises throughout, its ends are its least and largest value.
        falls, rises = slope.hi <= 0.0, slope.lo >= 0.0
        lo = np.where(falls & np.isfinite(r.hi), last.lo, np.where(rises & (r.lo > 0.0), first.lo, -np.inf))
        hi = np.where(falls & (r.lo > 0.0), first.hi, np.where(rises & np.isfinite(r.hi), last.hi, np.inf))
        return found.meet(Interval(lo, hi))

    def _values(self, r: Interval) -> Interval:
        """Energies at distances in intervals, by the formula alone."""
        return enclosed(self.value, self.symbol, r)

    @cached_property
    def _slopes(self) -> tuple[sympy.Expr, ...]:
        """The slope, and as a product where that is another formula."""
        product = factored(self.slope)
        return (self.slope,) if product == self.slope else (self.slope, product)

    def slope_on(self, r: Interval) -> Interval:
        """Slopes at distances in intervals."""
        found, *others = (enclosed(slope, self.symbol, r) for slope in self._slopes)
        for other in others:
            found = found.meet(other)
        return found

    def slopes(self, first: float, last: float) -> Interval:
        """One interval that holds the slopes at all distances from ``first`` to ``last``, which may be infinite."""
        if np.isinf(last):
            beyond = POWERS[first < POWERS]
            near = self._edges(first, float(beyond[0])) if len(beyond) else np.array([first])
            edges = np.concatenate([near, beyond[1:], [np.inf]])
        else:
            edges = self._edges(first, last)
        found = self.slope_on(Interval(edges[:-1], edges[1:]))
        return Interval.of(found.lo.min(), found.hi.max())

    @property
    def at_contact(self) -> Interval:
        """Energy at distance zero, or its limit."""
        found = self.on(Interval.of(np.zeros(len(SHORTEST)), np.array(SHORTEST)))
        return Interval.of(found.lo.max(), found.hi.min())

    def _rising_from(self) -> float:
        """A distance beyond which the energy does not fall; infinite if none is found."""
        begins = POWERS
        rises = self.slope_on(Interval.of(begins, np.full(len(begins), np.inf))).lo >= 0.0
        return float(begins[np.argmax(rises)]) if rises.any() else np.inf

    def least(self) -> Interval:
        """The infimum over all distances up to the end; its lower end is minus infinity where none was proven."""
        return self._least

    @cached_property
    def _least(self) -> Interval:
        """The infimum over all distances up to the end; its lower end is minus infinity where none was proven."""
        last, tail = self.end, np.inf
        above = float(self.on(Interval.of(POWERS[self.end > POWERS])).hi.min(initial=np.inf))
        if np.isinf(last):
            last = self._rising_from()
            if np.isinf(last):
                last, tail = self._tail(above)
        edges = self._edges(0.0, last)
        boxes = Interval(edges[:-1], edges[1:])
        below = tail
        for _ in range(ROUNDS):
            found = self.on(boxes)
            above = min(above, float(self.on(Interval.of(0.5 * (boxes.lo + boxes.hi))).hi.min()))
            below = min(tail, float(found.lo.min()))
            near = found.lo < above
            if above - below <= FINEST * (abs(above) + abs(below)) or not near.any() or near.sum() > 8 * BOXES:
                break
            if not (boxes.hi - boxes.lo > FINEST * boxes.hi)[near].any():
                break
            boxes = _parts(boxes.lo[near], boxes.hi[near])
            below = min(below, above)
        return Interval.of(min(below, above), above)

    def _tail(self, above: float) -> tuple[float, float]:
        """A distance, and a bound of the energies beyond it: where one is found, no less than the energy ``above``."""
        begins = np.append(FARTHEST, POWERS[POWERS > FARTHEST])
        found = self.on(Interval.of(begins, np.full(len(begins), np.inf))).lo
        high = found >= above
        k = int(np.argmax(high)) if high.any() else 0
        return float(begins[k]), float(found[k])

    def nearest(self, bound: Interval) -> Interval:
        """An enclosure of the smallest distance at which the energy is at most ``bound``.

        Its lower end is certain: at smaller distances the energy is above the upper end of ``bound``. At its upper end
        it is not above the lower end.
        """
        last = self.end
        # The smallest distance that is allowed is no larger than any other one, known or enclosed.
        places = POWERS[self.end > POWERS]
        allowed = self.on(Interval.of(places)).hi <= bound.lo
        if allowed.any():
            last = float(places[np.argmax(allowed)])
        elif np.isinf(last):
            largest = self.farthest(bound)
            last = float(POWERS[-1] if largest is None else largest.hi)
        return self._edge(bound, last, upper=False)

    def farthest(self, bound: Interval) -> Interval | None:
        """An enclosure of the largest distance up to the end at which the energy is at most ``bound``, as `nearest`.

        None where none was found: where the energy never rises above it, or too late.
        """
        last = self.end
        if np.isinf(last):
            places = POWERS[self._rising_from() <= POWERS]
            above = self.on(Interval.of(places)).lo > bound.hi
            if not above.any():
                return None
            last = float(places[np.argmax(above)])
        return self._edge(bound, last, upper=True)

    def _edge(self, bound: Interval, last: float, *, upper: bool) -> Interval:
        edges = self._edges(0.0, last)
        boxes, inner = Interval(edges[:-1], edges[1:]), last if not upper else 0.0
        # Intervals that may be allowed, the outermost last.
        open_lo: Array = np.empty(0)
        open_hi: Array = np.empty(0)
        while True:
            middle = 0.5 * (boxes.lo + boxes.hi)
            inside = middle[self.on(Interval.of(middle)).hi <= bound.lo]
            if inside.size:
                inner = max(inner, float(inside.max())) if upper else min(inner, float(inside.min()))
            order = slice(None) if upper else slice(None, None, -1)
            near = self.on(boxes).lo <= bound.hi
            open_lo = np.concatenate([open_lo, boxes.lo[near][order]])
            open_hi = np.concatenate([open_hi, boxes.hi[near][order]])
            if not open_lo.size:
                # No distance is allowed, so that every enclosure is true.
                return Interval.of(inner)
            lo, hi = float(open_lo[-1]), float(open_hi[-1])
            if hi - lo <= FINEST * hi or hi < TOUCHING * last:
                inner = self._nearest_allowed(float(bound.lo), inner, hi if upper else lo)
                return Interval.of(min(inner, hi), hi) if upper else Interval.of(lo, max(inner, lo))
            open_lo, open_hi = open_lo[:-1], open_hi[:-1]
            boxes = _parts(np.array([lo]), np.array([hi]), EDGE_PARTS)

    def _nearest_allowed(self, bound: float, inside: float, outside: float) -> float:
        """A distance at which the energy is at most ``bound``, near the last such one; ``inside`` if there is none."""
        shares = np.linspace(0.0, 1.0, PARTS + 1)[1:-1]
        for _ in range(HALVINGS):
            # From the known place outwards, up to the first that is not allowed.
            places = inside + (outside - inside) * shares
            allowed = self.on(Interval.of(places)).hi <= bound
            count = len(allowed) if allowed.all() else int(np.argmin(allowed))
            if count < len(allowed):
                outside = float(places[count])
            if count:
                inside = float(places[count - 1])
            elif outside == inside:
                break
        return inside

    def _edges(self, first: float, last: float) -> Array:
        """Edges of a first division of a range of distances, finer near its lower end."""
        edges = np.linspace(first, last, BOXES + 1)
        if first == 0.0:
            edges = np.union1d(edges, np.geomspace(NEAREST * last, last, BOXES))
        return np.asarray(edges)


@dataclass(frozen=True, eq=False)
class IntegratedEnergy(PairEnergy):
    """The energy of a pair whose slope is a formula, and which is zero at the end: minus the integral of the slope.

    The energy at the edge of a cell is the sum of the slopes on all further cells, each enclosed, times their widths.
    This holds wherever the slope jumps. `value` is not used.

    Parameters
    ----------
    symbol, value, slope, end
        As in `PairEnergy`.
    """

    @cached_property
    def _cells(self) -> tuple[Array, Interval, Interval]:
        """Edges of the cells, the slopes on each, and the energies at the edges."""
        edges = np.linspace(0.0, self.end, CELLS + 1)
        edges[-1] = self.end
        slopes = self.slope_on(Interval(edges[:-1], edges[1:]))
        falls = slopes * (Interval.of(edges[1:]) - Interval.of(edges[:-1]))
        return edges, slopes, Interval(-_sums_from_above(falls.hi, np.inf), -_sums_from_above(falls.lo, -np.inf))

    def _values(self, r: Interval) -> Interval:
        points = np.array_equal(r.lo, r.hi)
        low = np.clip(np.asarray(r.lo), 0.0, self.end)
        edges, slopes, energies = self._cells
        cell = np.clip(np.searchsorted(edges, low, side="right") - 1, 0, CELLS - 1)
        rest = Interval.of(edges[cell + 1]) - Interval.of(low)
        at = Interval(energies.lo[cell + 1], energies.hi[cell + 1]) - Interval(slopes.lo[cell], slopes.hi[cell]) * rest
        if points:
            return at
        same = np.asarray(r.lo == r.hi)
        # What an interval adds is found from its middle and its slopes.
        return Interval(np.where(same, at.lo, -np.inf), np.where(same, at.hi, np.inf))


@lru_cache(maxsize=MOST_ENERGIES)
def energy_of(symbol: sympy.Symbol, value: sympy.Expr, end: float) -> PairEnergy:
    """The energy of a pair, the same object for the same formula: what it found of it is not sought again.

    Parameters
    ----------
    symbol, value, end
        As in `PairEnergy`.
    """
    return PairEnergy(symbol, value, derivative(value, symbol), end)


@lru_cache(maxsize=16)
def integrated_energy_of(symbol: sympy.Symbol, slope: sympy.Expr, end: float) -> IntegratedEnergy:
    """The energy of a pair whose slope is a formula, as `energy_of`.

    Parameters
    ----------
    symbol, slope, end
        As in `IntegratedEnergy`.
    """
    import sympy

    return IntegratedEnergy(symbol, sympy.Integer(0), slope, end)


def _sums_from_above(values: Array, side: float) -> Array:
    """Sums of the values from each on, and zero, rounded to a side by more than their rounding errors."""
    sums = np.concatenate([np.cumsum(values[::-1])[::-1], [0.0]])
    sizes = np.concatenate([np.cumsum(np.abs(values)[::-1])[::-1], [0.0]])
    # The error of a sum of n numbers is at most n units of rounding of the sum of their sizes.
    slack = sizes * (len(values) * np.finfo(np.float64).eps)
    return np.asarray(sums + (slack if side > 0 else -slack))


def _parts(lo: Array, hi: Array, number: int = PARTS) -> Interval:
    """Every interval divided into a number of parts."""
    shares = np.linspace(0.0, 1.0, number + 1)
    edges = lo[:, None] + (hi - lo)[:, None] * shares
    edges[:, -1] = hi
    return Interval(edges[:, :-1].ravel(), edges[:, 1:].ravel())
