"""Conversion between text formulas and SymPy expressions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from flocking.errors import FormulaError
from flocking.formula.grammar import CONSTANTS, FUNCTIONS, LARGEST_NUMBER, Formula, Node
from flocking.formula.visitor import ExpressionVisitor

if TYPE_CHECKING:
    import sympy


MOST_BITS = 4096
"""Numbers beyond two to this power are not raised to powers: double precision ends at 1024."""
LARGEST_INTEGER = 2**53
"""Integers up to here are exact in double precision."""
FLOAT_DIGITS = 17
"""Decimal digits of a float that is one of double precision when rounded."""


def to_sympy(formula: Formula, values: Mapping[str, sympy.Expr]) -> sympy.Expr:
    """SymPy form of ``formula`` with each name replaced by its entry in ``values``.

    Raises
    ------
    FormulaError
        When the formula has a name that ``values`` lacks, or contains a number that is not real and finite.
    """
    import sympy

    missing = formula.names - set(values)
    if missing:
        raise FormulaError(
            formula.owner, "formula", f"uses the undefined name {sorted(missing)[0]!r}", formula.text,
            "Give every parameter a value, as in Potential(..., R=4).",
        )  # fmt: skip
    try:
        result = _build(formula.tree, values)
        if result.has(sympy.Abs):
            # The root of a square is one; its pieces meet in a kink, and its slope has no delta function.
            result = result.replace(sympy.Abs, _absolute)
    except (TypeError, ValueError, ArithmeticError):  # a comparison with such a number
        result = sympy.nan
    powers = [p for p in result.atoms(sympy.Pow) if p.is_number]
    if any(abs(n.p) > LARGEST_NUMBER or n.q > LARGEST_NUMBER for n in result.atoms(sympy.Rational)):
        raise FormulaError(formula.owner, "formula", "must have exact numbers below 1e100", formula.text)
    unreal = any(p.base.is_negative and p.exp.is_integer is False for p in powers)
    if unreal or result.has(sympy.I, sympy.nan, sympy.zoo, sympy.oo, -sympy.oo):
        raise FormulaError(
            formula.owner, "formula", "contains something that is not a real finite number", formula.text,
            "Look for a division by zero, or the root, power or logarithm of something negative.",
        )  # fmt: skip
    return result


def _build(node: Node, values: Mapping[str, sympy.Expr]) -> sympy.Expr:
    import sympy

    match node:
        case ("number", int() as value):
            return sympy.Integer(value)
        case ("number", float() as value):
            return sympy.Float(value)
        case ("name", str() as name):
            return sympy.pi if name in CONSTANTS else values[name]
        case (
            "call",
            "where",
            ("compare", str() as sign, tuple() as left, tuple() as right),
            tuple() as yes,
            tuple() as no,
        ):
            relation = {"<": sympy.Lt, "<=": sympy.Le, ">": sympy.Gt, ">=": sympy.Ge}[sign]
            condition = relation(_build(left, values), _build(right, values))
            return sympy.Piecewise((_build(yes, values), condition), (_build(no, values), True))
        case ("call", "abs", tuple() as argument):
            return _absolute(_build(argument, values))
        case ("call", "exp", tuple() as argument):
            return sympy.exp(_exact(_build(argument, values)))
        case ("call", str() as name, tuple() as argument):
            return getattr(sympy, name)(_build(argument, values))
        case (str() as sign, tuple() as left, tuple() as right):
            a, b = _build(left, values), _build(right, values)
            match sign:
                case "+":
                    return a + b
                case "-":
                    return a - b
                case "*":
                    return a * b
                case "/":
                    return a / b
                case "**":
                    return _bounded(a) ** _bounded(b)
    raise AssertionError(f"not a formula node: {node!r}")


def _absolute(inside: sympy.Expr) -> sympy.Expr:
    """The absolute value in two pieces: the border between them is a kink, and their slope has no delta function."""
    import sympy

    return sympy.Piecewise((inside, inside >= 0), (-inside, True))


def _exact(exponent: sympy.Expr) -> sympy.Expr:
    """An exponent with fractions for its floats.

    SymPy makes exp(1000.0*t - 1e6) a float times exp(1000.0*t): zero times infinity in double precision. Fractions
    stay where they are written.
    """
    import sympy

    floats = [x for x in exponent.atoms(sympy.Float) if 1 / LARGEST_NUMBER < abs(x) < LARGEST_NUMBER]
    return exponent.xreplace({x: sympy.Rational(repr(float(x))) for x in floats})


def _bounded(value: sympy.Expr) -> sympy.Expr:
    """The value itself; OverflowError if it holds a number so large that powers of it would not terminate."""
    import sympy

    for number in value.atoms(sympy.Float):
        _, _, exponent, bits = number._mpf_
        if exponent + bits > MOST_BITS:
            raise OverflowError
    return value


def with_floats(expression: sympy.Basic, variable: sympy.Symbol) -> sympy.Basic:
    """The expression with floats for its constants: NumPy has no root of an integer of twenty digits.

    Parameters
    ----------
    expression
        The expression; integers that doubles hold, such as exponents, stay.
    variable
        What it is a function of.
    """
    import sympy

    if variable in expression.free_symbols:
        parts = expression.args
        return expression.func(*(with_floats(part, variable) for part in parts)) if parts else expression
    small = isinstance(expression, sympy.Integer) and abs(expression) <= LARGEST_INTEGER
    return expression if small or not isinstance(expression, sympy.Expr) else expression.evalf(FLOAT_DIGITS)


def from_sympy(expression: sympy.Expr, owner: str = "formula") -> Formula:
    """Text formula of a SymPy expression.

    Raises
    ------
    FormulaError
        When it is no SymPy expression, or uses something that the grammar lacks.
    """
    import sympy

    if not isinstance(expression, sympy.Expr):
        given = getattr(expression, "__name__", None) or repr(expression)
        raise FormulaError(
            owner, "formula", "must be a text or a SymPy expression", f"{type(expression).__name__} {given}",
            "Write it as text, as in Potential('(r - 1)**2/2'): engines, files and formulas on paper come from it.",
        )  # fmt: skip
    return Formula(_TextPrinter(owner).visit(expression), owner)


class _TextPrinter(ExpressionVisitor[str]):
    """Prints an expression in the grammar; ``owner`` is who complains."""

    def __init__(self, owner: str) -> None:
        self._owner = owner

    def symbol(self, node: sympy.Symbol) -> str:
        """Text of a name."""
        name = str(node.name)
        if not name.isidentifier() or name in CONSTANTS:
            rule = "must have symbols with names that a formula can have, and no constant as a symbol"
            raise FormulaError(self._owner, "expression", rule, name, "Rename the symbol; pi is sympy.pi.")
        return name

    def number(self, node: sympy.Expr) -> str:
        """Text of a number."""
        import sympy

        if isinstance(node, sympy.Rational):
            return f"({node.p}/{node.q})" if node.q != 1 else f"({node.p})"
        if isinstance(node, sympy.Float):
            if not abs(float(node)) <= LARGEST_NUMBER or (float(node) == 0.0) != bool(node == 0):
                rule = "must have numbers of double precision below 1e100"
                raise FormulaError(self._owner, "expression", rule, str(node))
            return f"({float(node)!r})"
        if node is sympy.pi:
            return "pi"
        if not isinstance(node, sympy.NumberSymbol):
            raise self.refusal(type(node).__name__, node)
        return repr(float(node))

    def sum(self, node: sympy.Add) -> str:
        """Text of a sum."""
        return f"({' + '.join(map(self.visit, node.args))})"

    def product(self, node: sympy.Mul) -> str:
        """Text of a product."""
        return f"({'*'.join(map(self.visit, node.args))})"

    def power(self, node: sympy.Pow) -> str:
        """Text of a power."""
        return f"({self.visit(node.base)}**{self.visit(node.exp)})"

    def piecewise(self, node: sympy.Piecewise) -> str:
        """Text of pieces: nested calls of ``where``, which has a value for every other case."""
        import sympy

        *rest, (last, remaining) = node.args
        if remaining is not sympy.true:
            rule = "must have a value under every condition"
            fix = "End it with a piece for all other values, as in Piecewise((r, r < 1), (1, True))."
            raise FormulaError(self._owner, "expression", rule, str(node), fix)
        text = self.visit(last)
        for value, condition in reversed(rest):
            text = f"where({self.visit(condition)}, {self.visit(value)}, {text})"
        return text

    def condition(self, node: sympy.Basic) -> str:
        """Text of a comparison."""
        import sympy

        if not isinstance(node, sympy.Rel):
            raise self.refusal(type(node).__name__, node)
        return f"{self.visit(node.lhs)} {node.rel_op} {self.visit(node.rhs)}"

    def function(self, node: sympy.Basic) -> str:
        """Text of a function of one argument."""
        name = type(node).__name__.lower()
        if FUNCTIONS.get(name) != 1 or len(node.args) != 1:
            raise self.refusal(type(node).__name__, node)
        return f"{name}({self.visit(node.args[0])})"

    def refusal(self, name: str, node: sympy.Basic) -> Exception:
        """The error for what the grammar has no form of."""
        return FormulaError(self._owner, "expression", f"has no text form for {name}", str(node))
