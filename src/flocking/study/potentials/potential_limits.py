"""Limits of a potential: by values ever nearer to a point, and of formulas that oscillate by bounds of all values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from flocking.errors import FormulaError
from flocking.formula.interval_values import enclosed
from flocking.formula.intervals import Interval
from flocking.formula.precise import evaluator, wide_context

if TYPE_CHECKING:
    import sympy
    from mpmath import mpf as Number  # noqa: N812

SHRINKING = 0.75
"""Differences each at most this share of the one before it belong to a finite limit, by extrapolation."""
CONVERGED = 1e-6
"""A last difference below this share of the value gives a finite limit: the differences that follow are smaller."""
ZERO = 1e-60
"""Smaller limits are zero: at the nearest point, 10^-256, the fourth root of the distance is 10^-64."""
GROWING = 0.9
"""Differences of values at 10^-1, 10^-2, 10^-4, ... from a point show that there is no finite limit if none is below
this share of the one before: those of a logarithm double, of a negative power grow, of a positive power vanish."""

SAMPLED, BOUNDED = 14, 9
"""Numbers of distances 10, 10^2, 10^4, ... at which a formula is computed, and beyond which it is bounded: the last are
10^8192, with exponents of any size, and 10^256, the largest of them that is a double."""

AGREE = 1e-9
"""Relative difference of the limits of lower and upper bounds that count as one."""


@dataclass(frozen=True)
class Limit:
    """Where values tend to.

    Parameters
    ----------
    kind
        ``"finite"``, ``"infinite"`` (the sign is that of ``value``), ``"none"``, or of a formula that oscillates
        ``"bounded"``, where its values stay below a bound, and ``"unknown"``.
    value
        The limit; NaN where there is none, or none is known.
    """

    kind: str
    value: float = np.nan

    @property
    def rises(self) -> bool | None:
        """Whether it is plus infinity; None where that is not known."""
        return None if self.kind == "unknown" else self.kind == "infinite" and self.value > 0

    def __str__(self) -> str:
        if self.kind in ("bounded", "unknown"):
            return "no known limit"
        if self.kind == "none":
            return "no limit"
        return f"{self.value:.6g}" if self.kind == "finite" else "+infinity" if self.value > 0 else "-infinity"


def limit(values: Sequence[Number]) -> Limit:
    """Limit of values at 10^-1, 10^-2, 10^-4, ... from a point: by how their differences grow or shrink.

    Parameters
    ----------
    values
        The values, with many digits.
    """
    context = wide_context()
    tail = values[-5:]
    if any(context.isnan(v) for v in tail):
        return Limit("none")
    if context.isinf(tail[-1]):
        return Limit("infinite", float(tail[-1])) if tail[-1] == tail[-2] else Limit("none")
    if any(context.isinf(v) for v in tail):
        return Limit("none")
    d = [b - a for a, b in pairwise(tail)]
    growing = all(abs(b) >= GROWING * abs(a) for a, b in pairwise(d))
    if all(x > 0 for x in d) and growing:
        return Limit("infinite", np.inf)
    if all(x < 0 for x in d) and growing:
        return Limit("infinite", -np.inf)
    if abs(tail[-1]) <= ZERO:
        return Limit("finite", 0.0)
    if abs(d[-1]) <= CONVERGED * abs(tail[-1]):
        return Limit("finite", float(tail[-1]))
    if all(abs(b) <= SHRINKING * abs(a) for a, b in pairwise(d)):
        ratio = d[-1] / d[-2]
        end = tail[-1] + d[-1] * ratio / (1 - ratio)
        return Limit("finite", float(end) if abs(end) > ZERO else 0.0)
    return Limit("none")


def limit_at_zero(psi: sympy.Expr, r: sympy.Symbol) -> Limit:
    """Limit of a formula as its variable tends to zero.

    Parameters
    ----------
    psi, r
        The formula, of which all numbers are known, and its variable.
    """
    places = 10.0 ** -(2.0 ** np.arange(BOUNDED))
    return _at_end(psi, r, -1, Interval.of(np.zeros(BOUNDED), places))


def limit_at_infinity(psi: sympy.Expr, r: sympy.Symbol) -> Limit:
    """Limit of a formula as its variable tends to infinity.

    Parameters
    ----------
    psi, r
        As for `limit_at_zero`.
    """
    places = 10.0 ** (2.0 ** np.arange(BOUNDED))
    return _at_end(psi, r, 1, Interval.of(places, np.full(BOUNDED, np.inf)))


def _at_end(psi: sympy.Expr, r: sympy.Symbol, sign: int, beyond: Interval) -> Limit:
    import sympy

    sampled = _sampled(psi, r, sign)
    waves = psi.atoms(sympy.sin, sympy.cos, sympy.tan)
    # A wave of what has a limit does not oscillate there: values show where it tends to.
    if all(_sampled(wave.args[0], r, sign).kind == "finite" for wave in waves):
        return sampled
    return _bounded(psi, r, beyond)


def _sampled(psi: sympy.Expr, r: sympy.Symbol, sign: int) -> Limit:
    """Limit by values at 10, 10^2, 10^4, ... or their inverses: no digits cancel there, exponents alone reach far."""
    value, ten = evaluator(psi, r), wide_context().mpf(10)
    return limit([value(ten ** (sign * 2**k)) for k in range(SAMPLED)])


def _bounded(psi: sympy.Expr, r: sympy.Symbol, beyond: Interval) -> Limit:
    """Limit by bounds of all values in ever smaller ranges at an end."""
    context = wide_context()
    try:
        found = enclosed(psi, r, beyond)
    except FormulaError:
        return Limit("unknown")
    low, high = (limit([context.mpf(float(x)) for x in bounds]) for bounds in (found.lo, found.hi))
    if low.rises:
        return low
    if high.kind == "infinite" and high.value < 0:
        return high
    size = max(abs(low.value), abs(high.value))
    if low.kind == high.kind == "finite" and abs(low.value - high.value) <= AGREE * size:
        return Limit("finite", 0.5 * (low.value + high.value))
    return Limit("bounded") if high.kind == "finite" else Limit("unknown")
