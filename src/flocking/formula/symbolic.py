"""Between text formulas and SymPy: the only place that turns one into the other."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from flocking.errors import FormulaError
from flocking.formula.grammar import CONSTANTS, LARGEST_NUMBER, Formula, Node

if TYPE_CHECKING:
    import sympy


MOST_BITS = 4096
"""Numbers beyond two to this power are not raised to powers: double precision ends at 1024."""


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
            "Give every parameter a value, as in Potential('1/r + 1/(R - r)', R=4).",
        )  # fmt: skip
    try:
        result = _build(formula.tree, values)
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
            # Two pieces: the border between them is a kink, and their slope has no delta function.
            inside = _build(argument, values)
            return sympy.Piecewise((inside, inside >= 0), (-inside, True))
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
                    return _tame(a) ** _tame(b)
    raise AssertionError(f"not a formula node: {node!r}")


def _exact(exponent: sympy.Expr) -> sympy.Expr:
    """An exponent with fractions for its floats.

    SymPy makes exp(1000.0*t - 1e6) a float times exp(1000.0*t): zero times infinity in double precision. Fractions
    stay where they are written.
    """
    import sympy

    floats = [x for x in exponent.atoms(sympy.Float) if 1 / LARGEST_NUMBER < abs(x) < LARGEST_NUMBER]
    return exponent.xreplace({x: sympy.Rational(repr(float(x))) for x in floats})


def _tame(value: sympy.Expr) -> sympy.Expr:
    """The value itself, unless it holds a number so large that powers of it never end."""
    import sympy

    for number in value.atoms(sympy.Float):
        _, _, exponent, bits = number._mpf_
        if exponent + bits > MOST_BITS:
            raise OverflowError
    return value


def from_sympy(expression: sympy.Expr, owner: str = "formula") -> Formula:
    """Text formula of a SymPy expression.

    Raises
    ------
    FormulaError
        When it is no expression of SymPy, or uses something the grammar has no word for.
    """
    import sympy

    if not isinstance(expression, sympy.Expr):
        given = getattr(expression, "__name__", None) or repr(expression)
        raise FormulaError(
            owner, "formula", "must be a text or a SymPy expression", f"{type(expression).__name__} {given}",
            "Write it as text, as in Potential('(r - 1)**2/2'): engines, files and formulas on paper come from it.",
        )  # fmt: skip
    return Formula(_text(expression, owner), owner)


def _text(expression: sympy.Basic, owner: str) -> str:
    import sympy

    if isinstance(expression, sympy.Piecewise):
        *rest, (last, _) = expression.args
        text = _text(last, owner)
        for value, condition in reversed(rest):
            text = f"where({_text(condition, owner)}, {_text(value, owner)}, {text})"
        return text
    if isinstance(expression, sympy.Rel):
        return f"{_text(expression.lhs, owner)} {expression.rel_op} {_text(expression.rhs, owner)}"
    if isinstance(expression, sympy.Rational):
        return f"({expression.p}/{expression.q})" if expression.q != 1 else f"({expression.p})"
    if isinstance(expression, sympy.Float):
        return f"({float(expression)!r})"
    if isinstance(expression, sympy.Symbol):
        return str(expression.name)
    if expression is sympy.pi:
        return "pi"
    if isinstance(expression, sympy.exp):
        return f"exp({_text(expression.args[0], owner)})"
    if isinstance(expression, sympy.NumberSymbol):
        return repr(float(expression))
    if isinstance(expression, sympy.Add):
        return "(" + " + ".join(_text(a, owner) for a in expression.args) + ")"
    if isinstance(expression, sympy.Mul):
        return "(" + "*".join(_text(a, owner) for a in expression.args) + ")"
    if isinstance(expression, sympy.Pow):
        return f"({_text(expression.base, owner)}**{_text(expression.exp, owner)})"
    name = type(expression).__name__.lower()
    if name in {"log", "sin", "cos", "tan", "atan", "sinh", "cosh", "tanh", "abs"}:
        return f"{name}({_text(expression.args[0], owner)})"
    raise FormulaError(owner, "expression", f"has no text form for {type(expression).__name__}", str(expression))
