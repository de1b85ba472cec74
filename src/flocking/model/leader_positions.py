"""Where a leader is, from its velocity: in closed form where a table has one, else by quadrature."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import Array

if TYPE_CHECKING:
    import sympy

MOST_ADDENDS = 64
HIGHEST_POWER = 8
MOST_PIECES = 256

Complex = tuple["sympy.Expr", "sympy.Expr"]
"""Real and imaginary part."""


def antiderivative(velocity: sympy.Expr, t: sympy.Symbol) -> sympy.Expr | None:
    """An integral over ``t`` of sums of products of powers of t, exp, sin and cos with linear arguments.

    A general search for closed forms has no bound on its time; this one has. Symbols other than ``t`` must be
    declared nonzero where the integral divides by them.

    Returns
    -------
    sympy.Expr or None
        The integral, or None where the velocity has another form.
    """
    import sympy

    velocity = velocity.replace(sympy.sinh, lambda x: (sympy.exp(x) - sympy.exp(-x)) / 2)
    velocity = velocity.replace(sympy.cosh, lambda x: (sympy.exp(x) + sympy.exp(-x)) / 2)
    if _addends(velocity) > MOST_ADDENDS:
        return None
    total: sympy.Expr = sympy.Integer(0)
    for addend in sympy.Add.make_args(sympy.expand(velocity, power_exp=False)):
        part = _of_product(addend, t)
        if part is None:
            return None
        total += part
    return total


def _addends(expression: sympy.Expr) -> float:
    """Bound on the number of addends after expansion."""
    import sympy

    if isinstance(expression, sympy.Add):
        return sum(_addends(a) for a in expression.args)
    if isinstance(expression, sympy.Mul):
        count = 1.0
        for factor in expression.args:
            count *= _addends(factor)
        return count
    if isinstance(expression, sympy.Pow) and expression.exp.is_Integer and expression.exp > 0:
        base = _addends(expression.base)
        return base ** int(expression.exp) if base > 1 else 1.0
    return max([1.0, *(_addends(a) for a in expression.args)])


def _of_product(product: sympy.Expr, t: sympy.Symbol) -> sympy.Expr | None:
    import sympy

    if product.is_zero:
        return sympy.Integer(0)
    constant, rest = product.as_independent(t, as_Add=False)
    power, rate = 0, sympy.Integer(0)
    waves: list[tuple[sympy.Expr, sympy.Expr, sympy.Expr]] = [(sympy.Integer(1), sympy.Integer(0), sympy.Integer(0))]
    for factor in sympy.Mul.make_args(rest):
        base, exponent = factor.as_base_exp() if not isinstance(factor, sympy.exp) else (factor, sympy.Integer(1))
        if factor == 1:
            continue
        if not (exponent.is_Integer and 0 < exponent <= HIGHEST_POWER):
            return None
        if base == t:
            power += int(exponent)
            continue
        line = _line(base.args[0], t) if isinstance(base, sympy.exp | sympy.sin | sympy.cos) else None
        if line is None:
            return None
        slope, offset = line
        if isinstance(base, sympy.exp):
            rate += slope * exponent
            constant *= sympy.exp(offset * exponent)
            continue
        if isinstance(base, sympy.sin):
            offset -= sympy.pi / 2
        for _ in range(int(exponent)):
            waves = [(a / 2, w + s * slope, c + s * offset) for a, w, c in waves for s in (1, -1)]
        if len(waves) > MOST_ADDENDS:
            return None
    if power > HIGHEST_POWER:
        return None
    total: sympy.Expr = sympy.Integer(0)
    for amplitude, frequency, phase in waves:
        part = _of_wave(power, sympy.expand(rate), sympy.expand(frequency), phase, t)
        if part is None:
            return None
        total += amplitude * part
    return constant * total


def _line(expression: sympy.Expr, t: sympy.Symbol) -> tuple[sympy.Expr, sympy.Expr] | None:
    """Slope and offset of an expression linear in ``t``."""
    import sympy

    slope = sympy.diff(expression, t)
    return None if slope.has(t) else (slope, sympy.expand(expression - slope * t))


def _of_wave(
    power: int, rate: sympy.Expr, frequency: sympy.Expr, phase: sympy.Expr, t: sympy.Symbol
) -> sympy.Expr | None:
    """Integral of t^power exp(rate t) cos(frequency t + phase), by parts in the complex plane."""
    import sympy

    if rate == 0 and frequency == 0:
        return sympy.cos(phase) * t ** (power + 1) / (power + 1)
    if not (rate.is_nonzero or frequency.is_nonzero):
        return None
    size = rate**2 + frequency**2
    inverse: Complex = (rate / size, -frequency / size)
    factor = inverse
    real, imaginary = sympy.Integer(0), sympy.Integer(0)
    weight = sympy.Integer(1)
    for k in range(power + 1):
        real += weight * t ** (power - k) * factor[0]
        imaginary += weight * t ** (power - k) * factor[1]
        weight *= -(power - k)
        factor = (
            factor[0] * inverse[0] - factor[1] * inverse[1],
            factor[0] * inverse[1] + factor[1] * inverse[0],
        )
    angle = frequency * t + phase
    return sympy.exp(rate * t) * (real * sympy.cos(angle) - imaginary * sympy.sin(angle))


def travelled(velocity: Callable[[float], Array], start: float, end: float) -> Array:
    """Integral of a velocity from ``start`` to ``end``, by adaptive quadrature over pieces of unit length.

    Of longer spans there are 256 pieces: what happens within a small part of one may be missed.

    Raises
    ------
    InvalidInput
        When the quadrature's own estimate of its error exceeds 1e-9 of the distance travelled.
    """
    from scipy.integrate import quad

    pieces = int(min(MOST_PIECES, max(1.0, np.ceil(abs(end - start)))))
    edges = np.linspace(start, end, pieces + 1)
    total = np.zeros(len(velocity(start)))
    for axis in range(len(total)):

        def along(s: float, axis: int = axis) -> float:
            return float(velocity(s)[axis])

        for a, b in pairwise(edges):
            piece, doubt, *_ = quad(along, float(a), float(b), epsabs=1e-13, epsrel=1e-12, limit=200, full_output=1)
            if doubt > 1e-9 * max(1.0, abs(piece)):
                raise InvalidInput(
                    "Path", "velocity", "must be tame enough for the position to be found to 9 digits",
                    f"coordinate {axis} is known to {doubt:.1g} for t in [{a:g}, {b:g}]",
                    "Give a velocity that stays finite, or one with a closed antiderivative.",
                )  # fmt: skip
            total[axis] += piece
    return total
