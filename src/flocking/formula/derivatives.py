"""Derivatives of expressions, in a time that their sizes bound.

SymPy's own rules are used, but not its ``diff``: that asks at every step whether the result is zero, and the answer for
sums within products within sums takes a time that grows exponentially with their depth. By its product rule the
derivatives of a product of n factors have sizes of n**2 and n**3; here a long product is one of groups of factors.
"""

from __future__ import annotations

from functools import reduce
from itertools import combinations
from operator import mul
from typing import TYPE_CHECKING

from flocking.errors import InvalidInput
from flocking.formula.grammar import FUNCTIONS
from flocking.formula.growth import GROUP
from flocking.formula.identities import expanded_addends

if TYPE_CHECKING:
    import sympy

SMALL = 160
"""Nodes of a slope up to which the second derivative is in SymPy's form: terms with factors in common are joined."""
FEW_ADDENDS = 10_000
"""Addends of such a slope when expanded: SymPy looks for the roots of polynomials in it."""


def derivative(expression: sympy.Expr, x: sympy.Symbol, times: int = 1) -> sympy.Expr:
    """Derivative of an expression, as SymPy writes it where it is short.

    A product of more than `GROUP` factors that depend on ``x`` is differentiated as a product of groups, each of them a
    product again: its derivative has a size that grows as the number n of factors times its logarithm, and the second
    one as n log(n)**2.

    Parameters
    ----------
    expression
        An expression of ``x`` and other symbols.
    x
        The variable.
    times
        1 or 2.

    Raises
    ------
    InvalidInput
        When it is asked for another one.
    """
    import sympy

    if times not in (1, 2):
        raise InvalidInput("derivative", "times", "must be 1 or 2", times)
    rules = _Rules(x)
    first = rules.first(expression)
    if times == 1:
        return first
    small = sum(1 for _, _ in zip(sympy.preorder_traversal(first), range(SMALL + 1), strict=False)) <= SMALL
    small = small and expanded_addends(first) <= FEW_ADDENDS and not _has_named_powers(expression, x)
    return sympy.diff(expression, x, 2) if small else rules.second(expression)


def _has_named_powers(expression: sympy.Expr, x: sympy.Symbol) -> bool:
    """Whether a part that depends on ``x`` has a power that is no number: SymPy divides such powers by the part."""
    import sympy

    return any(x in power.base.free_symbols and not power.exp.is_number for power in expression.atoms(sympy.Pow))


class _Rules:
    """First and second derivatives by ``x``; those of parts that occur several times are made once."""

    def __init__(self, x: sympy.Symbol) -> None:
        self._x = x
        self._found: dict[tuple[int, sympy.Expr], sympy.Expr] = {}

    def first(self, e: sympy.Expr) -> sympy.Expr:
        """The derivative."""
        return self._derivative(1, e)

    def second(self, e: sympy.Expr) -> sympy.Expr:
        """The second derivative."""
        return self._derivative(2, e)

    def _derivative(self, times: int, e: sympy.Expr) -> sympy.Expr:
        import sympy

        if self._x not in e.free_symbols:
            return sympy.Integer(0)
        if e == self._x:
            return sympy.Integer(2 - times)
        if (times, e) not in self._found:
            self._found[times, e] = self._ruled(times, e)
        return self._found[times, e]

    def _ruled(self, times: int, e: sympy.Expr) -> sympy.Expr:
        import sympy

        if isinstance(e, sympy.Add):
            return sympy.Add(*(self._derivative(times, part) for part in e.args))
        if isinstance(e, sympy.Piecewise):
            return e.func(*((self._derivative(times, value), condition) for value, condition in e.args))
        if isinstance(e, sympy.Mul):
            return self._of_product(times, e)
        return self._of_power(times, e) if isinstance(e, sympy.Pow) else self._of_function(times, e)

    def _of_product(self, times: int, e: sympy.Mul) -> sympy.Expr:
        import sympy

        varying = [part for part in e.args if self._x in part.free_symbols]
        if len(varying) <= GROUP:
            jets = [(part, self.first(part), self.second(part) if times == 2 else None) for part in e.args]
            return self._joined(jets)[times]
        jets = [(part, self.first(part), self.second(part) if times == 2 else None) for part in varying]
        while len(jets) > GROUP:
            jets = [self._joined(jets[k : k + GROUP]) for k in range(0, len(jets), GROUP)]
        constant = sympy.Mul(*(part for part in e.args if self._x not in part.free_symbols))
        return constant * self._joined(jets)[times]

    @staticmethod
    def _joined(jets: list[_Jet]) -> _Jet:
        """The product of a few factors."""
        import sympy

        values = [jet[0] for jet in jets]

        def with_parts(parts: dict[int, sympy.Expr]) -> sympy.Expr:
            return reduce(mul, (parts.get(k, value) for k, value in enumerate(values)), sympy.Integer(1))

        first = sympy.Add(*(with_parts({k: jet[1]}) for k, jet in enumerate(jets) if jet[1] != 0))
        if any(jet[2] is None for jet in jets):
            return with_parts({}), first, None
        twice = [with_parts({k: jet[2]}) for k, jet in enumerate(jets) if jet[2] != 0]
        pairs = combinations([k for k, jet in enumerate(jets) if jet[1] != 0], 2)
        mixed = [2 * with_parts({j: jets[j][1], k: jets[k][1]}) for j, k in pairs]
        return with_parts({}), first, sympy.Add(*twice, *mixed)

    def _of_power(self, times: int, e: sympy.Pow) -> sympy.Expr:
        import sympy

        base, exponent = e.args
        once = [self.first(part) for part in e.args]
        if times == 1 and once[1] == 0 and not exponent.is_number:
            # Not the power over its base, which has no value where the base is zero.
            return once[0] * exponent * base ** (exponent - 1)
        rate = once[0] * exponent / base
        if once[1] != 0:
            rate = once[1] * sympy.log(base) + rate
        if times == 1:
            return e * rate
        if once[1] == 0:
            slope = exponent * base ** (exponent - 1)
            return slope * self.second(base) + exponent * (exponent - 1) * base ** (exponent - 2) * once[0] ** 2
        # The rate is that of exponent * log(base).
        twice = self.second(exponent) * sympy.log(base) + 2 * once[1] * once[0] / base
        twice += exponent * (self.second(base) / base - once[0] ** 2 / base**2)
        return e * rate**2 + e * twice

    def _of_function(self, times: int, e: sympy.Expr) -> sympy.Expr:
        import sympy

        if type(e).__name__ not in FUNCTIONS:
            return sympy.diff(e, self._x, times)  # a part that is Python may use any of SymPy's functions
        (inner,) = e.args
        slope, once = e.fdiff(1), self.first(inner)
        if times == 1:
            return slope * once
        name = sympy.Dummy()
        curvature = sympy.diff(e.func(name), name, 2).xreplace({name: inner})
        return slope * self.second(inner) + curvature * once**2


_Jet = tuple["sympy.Expr", "sympy.Expr", "sympy.Expr | None"]
"""An expression, its derivative and, where it is asked for, its second one."""
