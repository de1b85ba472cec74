"""Position of a leader from its velocity: in closed form if there is one, else by quadrature."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from flocking.errors import InvalidInput
from flocking.formula.identities import expanded_addends, nothing_or_itself
from flocking.model.checks import Array

if TYPE_CHECKING:
    import sympy

SAME_TIME = 1e-14
"""Width at which a bisection for a time ends, relative to the time, to 1, or to a shorter interval: some fifty units of
rounding."""

MOST_ADDENDS = 64
"""Largest number of addends of a velocity for an integral in closed form; limits the time."""
HIGHEST_POWER = 8
"""Largest exponent in such an addend; limits the number of terms of its integral."""
MOST_PIECES = 256
"""Largest number of pieces of an interval of quadrature; about one per unit of time below it."""

SHORT_PIECES = 32
"""Number of pieces of an interval shorter than `ORDINARY`: the unit of time may be a nanosecond then."""

SAMPLES_OF_A_PIECE = 64
"""Times of a piece at which a condition that is no polynomial is looked at: one that changes twice between two is
missed."""
NEARLY_REAL = 1e-6
"""Imaginary part of a computed root, relative to its size, up to which it may be a real one: an end of a piece that was
not needed costs little."""

LARGEST_DOUBT = 1e-9
"""Largest estimated error of the position on a piece, relative to its displacement, to 1, or to `_way` where less."""
ABSOLUTE, RELATIVE, SUBINTERVALS = 1e-13, 1e-12, 200
"""Tolerances of the quadrature, near rounding, and largest number of subintervals of a piece, which limits the time."""

ORDINARY = 0.01
"""Ways and times from this on are taken to be in usual units: tolerances are absolute errors of ways below 1 there, as
those of positions are. Shorter ones count as they are."""

Complex = tuple["sympy.Expr", "sympy.Expr"]
"""Real and imaginary part."""


def displacement(velocity: sympy.Expr, t: sympy.Symbol, begin: sympy.Expr) -> sympy.Expr | None:
    """Integral from ``begin`` to ``t`` of sums of products of polynomials, exp, sin and cos with linear arguments.

    In contrast to general symbolic integration its time is bounded. Arguments are not expanded: ``exp(-(t - 1000))``
    would become infinity times zero. Symbols other than ``t`` must be declared nonzero if the integral divides by
    them.

    Returns
    -------
    sympy.Expr or None
        The integral, or None if the velocity has another form.
    """
    import sympy

    velocity = velocity.replace(sympy.sinh, lambda x: (sympy.exp(x) - sympy.exp(-x)) / 2)
    velocity = velocity.replace(sympy.cosh, lambda x: (sympy.exp(x) + sympy.exp(-x)) / 2)
    if expanded_addends(velocity) > MOST_ADDENDS:
        return None
    total: sympy.Expr = sympy.Integer(0)
    for addend in sympy.Add.make_args(velocity):
        integral = _of_product(addend, t, begin)
        finer = sympy.Add.make_args(_distributed(addend, t)) if integral is None else ()
        parts = [integral] if integral is not None else [_of_product(x, t, begin) for x in finer]
        for part in parts:
            if part is None:
                return None
            total += part
    return total


def _distributed(product: sympy.Expr, t: sympy.Symbol) -> sympy.Expr:
    """A product of sums as a sum of products; functions, linear factors and constants are not expanded."""
    import sympy

    unexpanded: dict[sympy.Expr, sympy.Dummy] = {}

    def masked(e: sympy.Expr) -> sympy.Expr:
        if e.is_Atom:
            return e
        slope = _slope(e, t) if e.is_Add else None
        if not e.has(t) or isinstance(e, sympy.Function) or (slope is not None and slope.is_nonzero):
            return unexpanded.setdefault(e, sympy.Dummy(real=True))
        return e.func(*(masked(a) for a in e.args))

    expanded = sympy.expand(masked(product))
    back = {dummy: e for e, dummy in unexpanded.items()}
    return sympy.Add(*(a.xreplace(back) for a in sympy.Add.make_args(expanded)))


def _slope(expression: sympy.Expr, t: sympy.Symbol) -> sympy.Expr | None:
    """Slope of an expression linear in ``t``; None for any other."""
    import sympy

    slope = nothing_or_itself(sympy.diff(expression, t))
    return None if slope.has(t) else slope


def _of_product(product: sympy.Expr, t: sympy.Symbol, begin: sympy.Expr) -> sympy.Expr | None:
    import sympy

    if product.is_zero:
        return sympy.Integer(0)
    constant, rest = product.as_independent(t, as_Add=False)
    lines: list[tuple[sympy.Expr, int]] = []
    growth: sympy.Expr = sympy.Integer(0)
    waves: list[tuple[sympy.Expr, sympy.Expr]] = [(sympy.Integer(1), sympy.Integer(0))]
    for factor in sympy.Mul.make_args(rest):
        base, exponent = factor.as_base_exp() if not isinstance(factor, sympy.exp) else (factor, sympy.Integer(1))
        if factor == 1:
            continue
        if not (exponent.is_Integer and 0 < exponent <= HIGHEST_POWER):
            return None
        periodic = isinstance(base, sympy.sin | sympy.cos)
        inner = base.args[0] if periodic or isinstance(base, sympy.exp) else base
        if _slope(inner, t) is None:
            return None
        if inner is base:
            lines.append((base, int(exponent)))
            continue
        if not periodic:
            growth += inner * exponent
            continue
        angle = inner - sympy.pi / 2 if isinstance(base, sympy.sin) else inner
        for _ in range(int(exponent)):
            waves = [(a / 2, c + s * angle) for a, c in waves for s in (1, -1)]
        if len(waves) > MOST_ADDENDS:
            return None
    if sum(power for _, power in lines) > HIGHEST_POWER:
        return None
    total: sympy.Expr = sympy.Integer(0)
    for amplitude, angle in waves:
        part = _of_wave(lines, growth, angle, t, begin)
        if part is None:
            return None
        total += amplitude * part
    return constant * total


def _of_wave(
    lines: list[tuple[sympy.Expr, int]], growth: sympy.Expr, angle: sympy.Expr, t: sympy.Symbol, begin: sympy.Expr
) -> sympy.Expr | None:
    """Integral of a polynomial times exp(growth) cos(angle), by parts in the complex plane."""
    import sympy

    rate, frequency = _slope(growth, t), _slope(angle, t)
    if rate is None or frequency is None:
        return None
    if rate == 0 and frequency == 0:
        part = _of_polynomial(lines, t, begin)
        return None if part is None else sympy.exp(growth) * sympy.cos(angle) * part
    if not (rate.is_nonzero or frequency.is_nonzero):
        return None
    if not lines and (rate == 0 or frequency == 0):
        return _of_exponential(growth, rate, t, begin) if frequency == 0 else _of_sine(angle, frequency, t, begin)
    size = rate**2 + frequency**2
    inverse: Complex = (rate / size, -frequency / size)
    factor = inverse
    real, imaginary = sympy.Integer(0), sympy.Integer(0)
    derivative: sympy.Expr = sympy.Mul(*(base**power for base, power in lines))
    while derivative != 0:
        real += derivative * factor[0]
        imaginary += derivative * factor[1]
        derivative = nothing_or_itself(-sympy.diff(derivative, t))
        factor = (
            factor[0] * inverse[0] - factor[1] * inverse[1],
            factor[0] * inverse[1] + factor[1] * inverse[0],
        )
    antiderivative = sympy.exp(growth) * (real * sympy.cos(angle) - imaginary * sympy.sin(angle))
    return antiderivative - antiderivative.subs(t, begin)


def _of_sine(angle: sympy.Expr, frequency: sympy.Expr, t: sympy.Symbol, begin: sympy.Expr) -> sympy.Expr:
    """Integral of cos(angle), as a product: the difference of two sines would lose all digits at low frequencies."""
    import sympy

    middle = angle.subs(t, (t + begin) / 2)
    return 2 * sympy.sin(frequency * (t - begin) / 2) * sympy.cos(middle) / frequency


def _of_exponential(growth: sympy.Expr, rate: sympy.Expr, t: sympy.Symbol, begin: sympy.Expr) -> sympy.Expr:
    """Integral of exp(growth): as a product for small growth, as a difference where the product would overflow."""
    import sympy

    half = rate * (t - begin) / 2
    little = 2 * sympy.exp(growth.subs(t, (t + begin) / 2)) * sympy.sinh(half) / rate
    much = (sympy.exp(growth) - sympy.exp(growth.subs(t, begin))) / rate
    return sympy.Piecewise((little, half**2 < 1), (much, True))


def _of_polynomial(lines: list[tuple[sympy.Expr, int]], t: sympy.Symbol, begin: sympy.Expr) -> sympy.Expr | None:
    """Integral of a product of powers of linear factors, as a polynomial of one of them, which is not expanded."""
    import sympy

    if not lines:
        return t - begin
    (base, power), *others = sorted(lines, key=lambda line: line[0] == t)
    slope = sympy.diff(base, t)
    if not slope.is_nonzero:
        return None
    x = sympy.Dummy("x", real=True)
    product: sympy.Expr = x**power
    for other, exponent in others:
        ratio = sympy.diff(other, t) / slope
        product *= (ratio * x + other.subs(t, sympy.Integer(0)) - ratio * base.subs(t, sympy.Integer(0))) ** exponent
    found: sympy.Expr = sympy.Integer(0)
    for (degree,), coefficient in sympy.Poly(product, x).terms():
        if degree == 0:
            found += coefficient * (t - begin)
        else:
            found += coefficient * (base ** (degree + 1) - base.subs(t, begin) ** (degree + 1)) / ((degree + 1) * slope)
    return found


def jump_times(velocity: Sequence[sympy.Expr], t: sympy.Symbol, start: float, end: float) -> list[float]:
    """Times at which a condition of ``where`` in a velocity changes, in order.

    Quadrature looks at a velocity at some times only, and does not see a jump between the last of them and the end of
    its piece. Conditions that are polynomials change at their roots, as accurately as these are computed; of other
    conditions changes that are further apart than samples are found.

    Parameters
    ----------
    velocity
        Formulas of ``t`` alone.
    start, end
        What lies between is looked at.
    """
    import sympy
    from scipy.optimize import bisect

    found: set[float] = set()
    conditions = {
        c for v in velocity for p in v.atoms(sympy.Piecewise) for c in p.atoms(sympy.core.relational.Relational)
    }
    for condition in conditions:
        difference = condition.lhs - condition.rhs
        if difference.is_polynomial(t):
            coefficients = [float(c) for c in sympy.Poly(difference, t).all_coeffs()]
            found |= {
                float(root.real) for root in np.roots(coefficients) if abs(root.imag) <= NEARLY_REAL * (1.0 + abs(root))
            }
            continue
        value = sympy.lambdify(t, difference, "math")
        times = np.linspace(start, end, SAMPLES_OF_A_PIECE * _pieces(start, end) + 1)
        values = [_sign(value, float(x)) for x in times]
        for (a, x), (b, y) in pairwise(zip(times.tolist(), values, strict=True)):
            if x * y < 0:
                width = SAME_TIME * max(abs(b), min(1.0, abs(end - start)))
                found.add(float(bisect(lambda s, value=value: _sign(value, s), a, b, xtol=width)))
            elif x == 0:
                found.add(a)
    return sorted(x for x in found if min(start, end) < x < max(start, end))


def _sign(value: Callable[[float], object], t: float) -> float:
    """The sign of a condition's difference; 0 where it has no real value."""
    try:
        found = value(t)
    except (ValueError, ArithmeticError):
        return 0.0
    return float(np.sign(found)) if isinstance(found, int | float) else 0.0


