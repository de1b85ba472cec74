"""Recognises expressions that are zero, without rewriting those that are not."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import sympy

SAMPLES = 3
"""Random points at which an identity is tried: formulas that differ agree at one by chance only."""
LEAST_PART, MOST_PART, PARTS = 100, 999, 500
"""Values of symbols are fractions from 1/5 to 2 with a denominator of 500: no overflow, and seldom a special value."""

DIGITS = 40
"""Digits of the values that are compared."""
ROUNDING = 1e-25
"""Relative difference that counts as rounding: 15 of the 40 digits may be lost by cancellation."""
MOST_ADDENDS = 1000
"""Addends after expansion up to which algebra is used, a bound on its time."""


def nothing_or_itself(expression: sympy.Expr) -> sympy.Expr:
    """0 if an expression is proven to be zero, else the expression, term by term as it was stated.

    Algebra may turn a formula into another one that is equal over the reals and overflows in double precision:
    ``exp(-(t - 5)**2/w**2)`` expanded is a product of three exponentials, one of which is infinite at t = 18. Algebra
    is therefore used to find zeros, and its other results are dropped.
    """
    import sympy

    return sympy.Integer(0) if is_zero(expression) else expression


def is_zero(expression: sympy.Expr) -> bool:
    """Whether an expression is proven to be zero; a long one is not, nor one with pieces, whose merging takes minutes.

    Most expressions that are not zero are recognised by their values at a few points, before any algebra.
    """
    import sympy

    if expression.is_number or expression.has(sympy.Piecewise):
        return bool(expression == 0)
    draw = random.Random(0)
    names = sorted(expression.free_symbols, key=str)
    addends = sympy.Add.make_args(expression)
    for _ in range(SAMPLES):
        point = {name: sympy.Rational(draw.randint(LEAST_PART, MOST_PART), PARTS) for name in names}
        values = [a.xreplace(point).evalf(DIGITS) for a in addends]
        total, scale = sum(values), sum(abs(v) for v in values)
        if total.is_comparable and scale.is_comparable and abs(total) > ROUNDING * scale:
            return False
    if expanded_addends(expression) > MOST_ADDENDS:
        return False
    return bool(sympy.expand(expression) == 0 or sympy.simplify(expression) == 0)


def expanded_addends(expression: sympy.Expr) -> float:
    """Bound on the number of addends of an expression after expansion, or of one of its arguments."""
    import sympy

    if isinstance(expression, sympy.Add):
        return sum(expanded_addends(a) for a in expression.args)
    if isinstance(expression, sympy.Mul):
        count = 1.0
        for factor in expression.args:
            count *= expanded_addends(factor)
        return count
    if isinstance(expression, sympy.Pow) and expression.exp.is_Integer and expression.exp > 0:
        base = expanded_addends(expression.base)
        return base ** int(expression.exp) if base > 1 else 1.0
    return max([1.0, *(expanded_addends(a) for a in expression.args)])
