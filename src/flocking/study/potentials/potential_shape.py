"""Limits, breaks and minima of a potential: found from the formula, checked with many digits."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from flocking.formula.derivatives import derivative
from flocking.formula.identities import MOST_ADDENDS, expanded_addends
from flocking.formula.precise import evaluator, joint_evaluator, wide_context
from flocking.formula.symbolic import with_floats
from flocking.model.checks import Array
from flocking.model.potentials.potential import Potential
from flocking.study.potentials.potential_limits import Limit, limit, limit_at_infinity, limit_at_zero
from flocking.study.potentials.potential_units import DISTANCES, energy_of, lengths_of

if TYPE_CHECKING:
    import sympy
    from mpmath import mpf as Number  # noqa: N812

MOST_ROOT_STEPS = 60
"""Most steps of a root's search from a bracket; no root is found where they do not suffice."""

SAME_ROOT = 1e-14
"""Relative difference of two roots that count as one: they have more digits, their brackets may share an end."""

BRACKET = 1e-12
"""Half width of the bracket about a root on a grid point, relative to it."""

PROBES = (0.1, 0.37, 0.73)
"""Places in a piece at which its slope must be zero for it to count as flat: not symmetric, so that no even function
is."""

BESIDE = 1e-8
"""Relative distance from a break at which the slopes beside it are read: the square root of the rounding."""

TINY = 1e-300
"""Absolute tolerance of a root: so small that the relative one decides."""

ROOT_ERROR = 1e-15
"""Relative tolerance of a minimum, a few units of rounding; SciPy's least is 8.9e-16."""

MOST_STEPS = 5000
"""Steps of the search for a minimum: Brent's method may need the square of the number of bisections."""

NEAREST, FARTHEST = 1e-9, 1e9
"""Range of distances that is searched for breaks and minima."""
SAMPLES = 97
"""Distances from 1e-6 to 1e6, eight a decade, at which the formula must have a real value."""
GRID = 36_001
"""Points of the search, 2000 for each of 18 decades: a feature wider than 0.12 % of its distance is met."""
MOST_BREAKS = 40
"""Breaks that are located at most, a bound on time."""
MOST_MINIMA = 60
"""Minima that are located at most, a bound on time."""
SAME = 1e-10
"""Relative difference below which two one-sided limits count as equal."""


@dataclass(frozen=True)
class Break:
    """A distance where two pieces meet, or where the formula is singular.

    Parameters
    ----------
    at
        The distance.
    left, right
        One-sided limits of value, slope and curvature.
    units
        Sizes of value, slope and curvature, see `Shape`.
    """

    at: float
    left: tuple[Limit, Limit, Limit]
    right: tuple[Limit, Limit, Limit]
    units: tuple[float, float, float] = (1.0, 1.0, 1.0)

    @property
    def order(self) -> int:
        """Highest continuous derivative: -1 for a jump or a singularity, 2 for C2 or smoother."""
        for k, (a, b, unit) in enumerate(zip(self.left, self.right, self.units, strict=True)):
            if a.kind != "finite" or b.kind != "finite" or not same(a.value, b.value, unit):
                return k - 1
        return 2

    def __str__(self) -> str:
        if self.order == 2:
            return f"C2 at r = {self.at:.9g}"
        what = ("value", "slope", "curvature")[self.order + 1]
        a, b = self.left[self.order + 1], self.right[self.order + 1]
        return f"{'discontinuous' if self.order < 0 else f'C{self.order}'} at r = {self.at:.9g} ({what} {a} | {b})"


@dataclass(frozen=True)
class Minimum:
    """A local minimum with its ``value``, or an interval of minima from ``at`` to ``until``."""

    at: float
    value: float
    until: float

    @property
    def flat(self) -> bool:
        """Whether it is an interval."""
        return self.until > self.at


@dataclass(frozen=True)
class Shape:
    """Shape of a potential on all distances r > 0.

    Parameters
    ----------
    zero, infinity
        Limits of the value at 0 and at infinity.
    breaks
        Piece borders and singularities, ascending.
    minima
        Local minima, ascending.
    lows
        Smallest values approached, attained or not: pairs (distance, value).
    undefined
        Distances at which the formula has no real value, in a coarse sample.
    slope
        Slope with many digits.
    place, energy
        Powers of two near a distance at which something happens, and near the values about it: differences are compared
        with them, so that units change nothing.
    """

    zero: Limit
    infinity: Limit
    breaks: tuple[Break, ...]
    minima: tuple[Minimum, ...]
    lows: tuple[tuple[float, float], ...]
    undefined: tuple[float, ...]
    slope: Callable[[Number], Number]
    place: float = 1.0
    energy: float = 1.0

    def singular_point(self) -> float | None:
        """First distance at which the value is infinite from below, or None."""
        return next((b.at for b in self.breaks if b.left[0].kind == "infinite"), None)

    def break_at(self, radius: float) -> Break | None:
        """The break at ``radius``, or None."""
        return next((b for b in self.breaks if same(b.at, radius, 0.0)), None)

    def same_values(self, a: float, b: float) -> bool:
        """Whether two values ``a`` and ``b`` of the potential agree."""
        return same(a, b, self.energy)


