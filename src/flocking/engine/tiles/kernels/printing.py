"""Printing of formulas for vectorised loops: code without branches in one precision, uniform parts computed first."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from flocking.errors import UnsupportedLaw
from flocking.formula.visitor import ExpressionVisitor

if TYPE_CHECKING:
    import sympy

_SIGNS = {"StrictLessThan": "<", "LessThan": "<=", "StrictGreaterThan": ">", "GreaterThan": ">="}
_SELECT = {"<": "select_below", "<=": "select_most", ">": "select_above", ">=": "select_least"}
_SELECT_SIGN = {name: sign for sign, name in _SELECT.items()}
VECTOR_FUNCTIONS = {"sin": "fast_sin", "cos": "fast_cos", "exp": "fast_exp", "log": "fast_log"}
"""Functions with a vectorised implementation; the others call the mathematics library for each lane."""
_LIBRARY = {"tan", "atan", "sinh", "cosh", "tanh"}


class Lifter:
    """Replaces the largest subexpressions that have one value for all agents by names.

    Parameters
    ----------
    uniform
        Returns whether a symbol, by name, has one value for all agents.
    prefix
        Start of the new names.
    """

    def __init__(self, uniform: Callable[[str], bool], prefix: str = "same") -> None:
        self._uniform = uniform
        self._prefix = prefix
        self._names: dict[sympy.Basic, sympy.Symbol] = {}

    @property
    def definitions(self) -> dict[str, sympy.Expr]:
        """The replaced subexpressions by name."""
        return {symbol.name: value for value, symbol in self._names.items()}

    def _is_uniform(self, expression: sympy.Basic) -> bool:
        return all(self._uniform(s.name) for s in expression.free_symbols)

    def _named(self, expression: sympy.Basic) -> sympy.Basic:
        import sympy

        if expression.is_number:
            return expression
        if expression not in self._names:
            self._names[expression] = sympy.Symbol(f"{self._prefix}{len(self._names)}", real=True)
        return self._names[expression]

    def lift(self, expression: sympy.Basic) -> sympy.Basic:
        """``expression`` with its uniform parts replaced."""
        import sympy

        if expression.is_Atom and not expression.is_Symbol:
            return expression
        if self._is_uniform(expression) and not expression.is_Boolean:
            return self._named(expression)
        if isinstance(expression, sympy.Add | sympy.Mul):
            same = [a for a in expression.args if self._is_uniform(a)]
            others = [self.lift(a) for a in expression.args if not self._is_uniform(a)]
            if not same:
                return expression.func(*others)
            return expression.func(self._named(expression.func(*same)), *others)
        if isinstance(expression, sympy.Pow) and expression.exp.is_number:
            return sympy.Pow(self.lift(expression.base), expression.exp)
        if isinstance(expression, sympy.Piecewise):
            return sympy.Piecewise(*((self.lift(v), self._condition(c)) for v, c in expression.args))
        return expression.func(*(self.lift(a) for a in expression.args)) if expression.args else expression

    def _condition(self, condition: sympy.Basic) -> sympy.Basic:
        if condition.is_Atom:
            return condition
        return condition.func(*(self._condition(a) if a.is_Boolean else self.lift(a) for a in condition.args))


def without_branches(expression: sympy.Basic) -> sympy.Basic:
    """Replace every Piecewise by nested two-way selections, so that common subexpressions are found across branches.

    Parameters
    ----------
    expression
        A SymPy expression.
    """
    import sympy

    if expression.is_Atom:
        return expression
    if isinstance(expression, sympy.Piecewise):
        *front, (result, _) = [(without_branches(v), c) for v, c in expression.args]
        for value, condition in reversed(front):
            result = _selected(condition, value, result)
        return result
    if isinstance(expression, sympy.Abs):
        inside = without_branches(expression.args[0])
        return _selected(sympy.Lt(inside, 0, evaluate=False), -inside, inside)
    if isinstance(expression, sympy.sign):
        inside = without_branches(expression.args[0])
        one = sympy.Integer(1)
        above = _selected(sympy.Gt(inside, 0, evaluate=False), one, sympy.Integer(0))
        return _selected(sympy.Lt(inside, 0, evaluate=False), -one, above)
    if isinstance(expression, sympy.Max | sympy.Min):
        first, *rest = [without_branches(a) for a in expression.args]
        compare = sympy.Gt if isinstance(expression, sympy.Max) else sympy.Lt
        for other in rest:
            first = _selected(compare(first, other, evaluate=False), first, other)
        return first
    return expression.func(*(without_branches(a) for a in expression.args))


def _selected(condition: sympy.Basic, yes: sympy.Basic, no: sympy.Basic) -> sympy.Basic:
    import sympy

    if condition == sympy.true:
        return yes
    if condition == sympy.false:
        return no
    if isinstance(condition, sympy.And):
        for part in condition.args:
            yes = _selected(part, yes, no)
        return yes
    if isinstance(condition, sympy.Or):
        for part in condition.args:
            no = _selected(part, yes, no)
        return no
    if isinstance(condition, sympy.ITE):
        which, first, second = condition.args
        return _selected(which, _selected(first, yes, no), _selected(second, yes, no))
    if isinstance(condition, sympy.Not):
        return _selected(condition.args[0], no, yes)
    if isinstance(condition, sympy.Ne):
        yes, no = no, yes
    if isinstance(condition, sympy.Eq | sympy.Ne):
        lhs, rhs = condition.lhs, condition.rhs
        return _selected(sympy.And(sympy.Le(lhs, rhs, evaluate=False), sympy.Ge(lhs, rhs, evaluate=False)), yes, no)
    sign = _SIGNS.get(type(condition).__name__)
    if sign is None:
        raise UnsupportedLaw(
            f"The tiled engine has no form of the condition {condition}. "
            "Use engine='exact', or compare with <, <=, > or >=."
        )
    return sympy.Function(_SELECT[sign])(without_branches(condition.lhs), without_branches(condition.rhs), yes, no)


class _Printer(ExpressionVisitor[str]):
    """Prints expressions of scalar names; numbers become constants of the kernel's precision ``T``.

    Assignments that an expression needs are appended to ``lines``.
    """

    folds_numbers = True

    def __init__(self, prefix: str, inverses: Mapping[str, str]) -> None:
        self.lines: list[str] = []
        self._prefix = prefix
        self._inverses = dict(inverses)
        self._under_root: dict[str, sympy.Basic] = {}

    def assign(self, name: str, value: sympy.Basic) -> None:
        """Append the assignment of an expression to a name."""
        import sympy

        text = self.visit(value)
        self.lines.append(f"{name} = {text}")
        if isinstance(value, sympy.Pow) and value.exp == sympy.Rational(1, 2):
            self._under_root[name] = value.base

    def _inverse(self, base: sympy.Expr, exponent: sympy.Expr) -> list[str] | None:
        """Factors of ``base`` to the power ``-exponent`` if an inverse of it is already computed."""
        import sympy

        half = exponent - sympy.floor(exponent)
        if base.is_Symbol and half == 0:
            if base.name in self._under_root and base.name not in self._inverses:
                under = self._temporary(self.visit(self._under_root[base.name]))
                self._inverses[base.name] = self._temporary(f"inverse_root({under})")
            if base.name in self._inverses:
                return self._repeated(self._inverses[base.name], int(exponent))
        if half == sympy.Rational(1, 2):
            root = self._temporary(f"inverse_root({self._temporary(self.visit(base))})")
            return self._repeated(root, int(2 * exponent))
        return None

    def _temporary(self, text: str) -> str:
        if text.isidentifier():
            return text
        name = f"{self._prefix}s{len(self.lines)}"
        self.lines.append(f"{name} = {text}")
        return name

    def symbol(self, node: sympy.Symbol) -> str:
        """Text of a name."""
        return str(node.name)

    def number(self, node: sympy.Expr) -> str:
        """Text of a number."""
        return f"T({float(node)!r})"

    def sum(self, node: sympy.Add) -> str:
        """Text of a sum."""
        text = ""
        for term in node.args:
            negative = term.could_extract_minus_sign()
            text += (" - " if negative else " + ") + self._factor(-term if negative else term)
        return text[3:] if text.startswith(" + ") else "-" + text[3:]

    def power(self, node: sympy.Pow) -> str:
        """Text of a power."""
        return self._power(node.base, node.exp)

    def function(self, node: sympy.Basic) -> str:
        """Text of a function, or of a selection made by `without_branches`."""
        name = type(node).__name__
        if name in _SELECT_SIGN:
            left, right, yes, no = (self._temporary(self.visit(a)) for a in node.args)
            return f"select({left} {_SELECT_SIGN[name]} {right}, {yes}, {no})"
        arguments = ", ".join(self.visit(a) for a in node.args)
        if name in VECTOR_FUNCTIONS:
            return f"{VECTOR_FUNCTIONS[name]}({arguments})"
        if name in _LIBRARY:
            return f"each_lane(math.{name}, {arguments})"
        raise self.refusal(name, node)

    def refusal(self, name: str, node: sympy.Basic) -> Exception:
        """The error for a function that kernels cannot compute."""
        return UnsupportedLaw(f"The tiled engine has no form of the function {name}. Use engine='exact'.")

    def _factor(self, e: sympy.Basic) -> str:
        import sympy

        text = self.visit(e)
        return f"({text})" if isinstance(e, sympy.Add) or text.startswith("-") else text

    def product(self, node: sympy.Mul) -> str:
        """Text of a product; negative powers become divisions, or powers of an inverse that is already computed."""
        import sympy

        if node.could_extract_minus_sign():
            inner = self.visit(-node)
            return f"-({inner})"
        above: list[str] = []
        below: list[sympy.Basic] = []
        for a in node.args:
            if isinstance(a, sympy.Pow) and a.exp.is_number and a.exp.is_negative:
                factors = self._inverse(a.base, -a.exp)
                if factors is None:
                    below.append(sympy.Pow(a.base, -a.exp))
                else:
                    above += factors
            else:
                above.append(self._factor(a))
        top = " * ".join(above) or "T(1.0)"
        if not below:
            return top
        return f"{top} / ({' * '.join(self._factor(b) for b in below)})"

    def _power(self, base: sympy.Expr, exponent: sympy.Expr) -> str:
        import sympy

        if not exponent.is_number:
            return f"fast_power({self.visit(base)}, {self.visit(exponent)})"
        if exponent.is_negative:
            factors = self._inverse(base, -exponent)
            if factors is not None:
                return "(" + " * ".join(factors) + ")" if len(factors) > 1 else factors[0]
            return f"T(1.0) / ({self._power(base, -exponent)})" if exponent != -1 else f"T(1.0) / {self._factor(base)}"
        text = self._temporary(self.visit(base))
        integer_part, half = int(sympy.floor(exponent)), exponent - sympy.floor(exponent)
        factors = self._repeated(text, integer_part)
        if half == sympy.Rational(1, 2):
            factors.append(f"root({text})")
        elif half != 0:
            return f"fast_exp(T({float(exponent)!r}) * fast_log({text}))"
        return "(" + " * ".join(factors) + ")" if len(factors) > 1 else factors[0]

    def _repeated(self, text: str, times: int) -> list[str]:
        if times <= 3:
            return [text] * times
        half = self._temporary(f"({' * '.join(self._repeated(text, times // 2))})")
        return [half, half] + ([text] if times % 2 else [])


def vector_statements(
    results: Mapping[str, sympy.Basic], prefix: str, inverses: Mapping[str, str] | None = None
) -> list[str]:
    """Assignments that compute all ``results``, with common subexpressions computed once and without branches.

    Parameters
    ----------
    results
        Expressions by the names to assign them to.
    prefix
        Start of the names of common parts.
    inverses
        Names of the reciprocals of symbols, by the symbol's name.
    """
    import sympy

    flat = {name: without_branches(value) for name, value in results.items()}
    shared, reduced = sympy.cse(list(flat.values()), symbols=sympy.numbered_symbols(prefix))
    printer = _Printer(prefix, inverses or {})
    for symbol, value in shared:
        printer.assign(symbol.name, value)
    for name, value in zip(flat, reduced, strict=True):
        printer.assign(name, value)
    return printer.lines
