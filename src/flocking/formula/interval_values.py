"""Values of a formula on intervals of its variable."""

from __future__ import annotations

from fractions import Fraction
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from flocking.arrays import Mask
from flocking.errors import FormulaError
from flocking.formula.intervals import Interval
from flocking.formula.visitor import ExpressionVisitor

if TYPE_CHECKING:
    import sympy

DIGITS = 40
"""Digits of irrational numbers in a formula before they are rounded outwards."""

MOST_NUMBERS = 4096
"""Numbers whose enclosures are stored: a formula is evaluated many times, and the store is bounded."""

COMPARISONS = {"StrictLessThan": ("<", False), "LessThan": ("<", False),
               "StrictGreaterThan": (">", True), "GreaterThan": (">", True)}  # fmt: skip
"""Relations by the names of their classes in SymPy, with whether the sides are exchanged."""


class IntervalValues(ExpressionVisitor[Interval]):
    """Enclosures of an expression of one symbol.

    Parameters
    ----------
    symbol
        The variable.
    values
        Its intervals.
    """

    def __init__(self, symbol: sympy.Symbol, values: Interval) -> None:
        self.variable, self.values = symbol, values

    def symbol(self, node: sympy.Symbol) -> Interval:
        """The intervals of the variable."""
        if node != self.variable:
            raise self.refusal(str(node), node)
        return self.values

    def number(self, node: sympy.Expr) -> Interval:
        """A number: itself where it has a double, else the two around it."""
        return _number(node)

    def sum(self, node: sympy.Add) -> Interval:
        """The sum of the terms."""
        found = self.visit(node.args[0])
        for term in node.args[1:]:
            found = found + self.visit(term)
        return found

    def product(self, node: sympy.Mul) -> Interval:
        """The product of the factors."""
        found = self.visit(node.args[0])
        for factor in node.args[1:]:
            found = found * self.visit(factor)
        return found

    def power(self, node: sympy.Pow) -> Interval:
        """Powers: integer ones and square roots as such, the others by the logarithm."""
        base, exponent = node.args
        if exponent.is_Integer:
            return self.visit(base).power(int(exponent))
        if exponent.is_Rational and exponent.q == 2:
            return self.visit(base).sqrt().power(int(exponent.p))
        return (self.visit(base).log() * self.visit(exponent)).exp()

    def piecewise(self, node: sympy.Piecewise) -> Interval:
        """The pieces whose conditions may hold."""
        found: Interval | None = None
        undecided = np.ones(np.shape(self.values.lo), dtype=bool)
        for value, condition in node.args:
            holds, fails = self._truth(condition)
            piece = self.visit(value)
            possible = undecided & ~fails
            piece = Interval(np.where(possible, piece.lo, np.inf), np.where(possible, piece.hi, -np.inf))
            found = piece if found is None else found.hull(piece)
            undecided = undecided & ~holds
        assert found is not None
        # Where no piece has a value, nothing is known.
        return Interval(np.where(undecided, -np.inf, found.lo), np.where(undecided, np.inf, found.hi))

    def _truth(self, condition: sympy.Basic) -> tuple[Mask, Mask]:
        """Where a condition holds for all numbers of an interval, and where for none."""
        import sympy

        shape = np.shape(self.values.lo)
        if condition in (sympy.true, sympy.false):
            return np.full(shape, condition == sympy.true), np.full(shape, condition == sympy.false)
        name = type(condition).__name__
        if name in COMPARISONS:
            left, right = (self.visit(side) for side in condition.args)
            less, more = (right, left) if COMPARISONS[name][1] else (left, right)
            closed = name in ("LessThan", "GreaterThan")
            holds = less.hi <= more.lo if closed else less.hi < more.lo
            fails = less.lo > more.hi if closed else less.lo >= more.hi
            return np.broadcast_to(holds, shape), np.broadcast_to(fails, shape)
        parts = [self._truth(part) for part in condition.args]
        if isinstance(condition, sympy.And):
            return np.all([h for h, _ in parts], axis=0), np.any([f for _, f in parts], axis=0)
        if isinstance(condition, sympy.Or):
            return np.any([h for h, _ in parts], axis=0), np.all([f for _, f in parts], axis=0)
        if isinstance(condition, sympy.Not):
            return parts[0][1], parts[0][0]
        if isinstance(condition, sympy.ITE):
            (test, not_test), *ways = parts
            # Where the test is undecided both ways may agree.
            holds, fails = ((test & yes) | (not_test & no) | (yes & no) for yes, no in zip(*ways, strict=True))
            return holds, fails
        raise self.refusal(name, condition)

    def function(self, node: sympy.Basic) -> Interval:
        """The elementary functions."""
        name = type(node).__name__
        if name in ("exp", "log", "sin", "cos", "tan", "atan", "sinh", "cosh", "tanh"):
            found: Interval = getattr(self.visit(node.args[0]), name)()
            return found
        if name == "Abs":
            return self.visit(node.args[0]).absolute()
        if name == "sign":
            inner = self.visit(node.args[0])
            return Interval(np.sign(inner.lo), np.sign(inner.hi))
        if name in ("Max", "Min"):
            parts = [self.visit(x) for x in node.args]
            join = np.maximum if name == "Max" else np.minimum
            lo, hi = parts[0].lo, parts[0].hi
            for part in parts[1:]:
                lo, hi = join(lo, part.lo), join(hi, part.hi)
            return Interval(lo, hi)
        raise self.refusal(name, node)

    def refusal(self, name: str, node: sympy.Basic) -> FormulaError:
        """The error for an expression without an enclosure."""
        return FormulaError("intervals", name, "has no enclosure", str(node))


@lru_cache(maxsize=MOST_NUMBERS)
def _number(node: sympy.Expr) -> Interval:
    """The number of a node, enclosed; formulas are evaluated many times."""
    if node.is_Rational:
        exact = Fraction(int(node.p), int(node.q))
        near = float(exact)
        if Fraction(near) == exact:
            return Interval.of(near)
    elif node.is_infinite:
        return Interval.of(-np.inf if node.is_negative else np.inf)
    else:
        near = float(node.evalf(DIGITS))
    return Interval.of(np.nextafter(near, -np.inf), np.nextafter(near, np.inf))


def enclosed(expression: sympy.Expr, symbol: sympy.Symbol, values: Interval) -> Interval:
    """Enclosures of an expression on intervals of its symbol.

    Parameters
    ----------
    expression
        The expression; all its numbers are known.
    symbol
        Its variable.
    values
        Intervals of the variable.

    Raises
    ------
    FormulaError
        When the expression holds a function or a symbol that is not known.
    """
    with np.errstate(all="ignore"):
        found = IntervalValues(symbol, values).visit(expression)
    shape = np.shape(values.lo)
    return Interval(np.broadcast_to(found.lo, shape), np.broadcast_to(found.hi, shape))
