"""Held control with samples that are d periods late: the period up to which consensus is stable, of all modes.

With z = exp(2 i f) on the unit circle, 0 < f <= pi/2, and the forces of a period T, every mode has a number l(f) with

    (a T^2/2) cos f + i b T sin f = 2 sin(f)^2 exp(i f)/l(f)

where it neither grows nor decays: b T = 2 sin(f) P and a T^2/2 cos f = 2 sin(f)^2 R for exp(i f)/l = R + i P, so that
(a/b^2) cos(f) P^2 = R. Of first order a is 0 and b the gain.

**All states late, the own one too.** l = mu exp(-2 i d f) for an eigenvalue mu of the Laplacian. With g = (2 d + 1) f
the equation is cos g/(cos f sin(g)^2) = a/(mu b^2), whose left side falls from infinity to zero while g goes to pi/2:
there is one root, and T = 2 sin f sin g/(mu b). A root with a larger g has a larger f and a larger sin g, so a longer
T, as has z = -1. With p = mu b T and q = mu a T^2/2 the loop z^-d (p (z - 1) + q (z + 1))/(z - 1)^2 falls in modulus
on the unit circle while f grows, so that it has the modulus 1 once, and its phase shows that a mode is stable below
that T and not above, up to p = 2. From there on it is at least 1 everywhere, and the polynomial of degree d + 2 has as
many roots inside as p (z - 1) + q (z + 1), one at most (Rouche).

**Neighbours late, the own state known.** Where all agents have k neighbours, l = k - (k - mu) exp(-2 i d f), mu = 0
included: how all move together depends on the delay too, but for their places, z = 1, which is a single root at every
period, of mu = 0 alone. For short periods all other roots lie inside. Crossings need not be one, so the period is
enclosed: cells that cover all of 0 < f <= pi/2 are proven to hold no crossing of a period below the lower end, and at
the upper end a mode is proven to grow; periods above it are not covered. Near zero, for g <= pi/2: P > 0 asks
k - mu < k/2, and R |l|^2 >= k cos(f)/2, |l| >= k/2, P |l|^2 <= k (2 d + 2) f, so that there is no crossing for
f < sqrt(k b^2/(8 a))/(2 d + 2).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flocking.arrays import Array, Mask
from flocking.formula.intervals import Interval
from flocking.study.certificates.enclosed_matrices import EnclosedMatrix, spectral_radius

BELOW = 1.0 - 1e-9
"""Factor by which the least angle is lowered, for the rounding of its formula."""

ABOVE = 1.0 + 1e-15
"""Factor by which the largest angle is raised above pi/2, whose rounded value lies 6e-17 below it."""

HALVINGS = 80
"""Bisections of an angle, more than double precision resolves."""

WIDTHS = (1e-14, 1e-13, 1e-12, 1e-11, 1e-10, 1e-9, 1e-8, 1e-7, 1e-6)
"""Relative distances from a computed angle at which the sign of its equation is looked at."""

SHORTENED = (1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2)
"""Shares by which a computed period is shortened until it is proven, and lengthened until the contrary is."""

PLACES, CELLS = 2048, 128
"""Angles at which crossings are looked for, and cells with which a proof begins."""

PARTS, NARROWED, MARGIN = 64, 7, 0.1
"""Parts of a range that holds a crossing, how often it is narrowed (64^7 is 2^42), and by what share of a period a
range may begin beyond the best crossing so far and yet be looked at."""

ROUNDS, MOST = 60, 100_000
"""Halvings of the cells of a proof, and cells that are looked at in one round."""

ROUNDED = 1e-13
"""Relative error of coefficients that are computed in some ten operations."""

ONE, TWO, HALF_PI = Interval.of(1.0), Interval.of(2.0), 0.5 * np.pi


def period_of_all_late(modes: Interval, place: Interval, rate: Interval, samples: int) -> Interval | None:
    """The period below which all modes are stable with all states late, and above which one is not.

    Parameters
    ----------
    modes
        Eigenvalues of the Laplacian but the zero, shape (K,).
    place, rate
        The coefficients a and b of x'' = -mu (a x + b x'), positive.
    samples
        The delay in periods, 1 or more.

    Returns
    -------
    Interval or None
        The period; None where no enclosure was found.
    """
    odd = float(2 * samples + 1)
    share = place / (modes * rate.power(2))

    def side(angle: Array) -> Interval:
        f, g = Interval.of(angle), Interval.of(angle) * Interval.of(odd)
        return g.cos() - share * f.cos() * g.sin().power(2)

    low, high = np.zeros_like(modes.lo), np.full_like(modes.lo, HALF_PI / odd)
    with np.errstate(all="ignore"):
        middle = 0.5 * (share.lo + share.hi)
        for _ in range(HALVINGS):
            angle = 0.5 * (low + high)
            above = np.cos(odd * angle) > middle * np.cos(angle) * np.sin(odd * angle) ** 2
            low, high = np.where(above, angle, low), np.where(above, high, angle)
    before, after = np.full_like(low, np.nan), np.full_like(low, np.nan)
    # Beyond a right angle of g the equation is another one.
    last = np.nextafter(HALF_PI, 0.0) / odd
    for width in WIDTHS[::-1]:
        below, above_ = low * (1.0 - width), np.minimum(low * (1.0 + width), last)
        before = np.where(side(below).lo > 0.0, below, before)
        after = np.where(side(above_).hi < 0.0, above_, after)
    if not (np.isfinite(before).all() and np.isfinite(after).all()):
        return None
    f = Interval.of(before, after)
    found = f.sin() * (f * Interval.of(odd)).sin() * TWO / (modes * rate)
    return Interval.of(float(found.lo.min()), float(found.hi.min()))


@dataclass(frozen=True)
class _Cells:
    """What the crossings of one kind of mode ask, on cells of angles.

    Parameters
    ----------
    balance
        Zero at a crossing.
    pull, size
        A crossing has the period 2 sin(f) times ``pull``/(b ``size``); ``size`` may be zero or negative.
    """

    balance: Interval
    pull: Interval
    size: Interval


@dataclass(frozen=True, eq=False)
class NeighboursLate:
    """Modes of agents that have all the same number of neighbours, whose states are known late.

    Parameters
    ----------
    neighbours
        Number of neighbours k.
    modes
        Eigenvalues of the Laplacian but the zero, ascending, shape (K,).
    two_sided
        Whether the agents fall into two parts without links inside: then one eigenvalue is exactly 2 k.
    place, rate
        The coefficients a and b of x'' = -mu (a x + b x'); of first order zero and the gain.
    samples
        The delay d in periods, 1 or more.
    """

    neighbours: int
    modes: Interval
    two_sided: bool
    place: Interval
    rate: Interval
    samples: int

    def period(self) -> Interval | None:
        """A period below which all modes are stable, and one at which one grows; None where they were not proven."""
        near, mode = self._computed()
        if not np.isfinite(near):
            return None
        below = next((t for s in SHORTENED if self._stable_up_to(t := near * (1.0 - s))), None)
        if below is None:
            return None
        above = next((t for s in SHORTENED if self._grows_at(t := near * (1.0 + s), mode)), None)
        return None if above is None else Interval.of(below, above)

    @property
    def _couplings(self) -> list[Interval | int]:
        """The numbers k - mu of all modes, merged where they are not distinguished; 1 and -1 for exactly k and -k."""
        k = Interval.of(float(self.neighbours))
        found: list[Interval | int] = [1]
        modes = self.modes
        if self.two_sided:
            found.append(-1)
            modes = Interval(modes.lo[:-1], modes.hi[:-1])
        parts: list[list[float]] = []
        for lo, hi in zip(modes.lo.tolist(), modes.hi.tolist(), strict=True):
            if parts and lo <= parts[-1][1]:
                parts[-1][1] = max(parts[-1][1], hi)
            else:
                parts.append([lo, hi])
        return [*found, *(k - Interval.of(lo, hi) for lo, hi in parts)]

    def _cells(self, coupling: Interval | int, f: Interval) -> _Cells:
        d, k = self.samples, Interval.of(float(self.neighbours))
        share = self.place / self.rate.power(2)

        def times(number: int) -> Interval:
            return f * Interval.of(float(number))

        if isinstance(coupling, int):
            # Both sides are divided by what vanishes together with l.
            late, more = (times(d).sin(), -times(d + 1).cos()) if coupling > 0 else (times(d).cos(), times(d + 1).sin())
            rest = _over_cosine(f, d, sine=coupling > 0)
            return _Cells(share * more.power(2) - k * TWO * rest, more, k * TWO * late)
        pull = k * f.sin() - coupling * times(2 * d + 1).sin()
        size = k.power(2) + coupling.power(2) - k * coupling * TWO * times(2 * d).cos()
        balance = share * pull.power(2) - (k - coupling * _odd_over_cosine(f, d)) * size
        return _Cells(balance, pull, size)

    def _computed(self) -> tuple[float, Interval | int]:
        """About the shortest period of a crossing, and its mode."""
        found = [self._least_alternating()]
        places = np.linspace(0.0, HALF_PI, PLACES + 1)[1:]
        near: list[tuple[float, float, float, Interval | int]] = []
        for coupling in self._couplings:
            balance, periods = self._at(coupling, places)
            for k in np.flatnonzero((balance[1:] > 0.0) != (balance[:-1] > 0.0)).tolist():
                if max(periods[k], periods[k + 1]) > 0.0:
                    first = float(np.abs(periods[k : k + 2]).min())
                    near.append((first, float(places[k]), float(places[k + 1]), coupling))
        for first, low, high, coupling in sorted(near, key=lambda x: x[0]):
            if first > found[0][0] * (1.0 + MARGIN):
                break
            for _ in range(NARROWED):
                parts = np.linspace(low, high, PARTS + 1)
                positive = self._at(coupling, parts)[0] > 0.0
                k = int(np.argmax(positive[1:] != positive[:-1]))
                low, high = float(parts[k]), float(parts[k + 1])
            period = float(self._at(coupling, np.array([low]))[1][0])
            if period > 0.0:
                found = [min(found[0], (period, coupling), key=lambda x: x[0])]
        return found[0]

    def _at(self, coupling: Interval | int, angle: Array) -> tuple[Array, Array]:
        """The balance of a mode, and the period that a crossing would have, at angles; computed, not enclosed."""
        at = coupling if isinstance(coupling, int) else Interval.of(0.5 * (coupling.lo + coupling.hi))
        cells = self._cells(at, Interval.of(angle))
        with np.errstate(all="ignore"):
            periods = 2.0 * np.sin(angle) * cells.pull.lo / (float(self.rate.lo) * cells.size.lo)
        return cells.balance.lo + cells.balance.hi, np.nan_to_num(periods, nan=np.inf)

    def _least_alternating(self) -> tuple[float, Interval | int]:
        """The shortest period at which a mode has z = -1, and that mode: 2/(b l) with l = k - (-1)^d (k - mu)."""
        k, sign = float(self.neighbours), -1.0 if self.samples % 2 else 1.0
        found: tuple[float, Interval | int] = (np.inf, 1)
        for coupling in self._couplings:
            size = k - sign * (k * coupling if isinstance(coupling, int) else float(coupling.hi + coupling.lo) / 2.0)
            period = 2.0 / (float(self.rate.hi) * size) if size > 0.0 else np.inf
            found = min(found, (period, coupling), key=lambda x: x[0])
        return found

    def _stable_up_to(self, period: float) -> bool:
        """Whether no mode is at its limit at any period up to one."""
        # z = -1 is looked at by itself: there the balance has been divided by zero.
        if not period < self._least_alternating()[0] * (1.0 - ROUNDED):
            return False
        a, b, d = float(self.place.hi), float(self.rate.lo), self.samples
        first = HALF_PI / (2 * d + 1)
        if a > 0.0:
            first = min(first, float(np.sqrt(self.neighbours / (8.0 * a))) * b / (2 * d + 2))
        first *= BELOW
        edges = np.geomspace(first, HALF_PI * ABOVE, CELLS + 1)
        edges = np.union1d(edges, np.linspace(first, edges[-1], CELLS + 1))
        return all(self._no_crossing(coupling, edges, period) for coupling in self._couplings)

    def _no_crossing(self, coupling: Interval | int, edges: Array, period: float) -> bool:
        low, high = edges[:-1], edges[1:]
        for _ in range(ROUNDS):
            f = Interval.of(low, high)
            cells = self._cells(coupling, f)
            # At a crossing 2 sin(f) pull = T b size for a T in (0, period].
            pulled = f.sin() * TWO * cells.pull
            within = Interval.of(0.0, period) * self.rate * cells.size
            apart: Mask = (pulled.lo > within.hi) | (pulled.hi < within.lo)
            settled = apart | (cells.balance.lo > 0.0) | (cells.balance.hi < 0.0)
            if settled.all():
                return True
            low, high = low[~settled], high[~settled]
            if 2 * len(low) > MOST:
                return False
            middle = 0.5 * (low + high)
            low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
        return False

    def _grows_at(self, period: float, coupling: Interval | int) -> bool:
        """Whether a mode is proven to grow at a period."""
        k, d, t = Interval.of(float(self.neighbours)), self.samples, Interval.of(period)
        alpha = k * Interval.of(float(coupling)) if isinstance(coupling, int) else coupling
        p = self.rate * t
        if float(self.place.hi) == 0.0:
            # z^(d + 1) + (k p - 1) z^d - alpha p
            parts = [(d, k * p - ONE), (0, -(alpha * p))]
            size = d + 1
        else:
            q = self.place * t.power(2) * Interval.of(0.5)
            # z^(d + 2) + (k (p + q) - 2) z^(d + 1) + (1 + k (q - p)) z^d - alpha (p + q) z - alpha (q - p)
            parts = [
                (d + 1, k * (p + q) - TWO),
                (d, ONE + k * (q - p)),
                (1, -(alpha * (p + q))),
                (0, -(alpha * (q - p))),
            ]
            size = d + 2
        values, error = np.eye(size, k=-1), np.zeros((size, size))
        for power, x in parts:
            lo, hi = float(x.lo), float(x.hi)
            values[0, size - 1 - power] -= 0.5 * (lo + hi)
            error[0, size - 1 - power] += 0.5 * (hi - lo) + ROUNDED * max(abs(lo), abs(hi))
        return spectral_radius(EnclosedMatrix(values, error))[0] > 1.0


def _odd_over_cosine(f: Interval, d: int) -> Interval:
    """cos((2 d + 1) f)/cos(f), written as a sum so that nothing is divided by zero."""
    total = ONE
    for k in range(1, d + 1):
        term = (f * Interval.of(2.0 * k)).cos() * TWO
        total = total - term if k % 2 else total + term
    return -total if d % 2 else total


def _even_over_cosine(f: Interval, m: int) -> Interval:
    """sin(2 m f)/cos(f), written as a sum."""
    total = Interval.of(np.zeros_like(f.lo))
    for k in range(1, m + 1):
        term = (f * Interval.of(2.0 * k - 1.0)).sin() * TWO
        total = total + term if (m - k) % 2 == 0 else total - term
    return total


def _over_cosine(f: Interval, d: int, *, sine: bool) -> Interval:
    """sin((d + 1) f) sin(d f)/cos(f), or with cosines; one of the factors vanishes with cos(f)."""
    if sine:
        even, odd = (d, d + 1) if d % 2 == 0 else (d + 1, d)
        return _even_over_cosine(f, even // 2) * (f * Interval.of(float(odd))).sin()
    even, odd = (d, d + 1) if d % 2 == 0 else (d + 1, d)
    return _odd_over_cosine(f, odd // 2) * (f * Interval.of(float(even))).cos()
