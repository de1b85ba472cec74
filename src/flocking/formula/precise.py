"""SymPy expressions evaluated with many digits and unbounded exponents, for limits beyond double precision."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
from typing import TYPE_CHECKING

from flocking.formula.visitor import ExpressionVisitor

if TYPE_CHECKING:
    import sympy
    from mpmath import mpf as Number  # noqa: N812
    from mpmath.ctx_mp import MPContext

DIGITS = 600
"""Digits of all numbers: differences of values near 1 may go down to 1e-300, the smallest numbers of double precision,
and keep as many digits again."""

LARGE = 60
"""Bits of an argument beyond which exponentials count as 0 or infinite, and other functions have no value.

exp(2^60) has more than 10^17 digits.
"""

LARGEST_POWER = 4096
"""Largest integer exponent for repeated multiplication, exact for negative bases; beyond it, exp and log."""

LONGEST_NUMBER = 20_000
"""Bits of an argument beyond which a periodic function is not evaluated: its value would need all of them."""


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

    The time is bounded: arguments too large for a function give an infinity or NaN instead. ``known`` holds the values
    of the other symbols.
    """
    context = wide_context()
    given = {name: context.mpf(value) for name, value in (known or {}).items()}
    return lambda value: _Evaluation({**given, symbol: context.mpf(value)}).visit(expression)


def joint_evaluator(expressions: Sequence[sympy.Expr], symbol: sympy.Symbol) -> Callable[[Number], tuple[Number, ...]]:
    """Function of ``symbol`` that evaluates several expressions: what they have in common is computed once."""

    def values(at: Number) -> tuple[Number, ...]:
        point = _Evaluation({symbol: wide_context().mpf(at)})
        return tuple(map(point.visit, expressions))

    return values


def _large(x: Number, bits: int) -> bool:
    context = wide_context()
    return bool(context.isinf(x)) or (x != 0 and int(context.mag(x)) > bits)


def _logarithm(x: Number) -> Number:
    context = wide_context()
    return context.log(x) if x > 0 else -context.inf if x == 0 else context.nan


def _periodic(name: str, x: Number) -> Number:
    context = wide_context()
    return context.nan if _large(x, LONGEST_NUMBER) else getattr(context, name)(x)


def _growth(x: Number) -> Number:
    context = wide_context()
    if context.isnan(x) or not _large(x, LARGE):
        return context.exp(x)
    return context.inf if x > 0 else context.mpf(0)


def _power(base: Number, exponent: Number) -> Number:
    context = wide_context()
    if context.isnan(base) or context.isnan(exponent):
        return context.nan
    if base == 0:
        return context.inf if exponent < 0 else context.mpf(1) if exponent == 0 else context.mpf(0)
    if context.isint(exponent) and abs(exponent) <= LARGEST_POWER and not context.isinf(base):
        return base ** int(exponent)
    return _growth(exponent * context.log(base)) if base > 0 else context.nan


def _bend(name: str, x: Number) -> Number:
    context = wide_context()
    if name in {"sinh", "cosh"}:
        up, down = _growth(x), _growth(-x)
        return (up - down if name == "sinh" else up + down) / 2
    if _large(x, LARGE):
        return (context.pi / 2 if name == "atan" else context.mpf(1)) * (1 if x > 0 else -1)
    return getattr(context, name)(x)


def _other(function: sympy.Basic, inside: list[Number]) -> Number:
    import sympy

    context = wide_context()
    if any(_large(x, LARGE) for x in inside):
        return context.nan
    value = function(*(sympy.Float(x, DIGITS) for x in inside)).evalf(DIGITS)
    return context.mpf(value._to_mpmath(context.prec)) if value.is_Float or value.is_Rational else context.nan


_FUNCTIONS: dict[str, Callable[..., Number]] = {
    "Max": max, "Min": min, "Abs": abs, "sign": lambda x: wide_context().sign(x), "exp": _growth, "log": _logarithm,
    **{name: partial(_periodic, name) for name in ("sin", "cos", "tan")},
    **{name: partial(_bend, name) for name in ("atan", "tanh", "sinh", "cosh")},
}  # fmt: skip
"""Functions of arguments that are not NaN; SymPy evaluates the others."""


class _Evaluation(ExpressionVisitor["Number"]):
    """Values of expressions at one point, each computed once; ``known`` are those of the symbols."""

    def __init__(self, known: dict[sympy.Basic, Number]) -> None:
        self._found = known
        self._context = wide_context()

    def visit(self, node: sympy.Basic) -> Number:
        """Value of an expression."""
        if node not in self._found:
            self._found[node] = super().visit(node)
        return self._found[node]

    def number(self, node: sympy.Expr) -> Number:
        """Value of a number."""
        if node.is_Rational:
            return self._context.mpf(int(node.p)) / int(node.q)
        return self._context.mpf(node._to_mpmath(self._context.prec))

    def sum(self, node: sympy.Add) -> Number:
        """Value of a sum."""
        return sum((self.visit(a) for a in node.args), self._context.mpf(0))

    def product(self, node: sympy.Mul) -> Number:
        """Value of a product."""
        return math.prod((self.visit(a) for a in node.args), start=self._context.mpf(1))

    def power(self, node: sympy.Pow) -> Number:
        """Value of a power."""
        return _power(self.visit(node.base), self.visit(node.exp))

    def piecewise(self, node: sympy.Piecewise) -> Number:
        """Value of the first piece whose condition holds; NaN where none does."""
        return next((self.visit(v) for v, condition in node.args if self._holds(condition)), self._context.nan)

    def _holds(self, condition: sympy.Basic) -> bool:
        import sympy

        if condition in (sympy.true, sympy.false):
            return bool(condition)
        if isinstance(condition, sympy.Rel):
            a, b = self.visit(condition.lhs), self.visit(condition.rhs)
            order = {"<": a < b, "<=": a <= b, ">": a > b, ">=": a >= b, "==": a == b, "!=": a != b}
            return bool(order[condition.rel_op])
        if isinstance(condition, sympy.Not):
            return not self._holds(condition.args[0])
        if isinstance(condition, sympy.ITE):
            test, yes, no = condition.args
            return self._holds(yes) if self._holds(test) else self._holds(no)
        return (all if isinstance(condition, sympy.And) else any)(self._holds(a) for a in condition.args)

    def function(self, node: sympy.Basic) -> Number:
        """Value of a function; NaN where an argument is NaN."""
        if not node.args:
            raise self.refusal(type(node).__name__, node)
        arguments = [self.visit(a) for a in node.args]
        if any(self._context.isnan(x) for x in arguments):
            return self._context.nan
        known = _FUNCTIONS.get(type(node).__name__)
        return _other(node.func, arguments) if known is None else known(*arguments)

    def refusal(self, name: str, node: sympy.Basic) -> Exception:
        """The error for what has no value."""
        return TypeError(f"{name} {node} has no value")
