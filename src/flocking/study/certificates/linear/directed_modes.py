"""Modes of consensus of second order on directed graphs: complex eigenvalues mu in discs, x'' = -mu (a x + b x').

Decay: roots of s^2 + b mu s + a mu. Delay of all states: on the imaginary axis |s| = w with
w^4 = |mu|^2 (a^2 + b^2 w^2), and w tau = atan(b w/a) - |arg mu|; a mode that is stable without delay is so up to the
least such tau and for none above, since |mu (a + i b w)|/w^2 falls in w, so that every crossing is outwards. Held
control: with z = (1 + w)/(1 - w) the recursion of a period T has
(2 - mu b T) w^2 + mu T (b - a T/2) w + mu a T^2/2 = 0, both of whose roots have negative real parts if and only if, for
n1 = mu (b - a T/2) conj(2 - mu b T) and n0 = mu (a/2) conj(2 - mu b T),

    Re n1 > 0,   (Re n1)^2 Re n0 + Re n1 Im n1 Im n0 - (Im n0)^2 |2 - mu b T|^2 > 0

(Hurwitz of complex coefficients; factors of T are divided out). For real mu they are T < 2 b/a and T < 2/(b mu).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import Array, Indices, Mask
from flocking.formula.intervals import Interval

SHORTEST = 1e-6
"""Shortest period that is looked at, relative to the longest: a search, whose result is proven afterwards."""

SLACK = 1e-12
"""Relative widening of what is computed of an eigenvalue's disc, some thousand units of rounding."""

PLACES, NARROWED = 512, 6
"""Periods at which modes are looked at, and how often those between the first two where one ceases to be stable are:
512^6 is 2^54."""

SHORTENED = (1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2)
"""Shares by which the computed period is shortened until it is proven, and lengthened until the contrary is."""

PARTS, ROUNDS, MOST = 8, 16, 200_000
"""Parts of a range of periods that is looked at again, rounds, and ranges that a round looks at most at."""


