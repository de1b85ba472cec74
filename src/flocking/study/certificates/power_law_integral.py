"""The integral of a weight K/(sigma^2 + r^2)^beta over the distance, enclosed.

With r = sigma sinh(y) it is K sigma^(1 - 2 beta) times the integral of cosh(y)^(1 - 2 beta), a function without scales
that is smooth up to infinity. The midpoint rule with the second derivative enclosed on every cell bounds it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flocking.formula.intervals import Interval

FAR = 1e8
"""Distance, in larger of scale and begin, from which on the weight is replaced by the power that bounds it: they differ
by
(scale/r)^2 = 1e-16 there, below rounding."""

CELLS = 4096
"""Number of cells of the midpoint rule. Every number of them encloses the integral; the width falls as its inverse
third power until rounding: the curvature of a cell, enclosed, is multiplied by its length to the third."""

PARTS, NODES = 256, 6
"""Parts of Gauss' rule for an estimate, and the nodes of each."""

ONE = Interval.of(1.0)


@dataclass(frozen=True)
class PowerLaw:
    """A weight K/(sigma^2 + r^2)^beta of the distance r.

    Parameters
    ----------
    gain, exponent, scale
        K, beta and sigma.
    """

    gain: float
    exponent: float
    scale: float

    @property
    def summable(self) -> bool:
        """Whether the integral up to infinity is finite."""
        return self.gain == 0.0 or self.exponent > 0.5

    def at(self, r: Interval) -> Interval:
        """The weight at distances."""
        square = Interval.of(self.scale).power(2) + r.power(2)
        return Interval.of(self.gain) * _power(square, Interval.of(-self.exponent))

    def integral(self, begin: Interval, end: Interval) -> Interval:
        """The integral between two distances, ``begin`` below ``end``, each one interval.

        Parameters
        ----------
        begin, end
            The distances, enclosed.
        """
        least = self._between(float(begin.hi), float(end.lo)).lo if begin.hi < end.lo else 0.0
        return Interval.of(max(float(least), 0.0), float(self._between(float(begin.lo), float(end.hi)).hi))

    def estimate(self, begin: float, end: float) -> float:
        """The integral from ``begin`` to ``end`` by Gauss' rule; its error is not bounded."""
        nodes, shares = np.polynomial.legendre.leggauss(NODES)
        places = np.linspace(np.arcsinh(begin / self.scale), np.arcsinh(end / self.scale), PARTS + 1)
        half = 0.5 * np.diff(places)
        y = places[:-1, None] + half[:, None] * (1.0 + nodes)
        power = 1.0 - 2.0 * self.exponent
        values = np.exp(power * np.log(np.cosh(y))) @ shares
        return float(self.gain * self.scale**power * (half @ values))

    def beyond(self, begin: float) -> float:
        """An upper bound of the integral from ``begin`` to infinity; infinite where it is not summable."""
        if self.gain == 0.0:
            return 0.0
        if not self.summable:
            return np.inf
        end = Interval.of(max(begin, self.scale) * FAR)
        less = Interval.of(2.0) * Interval.of(self.exponent) - ONE
        # The weight is below K r^(-2 beta).
        tail = Interval.of(self.gain) * _power(end, -less) / less
        return float((self.integral(Interval.of(begin), end) + tail).hi)

    def _between(self, begin: float, end: float) -> Interval:
        first, last = self._angle(begin), self._angle(end)
        if self.gain == 0.0:
            return Interval.of(0.0)
        power = ONE - Interval.of(2.0) * Interval.of(self.exponent)
        inner = _cosh_integral(power, float(first.hi), float(last.lo)) if first.hi < last.lo else Interval.of(0.0)
        # The ends of y are known to some units in the last place: what may be missing there is added.
        ends = _cosh_power(power, first) * Interval.of(0.0, _length(first))
        ends = ends + _cosh_power(power, last) * Interval.of(0.0, _length(last))
        return Interval.of(self.gain) * _power(Interval.of(self.scale), power) * (inner + ends)

    def _angle(self, r: float) -> Interval:
        """The y of a distance."""
        x = Interval.of(r) / Interval.of(self.scale)
        return (x + (x.power(2) + ONE).sqrt()).log().meet(Interval.of(0.0, np.inf))


def _length(y: Interval) -> float:
    return float(np.nextafter(y.hi - y.lo, np.inf))


def _power(base: Interval, exponent: Interval) -> Interval:
    """Powers of positive intervals."""
    return (exponent * base.log()).exp()


def _cosh_power(power: Interval, y: Interval) -> Interval:
    return _power(y.cosh(), power)


def _cosh_integral(power: Interval, begin: float, end: float) -> Interval:
    """The integral of cosh(y)^power from ``begin`` to ``end``."""
    places = np.linspace(begin, end, CELLS + 1)
    places[0], places[-1] = begin, end
    low, high = places[:-1], places[1:]
    middle = Interval.of(0.5 * (low + high))
    above, below = Interval.of(high) - middle, Interval.of(low) - middle
    value = _cosh_power(power, middle)
    slope = power * value * middle.tanh()
    cell = Interval.of(low, high)
    # The second derivative of cosh^a is a cosh^a (a + (1 - a)/cosh^2).
    curvature = power * _cosh_power(power, cell) * (power + (ONE - power) / cell.cosh().power(2))
    parts = value * (above - below) + slope * (above.power(2) - below.power(2)) * Interval.of(0.5)
    sixth = ONE / Interval.of(6.0)
    parts = parts + curvature * (above.power(3) - below.power(3)) * sixth
    return parts.total()
