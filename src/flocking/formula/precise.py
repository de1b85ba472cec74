"""SymPy expressions evaluated with many digits and unbounded exponents: for limits that floats cannot reach."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import sympy
    from mpmath import mpf as Number  # noqa: N812
    from mpmath.ctx_mp import MPContext

DIGITS = 600
LARGEST_POWER = 4096
"""Whole exponents up to it are powers by repeated multiplication, exact for negative bases; beyond, exp and log."""

LONGEST_NUMBER = 20_000
"""Bits of an argument beyond which a function is not evaluated: its value would need all of them."""


@cache
def wide_context() -> MPContext:
    """The ``mpmath`` context whose numbers have `DIGITS` digits, NaN where there is no real value."""
    import mpmath

    context = mpmath.mp.clone()
    context.dps = DIGITS
    return context


def evaluator(
    expression: sympy.Expr, symbol: sympy.Symbol, known: Mapping[sympy.Symbol, Number] | None = None
) -> Callable[[Number], Number]:
    """Function of ``symbol`` that evaluates ``expression`` with `DIGITS` digits.

    No value takes long: arguments too large for a function give an infinity or NaN instead.

    Parameters
    ----------
    expression
        What is evaluated.
    symbol
        Its variable.
    known
        Values of its other symbols.
    """
    import sympy

    context = wide_context()
    nan, inf, zero = context.nan, context.inf, context.mpf(0)
    given = {name: context.mpf(value) for name, value in (known or {}).items()}

    def large(x: Number, bits: int) -> bool:
        return bool(context.isinf(x)) or (x != 0 and int(context.mag(x)) > bits)

    def growth(x: Number) -> Number:
        if context.isnan(x) or not large(x, 60):
            return context.exp(x)
        return inf if x > 0 else zero

    def wave(name: str, x: Number) -> Number:
        return nan if large(x, LONGEST_NUMBER) else getattr(context, name)(x)

    def power(base: Number, exponent: Number) -> Number:
        if context.isnan(base) or context.isnan(exponent):
            return nan
        if base == 0:
            return inf if exponent < 0 else context.mpf(1) if exponent == 0 else zero
        if context.isint(exponent) and abs(exponent) <= LARGEST_POWER and not context.isinf(base):
            return base ** int(exponent)
        return growth(exponent * context.log(base)) if base > 0 else nan

    def bend(name: str, x: Number) -> Number:
        if name in {"sinh", "cosh"}:
            up, down = growth(x), growth(-x)
            return (up - down if name == "sinh" else up + down) / 2
        if large(x, 60):
            return (context.pi / 2 if name == "atan" else context.mpf(1)) * (1 if x > 0 else -1)
        return getattr(context, name)(x)

    def other(function: sympy.Basic, inside: list[Number]) -> Number:
        if any(large(x, 60) for x in inside):
            return nan
        value = function(*(sympy.Float(x, DIGITS) for x in inside)).evalf(DIGITS)
        return context.mpf(value._to_mpmath(context.prec)) if value.is_Float or value.is_Rational else nan

    def at(value: Number) -> Number:
        found: dict[sympy.Basic, Number] = {**given, symbol: context.mpf(value)}

        def holds(condition: sympy.Basic) -> bool:
            if condition in (sympy.true, sympy.false):
                return bool(condition)
            if isinstance(condition, sympy.Rel):
                a, b = compute(condition.lhs), compute(condition.rhs)
                order = {"<": a < b, "<=": a <= b, ">": a > b, ">=": a >= b, "==": a == b, "!=": a != b}
                return bool(order[condition.rel_op])
            if isinstance(condition, sympy.Not):
                return not holds(condition.args[0])
            if isinstance(condition, sympy.ITE):
                test, yes, no = condition.args
                return holds(yes) if holds(test) else holds(no)
            return (all if isinstance(condition, sympy.And) else any)(holds(a) for a in condition.args)

        def compute(node: sympy.Basic) -> Number:
            if node not in found:
                found[node] = fresh(node)
            return found[node]

        def fresh(node: sympy.Basic) -> Number:
            if node.is_Rational:
                return context.mpf(int(node.p)) / int(node.q)
            if node.is_number and not node.args:
                return context.mpf(node._to_mpmath(context.prec))
            if node.is_Add:
                return sum((compute(a) for a in node.args), zero)
            if node.is_Mul:
                result = context.mpf(1)
                for factor in node.args:
                    result *= compute(factor)
                return result
            if node.is_Pow:
                return power(compute(node.base), compute(node.exp))
            if isinstance(node, sympy.Piecewise):
                return next((compute(v) for v, condition in node.args if holds(condition)), nan)
            name = node.func.__name__
            inside = [compute(a) for a in node.args]
            if any(context.isnan(x) for x in inside):
                return nan
            if name in {"Max", "Min"}:
                return (max if name == "Max" else min)(inside)
            first = inside[0]
            if name == "exp":
                return growth(first)
            if name == "log":
                return context.log(first) if first > 0 else -inf if first == 0 else nan
            if name in {"sin", "cos", "tan"}:
                return wave(name, first)
            if name in {"atan", "tanh", "sinh", "cosh"}:
                return bend(name, first)
            if name in {"Abs", "sign"}:
                return abs(first) if name == "Abs" else context.sign(first)
            return other(node.func, inside)

        return compute(expression)

    return at
