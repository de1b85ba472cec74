"""Interval arithmetic on a function and its first two derivatives: bounds over intervals of the argument.

Bounds are not widened for rounding: they serve to find structure, not to prove it to the last digit.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from types import FunctionType
from typing import Any, TypeVar

import numpy as np

from flocking.arrays import Array

Interval = tuple[Array, Array]

LARGEST_INTEGER_POWER = 1e6
"""Integer exponents below it may have negative bases; formulas have exponents of at most 256 (`grammar`)."""


def _sound(low: Array, high: Array) -> Interval:
    """Bounds with NaN replaced by infinities: a value that could not be computed is unknown."""
    lost = np.isnan(low) | np.isnan(high)
    return (np.where(lost, -np.inf, low), np.where(lost, np.inf, high)) if lost.any() else (low, high)


def _add(a: Interval, b: Interval) -> Interval:
    return _sound(a[0] + b[0], a[1] + b[1])


def _times(a: Interval, b: Interval) -> Interval:
    # Zero times unbounded is zero, which no product of the other bounds leaves out: NaN is passed over.
    p, q, r, s = a[0] * b[0], a[0] * b[1], a[1] * b[0], a[1] * b[1]
    return _sound(np.fmin(np.fmin(p, q), np.fmin(r, s)), np.fmax(np.fmax(p, q), np.fmax(r, s)))


def _scaled(a: Interval, factor: float) -> Interval:
    return (a[0] * factor, a[1] * factor) if factor > 0 else _sound(a[1] * factor, a[0] * factor)


def _inverse(a: Interval) -> Interval:
    within = (a[0] <= 0) & (a[1] >= 0)
    low = np.where(within, np.where(a[0] == 0, 1 / a[1], -np.inf), 1 / a[1])
    high = np.where(within, np.where(a[1] == 0, 1 / a[0], np.inf), 1 / a[0])
    return _sound(low, high)


def _rising(function: Callable[[Array], Array], a: Interval) -> Interval:
    return _sound(function(a[0]), function(a[1]))


def _integer_power(a: Interval, n: int) -> Interval:
    if n < 0:
        return _inverse(_integer_power(a, -n))
    if n == 0:
        return np.ones_like(a[0]), np.ones_like(a[1])
    low, high = a[0] ** n, a[1] ** n
    if n % 2:
        return _sound(low, high)
    within = (a[0] <= 0) & (a[1] >= 0)
    return _sound(np.where(within, 0.0, np.minimum(low, high)), np.maximum(low, high))


def _power(a: Interval, exponent: float) -> Interval:
    if float(exponent).is_integer() and abs(exponent) < LARGEST_INTEGER_POWER:
        return _integer_power(a, int(exponent))
    low, high = (np.maximum(x, 0.0) ** exponent for x in a)
    return _sound(np.minimum(low, high), np.maximum(low, high))


def _wave(a: Interval, shift: float) -> Interval:
    """Cosine of ``a - shift``."""
    low, high = a[0] - shift, a[1] - shift
    ends = np.cos(low), np.cos(high)
    top = np.floor(high / (2 * np.pi)) >= np.ceil(low / (2 * np.pi))
    bottom = np.floor((high - np.pi) / (2 * np.pi)) >= np.ceil((low - np.pi) / (2 * np.pi))
    largest = np.where(top | ~np.isfinite(high - low), 1.0, np.maximum(*ends))
    return np.where(bottom | ~np.isfinite(high - low), -1.0, np.minimum(*ends)), largest


class Jet:
    """Bounds of a function and its first two derivatives on each of several intervals.

    Parameters
    ----------
    parts
        Bounds of the value, the slope and the curvature.
    """

    __array_ufunc__ = None

    def __init__(self, value: Interval, slope: Interval, curvature: Interval) -> None:
        self.parts = (value, slope, curvature)

    @classmethod
    def variable(cls, low: Array, high: Array) -> Jet:
        """The argument itself on the intervals from ``low`` to ``high``."""
        one, zero = np.ones_like(low), np.zeros_like(low)
        return cls((low, high), (one, one), (zero, zero))

    def constant(self, value: float) -> Jet:
        """A constant on the same intervals."""
        values, zero = np.full_like(self.parts[0][0], value), np.zeros_like(self.parts[0][0])
        return Jet((values, values), (zero, zero), (zero, zero))

    def _jet(self, other: Jet | float) -> Jet:
        return other if isinstance(other, Jet) else self.constant(float(other))

    def composed(self, value: Interval, slope: Interval, curvature: Interval) -> Jet:
        """A function of this one, from bounds of its ``value``, ``slope`` and ``curvature`` there."""
        _, first, second = self.parts
        bent = _times(curvature, _integer_power(first, 2))
        return Jet(value, _times(slope, first), _add(bent, _times(slope, second)))

    def __add__(self, other: Jet | float) -> Jet:
        return Jet(*(_add(a, b) for a, b in zip(self.parts, self._jet(other).parts, strict=True)))

    def __neg__(self) -> Jet:
        return Jet(*(_scaled(a, -1.0) for a in self.parts))

    def __pos__(self) -> Jet:
        return self

    def __sub__(self, other: Jet | float) -> Jet:
        return self.__add__(-other)

    def __rsub__(self, other: float) -> Jet:
        return (-self).__add__(other)

    def __mul__(self, other: Jet | float) -> Jet:
        if not isinstance(other, Jet):
            return Jet(*(_scaled(a, float(other)) for a in self.parts))
        (a, a1, a2), (b, b1, b2) = self.parts, other.parts
        slope = _add(_times(a1, b), _times(a, b1))
        return Jet(_times(a, b), slope, _add(_add(_times(a2, b), _scaled(_times(a1, b1), 2.0)), _times(a, b2)))

    def __truediv__(self, other: Jet | float) -> Jet:
        return self.__mul__(other.__pow__(-1) if isinstance(other, Jet) else 1.0 / float(other))

    def __rtruediv__(self, other: float) -> Jet:
        return self.__pow__(-1).__mul__(other)

    def __pow__(self, exponent: Jet | float) -> Jet:
        if isinstance(exponent, Jet):
            return Functions.exp(Functions.log(self) * exponent)
        c, base = float(exponent), self.parts[0]
        slope, curvature = _scaled(_power(base, c - 1), c), _scaled(_power(base, c - 2), c * (c - 1))
        return self.composed(_power(base, c), slope, curvature)

    def __rpow__(self, base: float) -> Jet:
        return Functions.exp(self * math.log(base))

    def __abs__(self) -> Jet:
        return (self * self).__pow__(0.5)

    __radd__, __rmul__ = __add__, __mul__


JetOrNumber = TypeVar("JetOrNumber", Jet, float)


class Functions:
    """The functions of module ``math`` that printed formulas call, on jets and on numbers."""

    pi, e = math.pi, math.e

    @staticmethod
    def exp(x: JetOrNumber) -> JetOrNumber:
        """Exponential."""
        if not isinstance(x, Jet):
            return math.exp(x)
        value = _rising(np.exp, x.parts[0])
        return x.composed(value, value, value)

    @staticmethod
    def log(x: JetOrNumber) -> JetOrNumber:
        """Natural logarithm."""
        if not isinstance(x, Jet):
            return math.log(x)
        base = np.maximum(x.parts[0][0], 0.0), np.maximum(x.parts[0][1], 0.0)
        return x.composed(_rising(np.log, base), _inverse(base), _scaled(_power(base, -2), -1.0))

    @staticmethod
    def sqrt(x: JetOrNumber) -> JetOrNumber:
        """Square root."""
        return x**0.5 if isinstance(x, Jet) else math.sqrt(x)

    @staticmethod
    def sin(x: JetOrNumber) -> JetOrNumber:
        """Sine."""
        return Functions._turned(x, math.sin, np.pi / 2)

    @staticmethod
    def cos(x: JetOrNumber) -> JetOrNumber:
        """Cosine."""
        return Functions._turned(x, math.cos, 0.0)

    @staticmethod
    def _turned(x: JetOrNumber, plain: Callable[[float], float], shift: float) -> JetOrNumber:
        if not isinstance(x, Jet):
            return plain(x)
        value = _wave(x.parts[0], shift)
        return x.composed(value, _wave(x.parts[0], shift - np.pi / 2), _scaled(value, -1.0))

    @staticmethod
    def tan(x: JetOrNumber) -> JetOrNumber:
        """Tangent."""
        return Functions.sin(x) / Functions.cos(x) if isinstance(x, Jet) else math.tan(x)

    @staticmethod
    def tanh(x: JetOrNumber) -> JetOrNumber:
        """Hyperbolic tangent."""
        if not isinstance(x, Jet):
            return math.tanh(x)
        value = _rising(np.tanh, x.parts[0])
        slope = _add((np.ones_like(value[0]),) * 2, _scaled(_integer_power(value, 2), -1.0))
        return x.composed(value, slope, _scaled(_times(value, slope), -2.0))

    @staticmethod
    def sinh(x: JetOrNumber) -> JetOrNumber:
        """Hyperbolic sine."""
        return (Functions.exp(x) - Functions.exp(-x)) / 2 if isinstance(x, Jet) else math.sinh(x)

    @staticmethod
    def cosh(x: JetOrNumber) -> JetOrNumber:
        """Hyperbolic cosine."""
        return (Functions.exp(x) + Functions.exp(-x)) / 2 if isinstance(x, Jet) else math.cosh(x)

    @staticmethod
    def atan(x: JetOrNumber) -> JetOrNumber:
        """Arc tangent."""
        if not isinstance(x, Jet):
            return math.atan(x)
        base = x.parts[0]
        slope = _inverse(_add((np.ones_like(base[0]),) * 2, _integer_power(base, 2)))
        curvature = _scaled(_times(base, _integer_power(slope, 2)), -2.0)
        return x.composed(_rising(np.arctan, base), slope, curvature)


def on_jets(function: FunctionType) -> Callable[..., Any]:
    """A ``function`` made of arithmetic and of module ``math``, for jets instead of numbers."""
    moved = FunctionType(function.__code__, {"math": Functions})

    def quiet(*arguments: object) -> object:
        with np.errstate(all="ignore"):
            return moved(*arguments)

    return quiet
