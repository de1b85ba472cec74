"""Interval arithmetic on arrays: every result contains all exact results for numbers of the arguments.

Sums, differences, products, quotients and square roots are correctly rounded by the processor; an interval is widened
by one unit in the last place on each side where a result is not exact. The other functions are those of NumPy, whose
errors its developers keep below 4 units in the last place; `WIDENED` units are added on each side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from flocking.arrays import Array, Mask

ANGLE_ERROR = 1e-15
"""Error of (angle / pi - place) / period relative to 1 + its size: some nine units of rounding, of three operations."""

WIDENED = 16
"""Units in the last place by which values of functions of NumPy are widened: four times their known largest error."""

LARGEST_ANGLE = 1e8
"""Angles beyond this are not reduced: a sine may be anything in [-1, 1]."""


@dataclass(frozen=True, eq=False)
class Interval:
    """Closed intervals, one for each element of two arrays of one shape.

    Parameters
    ----------
    lo, hi
        Ends, ``lo <= hi``; they may be infinite.
    """

    lo: Array
    hi: Array

    @classmethod
    def of(cls, lo: ArrayLike, hi: ArrayLike | None = None) -> Interval:
        """Intervals from ``lo`` to ``hi``, or of one number each where that is absent."""
        low = np.asarray(lo, dtype=np.float64)
        return cls(low, low if hi is None else np.asarray(hi, dtype=np.float64))

    def __add__(self, other: Interval) -> Interval:
        return Interval(_sum(self.lo, other.lo, -np.inf), _sum(self.hi, other.hi, np.inf))

    def __neg__(self) -> Interval:
        return Interval(-self.hi, -self.lo)

    def __sub__(self, other: Interval) -> Interval:
        return self + (-other)

    def __mul__(self, other: Interval) -> Interval:
        if self.lo is self.hi and self.lo.ndim == 0:
            return other._times(self.lo)
        if other.lo is other.hi and other.lo.ndim == 0:
            return self._times(other.lo)
        if self.lo.min(initial=0.0) >= 0.0 and other.lo.min(initial=0.0) >= 0.0:
            # Of numbers that are not negative the ends belong together.
            return Interval(_product(self.lo, other.lo, -np.inf), _product(self.hi, other.hi, np.inf))
        ends = [(a, b) for a in (self.lo, self.hi) for b in (other.lo, other.hi)]
        lows, highs = ([_product(a, b, side) for a, b in ends] for side in (-np.inf, np.inf))
        lo = np.minimum(np.minimum(lows[0], lows[1]), np.minimum(lows[2], lows[3]))
        return Interval(lo, np.maximum(np.maximum(highs[0], highs[1]), np.maximum(highs[2], highs[3])))

    def _times(self, number: Array) -> Interval:
        """These intervals times one number, an array without dimensions; by one and minus one without widening."""
        if number == 1.0:
            return self
        if number == -1.0:
            return -self
        lo, hi = (self.lo, self.hi) if number >= 0.0 else (self.hi, self.lo)
        low = _product(lo, number, -np.inf)
        return Interval(low, _product(hi, number, np.inf))

    def reciprocal(self) -> Interval:
        """Values 1/x; the whole line where zero lies inside an interval."""
        with np.errstate(all="ignore"):
            lo, hi = 1.0 / self.hi, 1.0 / self.lo
        lo, hi = np.where(self.hi == 0.0, -np.inf, lo), np.where(self.lo == 0.0, np.inf, hi)
        inside = (self.lo < 0.0) & (self.hi > 0.0) | (self.lo == 0.0) & (self.hi == 0.0)
        found = _widened(lo, hi, 1)
        # The sign of a quotient is exact.
        lo = np.where(self.lo >= 0.0, np.maximum(found.lo, 0.0), found.lo)
        hi = np.where(self.hi <= 0.0, np.minimum(found.hi, 0.0), found.hi)
        return Interval(np.where(inside, -np.inf, lo), np.where(inside, np.inf, hi))

    def __truediv__(self, other: Interval) -> Interval:
        return self * other.reciprocal()

    def sqrt(self) -> Interval:
        """Square roots; the whole line where an interval holds negative numbers."""
        with np.errstate(all="ignore"):
            return _widened(np.sqrt(self.lo), np.sqrt(self.hi), 1)._known(self.lo >= 0.0)

    def power(self, exponent: int) -> Interval:
        """Integer powers.

        Parameters
        ----------
        exponent
            The power, of either sign.
        """
        if exponent < 0:
            return self.power(-exponent).reciprocal()
        found, lo, hi = Interval.of(np.ones_like(self.lo)), self.lo, self.hi
        if exponent % 2 == 0:
            least = np.where((lo <= 0.0) & (hi >= 0.0), 0.0, np.minimum(np.abs(lo), np.abs(hi)))
            lo, hi = least, np.maximum(np.abs(self.lo), np.abs(self.hi))
            base = found = Interval(lo, hi) if exponent else found
            for _ in range(exponent - 1):
                found = found * base
            return Interval(np.maximum(found.lo, 0.0), found.hi)
        # Odd powers rise: each end has its own.
        ends = [Interval.of(x) for x in (lo, hi)]
        powers = ends
        for _ in range(exponent - 1):
            powers = [p * x for p, x in zip(powers, ends, strict=True)]
        return Interval(powers[0].lo, powers[1].hi)

    def exp(self) -> Interval:
        """Exponentials."""
        with np.errstate(all="ignore"):
            found = _widened(np.exp(self.lo), np.exp(self.hi), WIDENED)
        return Interval(np.maximum(found.lo, 0.0), found.hi)

    def log(self) -> Interval:
        """Logarithms; the whole line where an interval holds negative numbers."""
        with np.errstate(all="ignore"):
            found = _widened(np.log(self.lo), np.log(self.hi), WIDENED)
        return found._known(self.lo >= 0.0)

    def atan(self) -> Interval:
        """Arcus tangents."""
        return _widened(np.arctan(self.lo), np.arctan(self.hi), WIDENED)

    def tanh(self) -> Interval:
        """Hyperbolic tangents."""
        return _widened(np.tanh(self.lo), np.tanh(self.hi), WIDENED)

    def sinh(self) -> Interval:
        """Hyperbolic sines."""
        with np.errstate(all="ignore"):
            return _widened(np.sinh(self.lo), np.sinh(self.hi), WIDENED)

    def cosh(self) -> Interval:
        """Hyperbolic cosines."""
        size = self.absolute()
        with np.errstate(all="ignore"):
            return _widened(np.cosh(size.lo), np.cosh(size.hi), WIDENED)

    def absolute(self) -> Interval:
        """Absolute values."""
        a, b = np.abs(self.lo), np.abs(self.hi)
        across = (self.lo <= 0.0) & (self.hi >= 0.0)
        return Interval(np.where(across, 0.0, np.minimum(a, b)), np.maximum(a, b))

    def sin(self) -> Interval:
        """Sines."""
        return self._wave(np.sin(self.lo), np.sin(self.hi), 0.5)

    def cos(self) -> Interval:
        """Cosines."""
        return self._wave(np.cos(self.lo), np.cos(self.hi), 0.0)

    def tan(self) -> Interval:
        """Tangents; the whole line where a pole may lie in an interval."""
        with np.errstate(all="ignore"):
            found = _widened(np.tan(self.lo), np.tan(self.hi), WIDENED)
        return found._known(~self._may_hold(0.5, 1.0))

    def _wave(self, first: Array, last: Array, crest: float) -> Interval:
        """Values of a sine or cosine whose maxima lie at (crest + 2k) pi."""
        found = _widened(np.minimum(first, last), np.maximum(first, last), WIDENED)
        top, bottom = self._may_hold(crest, 2.0), self._may_hold(crest + 1.0, 2.0)
        lo, hi = np.where(bottom, -1.0, found.lo), np.where(top, 1.0, found.hi)
        return Interval(np.maximum(lo, -1.0), np.minimum(hi, 1.0))

    def _may_hold(self, place: float, period: float) -> Mask:
        """Whether an interval may hold one of the angles (place + k period) pi."""
        with np.errstate(all="ignore"):
            a, b = ((x / np.pi - place) / period for x in (self.lo, self.hi))
            slack = ANGLE_ERROR * (1.0 + np.maximum(np.abs(a), np.abs(b)))
            found = np.floor(b + slack) >= np.ceil(a - slack)
        far = ~(np.maximum(np.abs(self.lo), np.abs(self.hi)) <= LARGEST_ANGLE)
        return np.asarray(found | far)

    def hull(self, other: Interval) -> Interval:
        """The smallest intervals that hold two each.

        Parameters
        ----------
        other
            The second of each two.
        """
        return Interval(np.minimum(self.lo, other.lo), np.maximum(self.hi, other.hi))

    def meet(self, other: Interval) -> Interval:
        """The numbers in both of two intervals, which must not be disjoint.

        Parameters
        ----------
        other
            The second of each two.
        """
        return Interval(np.maximum(self.lo, other.lo), np.minimum(self.hi, other.hi))

    def total(self) -> Interval:
        """The sum of all, one interval."""
        if not self.lo.size:
            return Interval.of(0.0)
        if not (np.isfinite(self.lo).all() and np.isfinite(self.hi).all()):
            return Interval.of(
                -np.inf if (self.lo == -np.inf).any() else float(np.nextafter(_total(self.lo, -np.inf), -np.inf)),
                np.inf if (self.hi == np.inf).any() else float(np.nextafter(_total(self.hi, np.inf), np.inf)),
            )
        return _widened(np.float64(_total(self.lo, -np.inf)), np.float64(_total(self.hi, np.inf)), 1)

    def _known(self, where: Mask) -> Interval:
        """These intervals where a condition holds, and the whole line elsewhere."""
        lo, hi = np.where(where, self.lo, -np.inf), np.where(where, self.hi, np.inf)
        return Interval(np.where(np.isnan(lo), -np.inf, lo), np.where(np.isnan(hi), np.inf, hi))


def _total(numbers: Array, side: float) -> float:
    """The sum of all, rounded once; a side where the sum is beyond double precision."""
    import math

    try:
        return math.fsum(numbers.flat)
    except OverflowError:
        return side


def _sum(a: Array, b: Array, side: float) -> Array:
    """Sums, rounded to a side where they are not exact."""
    with np.errstate(all="ignore"):
        s = a + b
        back = s - a
        error = (a - (s - back)) + (b - back)
    # Infinite ends of different signs: nothing is known.
    s = np.where(np.isnan(s), side, s)
    exact = (error == 0.0) | np.isinf(s) & (np.isinf(a) | np.isinf(b))
    return np.where(exact, s, np.nextafter(s, side))


def _product(a: Array, b: Array, side: float) -> Array:
    """Products, rounded to a side but where a factor is zero.

    An infinite end is no number of its interval, so that its product with zero is zero.
    """
    with np.errstate(all="ignore"):
        found = a * b
        wide = np.nextafter(found, side)
    exact = (a == 0.0) | (b == 0.0)
    return np.asarray(wide if not exact.any() else np.where(exact, 0.0, wide))


def _widened(lo: ArrayLike, hi: ArrayLike, units: int) -> Interval:
    """Intervals from ``lo`` to ``hi`` that are larger by some units in the last place."""
    low, high = np.asarray(lo, dtype=np.float64), np.asarray(hi, dtype=np.float64)
    with np.errstate(all="ignore"):
        if units == 1:
            low, high = np.nextafter(low, -np.inf), np.nextafter(high, np.inf)
        else:
            # Values beyond the largest number are finite, and above it.
            low = np.where(np.isinf(low), np.nextafter(low, -np.inf), low - units * np.spacing(np.abs(low)))
            high = np.where(np.isinf(high), np.nextafter(high, np.inf), high + units * np.spacing(np.abs(high)))
    return Interval(low, high)