def _pieces(start: float, end: float) -> int:
    """Number of pieces of an interval of quadrature."""
    length = abs(end - start)
    return SHORT_PIECES if length < ORDINARY else int(min(MOST_PIECES, max(1.0, np.ceil(length))))


def _way(along: Callable[[float], float], edges: Array) -> float:
    """Size of what is travelled: 1, or by the speeds in the middle of pieces where that is less than `ORDINARY`."""
    speed = max(abs(along(float(0.5 * (a + b)))) for a, b in pairwise(edges))
    way = speed * abs(float(edges[-1] - edges[0]))
    return way if 0.0 < way < ORDINARY else 1.0


def travelled(velocity: Callable[[float], Array], start: float, end: float, jumps: Sequence[float] = ()) -> Array:
    """Integral of a velocity from ``start`` to ``end``, by adaptive quadrature over pieces of unit length.

    Longer intervals have 256 pieces and very short ones 32, so features much shorter than a piece may be missed.

    Parameters
    ----------
    velocity
        The velocity at a time, shape (m,).
    jumps
        Times at which it may jump, see `jump_times`: pieces end there.

    Raises
    ------
    InvalidInput
        If the estimated error of the quadrature exceeds 1e-9 of the distance travelled.
    """
    from scipy.integrate import quad

    edges = np.linspace(start, end, _pieces(start, end) + 1)
    inside = [x for x in jumps if min(start, end) < x < max(start, end)]
    if inside:
        edges = np.unique(np.concatenate([edges, inside]))
        edges = edges if start <= end else edges[::-1]
    total = np.zeros(len(velocity(start)))
    for axis in range(len(total)):

        def along(s: float, axis: int = axis) -> float:
            return float(velocity(s)[axis])

        size = _way(along, edges)
        for a, b in pairwise(edges):
            piece, doubt, *_ = quad(
                along, float(a), float(b), epsabs=ABSOLUTE * size, epsrel=RELATIVE, limit=SUBINTERVALS, full_output=1
            )
            # A leader without a real velocity is nowhere: its position is no number either.
            if doubt > LARGEST_DOUBT * max(size, abs(piece)):
                raise InvalidInput(
                    "Path", "velocity", "must be smooth enough for the position to be found to 9 digits",
                    f"coordinate {axis} is known to {doubt:.1g} for t in [{a:g}, {b:g}]",
                    "Give a velocity that stays finite, or one with a closed antiderivative.",
                )  # fmt: skip
            total[axis] += piece
    return total
