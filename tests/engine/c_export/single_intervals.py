"""Intervals that hold the exact result of a computation and that of single precision alike.

The ends are numbers of double precision. Every operation widens its result by one rounding of single precision, which
is 2^-24 of its size and, where digits are lost below the normal numbers, 2^-149. The roundings of the ends themselves,
2^-53, lie within the millionth by which the former is enlarged.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flocking.engine.c_export.elementary_functions import BOUNDS, SUBNORMAL
from flocking.formula.c_source import LEAST_SINGLE

ROUNDING = 2.0**-24 * (1 + 1e-6)
SMALLEST = 2.0**-149
LARGEST = float(np.finfo(np.float32).max)
LARGEST_ANGLE = 1e3


class Unbounded(Exception):
    """A result may be infinite, or no number."""


@dataclass(frozen=True, eq=False, slots=True)
class Single:
    """All numbers from `lo` to `hi`, both finite.

    Comparisons are True, False, or None where numbers of the intervals differ in them.
    """

    lo: float
    hi: float

    def __neg__(self):
        return Single(-self.hi, -self.lo)

    def __add__(self, other):
        if other.lo == other.hi == 0.0:
            return self
        if self.lo == self.hi == 0.0:
            return other
        return rounded(self.lo + other.lo, self.hi + other.hi)

    def __sub__(self, other):
        return self + (-other)

    def __mul__(self, other):
        if self.lo == self.hi == 0.0 or other.lo == other.hi == 0.0:
            return ZERO
        ends = (self.lo * other.lo, self.lo * other.hi, self.hi * other.lo, self.hi * other.hi)
        return rounded(min(ends), max(ends))

    def __truediv__(self, other):
        if other.lo <= 0.0 <= other.hi:
            raise Unbounded
        if self.lo == self.hi == 0.0:
            return ZERO
        ends = (self.lo / other.lo, self.lo / other.hi, self.hi / other.lo, self.hi / other.hi)
        return rounded(min(ends), max(ends))

    def __lt__(self, other):
        return True if self.hi < other.lo else False if self.lo >= other.hi else None

    def __le__(self, other):
        return True if self.hi <= other.lo else False if self.lo > other.hi else None

    def __gt__(self, other):
        return other < self

    def __ge__(self, other):
        return other <= self

    def __eq__(self, other):
        if self.hi < other.lo or self.lo > other.hi:
            return False
        return True if self.lo == self.hi == other.lo == other.hi else None

    def __ne__(self, other):
        found = self == other
        return None if found is None else not found


ZERO = Single(0.0, 0.0)


def rounded(lo, hi, units=1.0, steps=1.0):
    """An interval widened by roundings; signs are kept, as rounding keeps them."""
    low = lo - (abs(lo) * ROUNDING * units + SMALLEST * steps)
    high = hi + (abs(hi) * ROUNDING * units + SMALLEST * steps)
    low, high = 0.0 if lo >= 0.0 > low else low, 0.0 if hi <= 0.0 < high else high
    if not (low >= -LARGEST and high <= LARGEST):
        raise Unbounded
    return Single(low, high)


def literal(value):
    """A number of the source, and all that single precision rounds to it."""
    if value == 0.0:
        return ZERO
    if value == LEAST_SINGLE:
        # Smaller ones are written so where they are added to keep a sum from zero.
        return Single(0.0, value)
    return Single(value - abs(value) * ROUNDING, value + abs(value) * ROUNDING)


def whole(value):
    """A whole number as one of single precision."""
    return Single(float(value), float(value)) if abs(value) <= 2**24 else rounded(float(value), float(value))


def hull(a, b):
    """The smallest interval that holds two."""
    return Single(min(a.lo, b.lo), max(a.hi, b.hi))


def square(x):
    """The product of a number with itself."""
    if x.lo == x.hi == 0.0:
        return ZERO
    a, b = abs(x.lo), abs(x.hi)
    least = 0.0 if x.lo <= 0.0 <= x.hi else min(a, b)
    return rounded(least * least, max(a, b) ** 2)


def smaller(a, b):
    """The smaller of two numbers."""
    return Single(min(a.lo, b.lo), min(a.hi, b.hi))


def larger(a, b):
    """The larger of two numbers."""
    return Single(max(a.lo, b.lo), max(a.hi, b.hi))


def sqrt(x):
    if x.lo == x.hi == 0.0:
        return ZERO
    if x.lo < 0.0:
        raise Unbounded
    return rounded(math.sqrt(x.lo), math.sqrt(x.hi))


def exp(x):
    if x.hi > math.log(LARGEST):
        raise Unbounded
    return rounded(math.exp(x.lo), math.exp(x.hi), *_stated("exp"))


def log(x):
    if x.lo <= 0.0:
        raise Unbounded
    return rounded(math.log(x.lo), math.log(x.hi), *_stated("log"))


def pow(base, exponent):
    """A power; with both arguments it rises or falls all the way."""
    if base.lo <= 0.0:
        raise Unbounded
    try:
        ends = [a**b for a in (base.lo, base.hi) for b in (exponent.lo, exponent.hi)]
    except OverflowError:
        raise Unbounded from None
    return rounded(min(ends), max(ends), *_stated("pow"))


def _stated(name):
    """Stated error of a function, in roundings of its result and in units below the normal numbers."""
    units = BOUNDS[name][0]
    return 2 * units, units + SUBNORMAL


def sin(x):
    return _wave(x, math.sin, 0.5, BOUNDS["sin"][0])


def cos(x):
    return _wave(x, math.cos, 0.0, BOUNDS["cos"][0])


def _wave(x, function, crest, units):
    """A sine or cosine whose maxima lie at (crest + 2k) pi; a slack of 1e-9 counts one nearby as inside."""
    if max(abs(x.lo), abs(x.hi)) >= LARGEST_ANGLE:
        raise Unbounded

    def holds(place):
        a, b = ((end / math.pi - place) / 2.0 for end in (x.lo, x.hi))
        return math.floor(b + 1e-9) >= math.ceil(a - 1e-9)

    ends = (function(x.lo), function(x.hi))
    slack = 2 * ROUNDING * units
    low, high = -1.0 if holds(crest + 1.0) else min(ends), 1.0 if holds(crest) else max(ends)
    return Single(low - slack, high + slack)


def floor(x):
    return Single(float(math.floor(x.lo)), float(math.floor(x.hi)))


def fabs(x):
    a, b = abs(x.lo), abs(x.hi)
    return Single(0.0 if x.lo <= 0.0 <= x.hi else min(a, b), max(a, b))


def copysign(size, sign):
    size = fabs(size)
    if sign.lo > 0.0:
        return size
    return -size if sign.hi < 0.0 else Single(-size.hi, size.hi)