@dataclass(frozen=True, eq=False)
class DirectedModes:
    """Modes x'' = -mu (a x + b x') of eigenvalues mu in discs.

    Parameters
    ----------
    centres, radii
        Centres, complex, and radii of the discs, shape (K,); all are in the right half plane.
    place_gain, rate_gain
        The coefficients a and b, positive.
    """

    centres: NDArray[np.complex128]
    radii: Array
    place_gain: Interval
    rate_gain: Interval

    @property
    def _slack(self) -> Array:
        return np.asarray(self.radii + SLACK * np.abs(self.centres))

    def rate(self) -> Interval:
        """Rate at which the slowest mode decays, negative where one grows."""
        c, r = self.centres, self._slack
        a, b = (0.5 * float(g.lo + g.hi) for g in (self.place_gain, self.rate_gain))
        wide_a, wide_b = (float(g.hi - g.lo) for g in (self.place_gain, self.rate_gain))
        root = np.sqrt(0.25 * (b * c) ** 2 - a * c)
        one, other = -0.5 * b * c + root, -0.5 * b * c - root
        large = np.where(np.abs(one) >= np.abs(other), one, other)
        roots = np.stack([large, a * c / large])
        size = np.abs(c) + r
        # Bounds of how far the coefficients b mu and a mu may be from those at the centre.
        of_b, of_a = (g * r + wide * size for g, wide in ((b, wide_b), (a, wide_a)))
        apart, most = np.abs(roots[0] - roots[1]), np.abs(roots).max(axis=0)
        at = np.abs(roots**2 + b * c * roots + a * c)
        at = at + of_b * np.abs(roots) + of_a + SLACK * (np.abs(roots) ** 2 + np.abs(b * c * roots) + np.abs(a * c))
        with np.errstate(divide="ignore"):
            # Two discs about the computed roots of a polynomial of degree 2 hold its roots (Smith 1970).
            near = 2.0 * at / apart
        # Or, where they are close: |t - z1||t - z2| is the difference of the polynomials at a root t, at most
        # of_b |t| + of_a. It is at least t^2/4 where |t| > 2 most, so that |t| <= 2 most + 4 of_b + 2 sqrt(of_a).
        bound = 2.0 * most + 4.0 * of_b + 2.0 * np.sqrt(of_a)
        product = np.sqrt(of_b * bound + of_a + SLACK * (bound + np.abs(b * c)) * bound + SLACK * np.abs(a * c))
        radius = np.minimum(near, product)
        middle = -roots.real
        return Interval.of(float((middle - radius).min() * (1 - SLACK)), float((middle + radius).min() * (1 + SLACK)))

    def delay(self) -> Interval | None:
        """The largest delay of all states that every mode stands; None where one is not known to stand none."""
        size, slack = np.abs(self.centres), self._slack
        turn = np.arcsin(np.minimum(slack / size, 1.0)) + SLACK
        angle = np.abs(np.angle(self.centres))
        angles = Interval.of(np.maximum(angle - turn, 0.0), angle + turn)
        sizes = Interval.of(size - slack, size + slack)
        a, b = self.place_gain, self.rate_gain
        x = (sizes * b).power(2)
        w = ((x + (x.power(2) + (sizes * a).power(2) * Interval.of(4.0)).sqrt()) * Interval.of(0.5)).sqrt()
        left = (w * b / a).atan() - angles
        if not (left.lo > 0.0).all():
            return None
        found = left / w
        return Interval.of(float(found.lo.min()), float(found.hi.min()))

    def period(self) -> Interval | None:
        """A period up to which all modes are stable under held control, and one at which one is not; or None."""
        damped, fast = self.rate_gain.hi / self.place_gain.lo, self.rate_gain.lo * np.abs(self.centres).min()
        longest = 4.0 * max(float(damped), 1.0 / float(fast))
        near = self._computed(longest)
        if near is None:
            return None
        below = next((t for s in SHORTENED if self._stable_up_to(t := near * (1.0 - s))), None)
        above = next((t for s in SHORTENED if self._unstable_at(t := near * (1.0 + s))), None)
        return None if below is None or above is None else Interval.of(below, above)

    def _computed(self, longest: float) -> float | None:
        """About the least period at which a mode ceases to be stable."""

        def stable(t: Array) -> Mask:
            first, second = self._conditions(Interval.of(t[:, None]), slice(None), exact=True)
            return np.asarray(((first.lo > 0.0) & (second.lo > 0.0)).all(axis=1))

        places = np.concatenate([[0.0], np.geomspace(SHORTEST * longest, longest, PLACES)])
        for _ in range(NARROWED):
            found = stable(places)
            number = int(np.argmin(found))
            if not number:
                # None or all of them are stable.
                return None
            places = np.linspace(places[number - 1], places[number], PLACES)
        return float(places[0])

    def _conditions(self, t: Interval, which: slice | Indices, *, exact: bool = False) -> tuple[Interval, Interval]:
        """The two numbers that must be positive, of some modes; ``exact`` looks at the centres of discs alone."""
        c = self.centres[which]
        slack = np.zeros(len(c)) if exact else self._slack[which]
        # A mode and its conjugate are stable together.
        re, im = (Interval.of(x - slack, x + slack) for x in (c.real, np.abs(c.imag)))
        a, b, half = self.place_gain, self.rate_gain, Interval.of(0.5)
        d_re, d_im = Interval.of(2.0) - re * b * t, -(im * b * t)
        # mu times the conjugate of d.
        m_re, m_im = re * d_re + im * d_im, im * d_re - re * d_im
        slope, place = b - a * t * half, a * half
        n1_re, n1_im, n0_re, n0_im = slope * m_re, slope * m_im, place * m_re, place * m_im
        square = d_re.power(2) + d_im.power(2)
        return n1_re, n1_re.power(2) * n0_re + n1_re * n1_im * n0_im - n0_im.power(2) * square

    def _stable_up_to(self, last: float) -> bool:
        """Whether all modes are proven stable at all periods up to one."""
        edges = np.linspace(0.0, last, PARTS * PARTS + 1)
        count = len(self.centres)
        modes = np.repeat(np.arange(count), len(edges) - 1)
        low, high = np.tile(edges[:-1], count), np.tile(edges[1:], count)
        for _ in range(ROUNDS):
            first, second = self._conditions(Interval.of(low, high), modes)
            if (first.hi <= 0.0).any() or (second.hi <= 0.0).any():
                return False
            open_: Mask = (first.lo <= 0.0) | (second.lo <= 0.0)
            if not open_.any():
                return True
            if open_.sum() * PARTS > MOST:
                return False
            shares = np.linspace(0.0, 1.0, PARTS + 1)
            places = low[open_][:, None] + (high - low)[open_][:, None] * shares
            places[:, -1] = high[open_]
            low, high, modes = places[:, :-1].ravel(), places[:, 1:].ravel(), np.repeat(modes[open_], PARTS)
        return False

    def _unstable_at(self, t: float) -> bool:
        """Whether one of the modes is proven to grow at a period."""
        first, second = self._conditions(Interval.of(t), slice(None))
        return bool((first.hi < 0.0).any() or (second.hi < 0.0).any())