def same(a: float, b: float, unit: float = 1.0) -> bool:
    """Whether two numbers ``a`` and ``b`` agree to `SAME`, relative to them and to a ``unit``; 0 of distances."""
    if np.isinf(a) or np.isinf(b):
        return a == b
    return bool(abs(a - b) <= SAME * max(unit, abs(a), abs(b)))


def shape_of(potential: Potential, radius: float | None = None) -> Shape:
    """Find the shape of ``potential``; ``radius`` counts as a break in any case.

    Breaks and minima are searched on [1e-9, 1e9], at most `MOST_BREAKS` and `MOST_MINIMA` of them; where the radius, or
    all that happens, is beyond 1e-6 or 1e6, on this range times its length.
    """
    import sympy

    r = sympy.Symbol("r", positive=True)
    place, length = lengths_of(potential, radius)
    energy = energy_of(potential, place)
    # Rational parameters: the limits are those of the numbers a computer holds, not of their decimals.
    numbers = {k: sympy.Rational(v) for k, v in potential.parameters.items()}
    psi = potential.expression(sympy.Rational(length) * r if length != 1.0 else r, numbers)
    psi = psi / sympy.Rational(energy) if energy != 1.0 else psi
    derivatives = (psi, derivative(psi, r), derivative(psi, r, 2))
    functions, jointly = tuple(evaluator(d, r) for d in derivatives), joint_evaluator(derivatives, r)
    context = wide_context()
    points = _special_points(psi, r, None if radius is None else radius / length)
    tiny = [context.mpf(10) ** (-(2**k)) for k in range(9)]
    breaks, inner = [], (1.0, length / place, (length / place) ** 2)
    for c in points:
        sides = [
            tuple(limit(list(values)) for values in zip(*(jointly(c * (1 + sign * x)) for x in tiny), strict=True))
            for sign in (-1, 1)
        ]
        breaks.append(Break(float(c), sides[0], sides[1], inner))  # type: ignore[arg-type]
    zero, infinity = _times(limit_at_zero(psi, r), energy), _times(limit_at_infinity(psi, r), energy)

    def slopes(x: Array) -> Array:
        return potential.slope(length * x) * (length / energy)

    units = energy, energy / length, energy / length / length
    found = _minima(slopes, functions, list(_pieces(points)), breaks)
    # No negative zeros.
    minima = [Minimum(m.at * length, m.value * energy + 0.0, m.until * length) for m in found]
    sizes = energy, energy / place, energy / place / place
    breaks = [Break(b.at * length, _all_times(b.left, units), _all_times(b.right, units), sizes) for b in breaks]
    lows = [(m.at, m.value) for m in minima]
    lows += [(0.0, zero.value), (np.inf, infinity.value)]
    lows += [(b.at, side[0].value) for b in breaks for side in (b.left, b.right)]
    samples = np.geomspace(*DISTANCES, SAMPLES)
    undefined = tuple(float(x) * length for x in samples if context.isnan(functions[0](float(x))))
    return Shape(
        zero, infinity, tuple(breaks), tuple(minima), tuple(lows), undefined,
        lambda x: functions[1](x / length) * energy / length, place, energy,
    )  # fmt: skip


def _times(limit: Limit, unit: float) -> Limit:
    return Limit(limit.kind, limit.value * unit)


def _all_times(side: tuple[Limit, Limit, Limit], units: tuple[float, float, float]) -> tuple[Limit, Limit, Limit]:
    value, slope, curvature = (_times(one, unit) for one, unit in zip(side, units, strict=True))
    return value, slope, curvature


def _special_points(psi: sympy.Expr, r: sympy.Symbol, radius: float | None) -> list[Number]:
    """Distances where the formula may not be smooth: roots of its conditions, denominators and arguments."""
    import sympy

    context = wide_context()
    gaps: set[sympy.Expr] = {c.lhs - c.rhs for c in psi.atoms(sympy.core.relational.Relational)}
    gaps |= {p.base for p in psi.atoms(sympy.Pow) if not (p.exp.is_integer and p.exp.is_nonnegative)}
    gaps |= {f.args[0] for f in psi.atoms(sympy.log)}
    gaps |= {sympy.cos(f.args[0]) for f in psi.atoms(sympy.tan)}
    found: list[Number] = [] if radius is None else [context.mpf(radius)]
    for gap in sorted((g for g in gaps if r in g.free_symbols), key=sympy.default_sort_key):
        if gap.is_polynomial(r) and expanded_addends(gap) <= MOST_ADDENDS:
            gap = sympy.Poly(gap, r).sqf_part().as_expr()
        value = evaluator(gap, r)
        rough = _sign_change_brackets(sympy.lambdify(r, with_floats(gap, r), "numpy"))
        for a, b in rough[:MOST_BREAKS]:
            root = _root(value, a, b)
            if root is not None and not any(abs(root - c) <= SAME_ROOT * c for c in found):
                found.append(root)
    return sorted(found)[:MOST_BREAKS]


def _sign_change_brackets(function: Callable[[Array], Array]) -> list[tuple[float, float]]:
    grid = np.geomspace(NEAREST, FARTHEST, GRID)
    with np.errstate(all="ignore"):
        signs = np.sign(np.real(function(grid)) + np.zeros_like(grid))
    exact = [(float(x), float(x)) for x in grid[signs == 0][: MOST_BREAKS + 1]]
    if len(exact) > MOST_BREAKS:  # zero all along, by rounding
        exact = []
    crossed = np.flatnonzero(signs[:-1] * signs[1:] < 0)[:MOST_BREAKS]
    return sorted(exact + [(float(grid[k]), float(grid[k + 1])) for k in crossed])


def _root(function: Callable[[Number], Number], a: float, b: float) -> Number | None:
    """A root in [a, b] with many digits."""
    context = wide_context()
    if a == b:
        a, b = a * (1 - BRACKET), b * (1 + BRACKET)
    low, high = context.mpf(a), context.mpf(b)
    try:
        root = context.findroot(function, (low, high), solver="anderson", verify=False, maxsteps=MOST_ROOT_STEPS)
    except (ValueError, ZeroDivisionError, TypeError):
        return None
    return root if low <= root <= high else None


def _pieces(points: list[Number]) -> Iterator[tuple[Number, Number]]:
    context = wide_context()
    ends = [context.mpf(NEAREST), *(p for p in points if NEAREST < p < FARTHEST), context.mpf(FARTHEST)]
    yield from pairwise(ends)


def _minima(
    slopes: Callable[[Array], Array],
    functions: tuple[Callable[[Number], Number], ...],
    pieces: list[tuple[Number, Number]],
    breaks: list[Break],
) -> list[Minimum]:
    """Minima inside the pieces, at their borders, and flat intervals."""
    value, slope, _ = functions
    found: list[Minimum] = []
    flat: list[tuple[float, float]] = []
    for low, high in pieces:
        probes = [low + (high - low) * x for x in PROBES]
        if all(slope(x) == 0 for x in probes):
            flat.append((float(low), float(high)))
        elif len(found) < MOST_MINIMA:
            found += _inside(slopes, value, slope, low, high)[:MOST_MINIMA]
    for b in breaks:
        c = wide_context().mpf(b.at)
        before, after = slope(c * (1 - BESIDE)), slope(c * (1 + BESIDE))
        if b.order >= 0 and before < 0 < after:
            found.append(Minimum(b.at, b.left[0].value, b.at))
    for low, high in flat:
        level = float(value((low + high) / 2))
        left = next((b for b in breaks if same(b.at, low, 0.0)), None)
        right = next((b for b in breaks if same(b.at, high, 0.0)), None)
        if (left is None or _above(left.left, level, -1)) and (right is None or _above(right.right, level, 1)):
            found.append(Minimum(low if left else 0.0, level, high if right else np.inf))
    return sorted(found, key=lambda m: m.at)


def _above(side: tuple[Limit, Limit, Limit], level: float, direction: int) -> bool:
    """Whether the potential is not below ``level`` just outside a flat interval."""
    value, slope, curvature = side
    if value.kind != "finite" or not same(value.value, level):
        return value.value > level
    if slope.kind == "finite" and not same(slope.value, 0.0):
        return slope.value * direction > 0
    return not (curvature.value < 0)


def _inside(
    slopes: Callable[[Array], Array],
    value: Callable[[Number], Number],
    slope: Callable[[Number], Number],
    low: Number,
    high: Number,
) -> list[Minimum]:
    from scipy.optimize import brentq

    def slope_at(x: float) -> float:
        return float(slopes(np.asarray(x)))

    a, b = float(low), float(high)
    near = 10.0 ** -np.arange(1, 13)
    grid = np.concatenate([np.geomspace(NEAREST, FARTHEST, GRID), a * (1 + near), b * (1 - near)])
    grid = np.unique(grid[(grid > a) & (grid < b)])
    found_slopes = slopes(grid)
    known = np.isfinite(found_slopes)
    grid, signs = grid[known], np.sign(found_slopes[known])
    grid, signs = grid[signs != 0], signs[signs != 0]
    found = []
    for k in np.flatnonzero((signs[:-1] < 0) & (signs[1:] > 0)):
        left, right = float(grid[k]), float(grid[k + 1])
        # Many digits distinguish a minimum from the rounding noise of a constant piece.
        if not slope(left) < 0 < slope(right):
            continue
        try:
            at = float(brentq(slope_at, left, right, xtol=TINY, rtol=ROOT_ERROR, maxiter=MOST_STEPS))
        except ValueError:  # the slope has no value at some distance between
            continue
        found.append(Minimum(at, float(value(at)), at))
        if len(found) >= MOST_MINIMA:
            break
    return found
