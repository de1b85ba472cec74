"""The scalar statements of `flocking.formula.printing` as C99, operation by operation and in the same order."""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Sequence
from fractions import Fraction

import numpy as np

from flocking.formula.native.arithmetic import MOST_FACTORS
from flocking.formula.syntax_trees import parsed

FUNCTIONS = frozenset({"sqrt", "exp", "log", "sin", "cos", "floor", "fabs", "copysign", "pow"})
"""Functions that the emitted source brings along, see `flocking.engine.c_export.elementary_functions`."""

_KNOWN: dict[type[ast.operator], Callable[[float, float], float]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}  # fmt: skip
_SIGNS: dict[type[ast.AST], str] = {
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=",
    ast.Eq: "==", ast.NotEq: "!=", ast.And: "&&", ast.Or: "||",
}  # fmt: skip


LEAST_SINGLE = float(np.finfo(np.float32).tiny)
"""The smallest positive number of single precision with all its digits; those below lose some, or become zero."""


class NoCError(Exception):
    """An expression has no translation into C; its argument names what has none."""


class CSource:
    """Translates statements into C of one precision.

    Integer powers are products, in the order of the native functions; half-integer powers are products with a root.

    Parameters
    ----------
    single
        Whether numbers are of single precision.
    prefix
        Begin of the names of functions, such as ``law_``.

    Attributes
    ----------
    used
        Functions that the source needs.
    """

    def __init__(self, *, single: bool, prefix: str) -> None:
        self.single, self.prefix = single, prefix
        self.used: set[str] = set()

    def literal(self, value: float) -> str:
        """A number, rounded once.

        Raises
        ------
        NoCError
            When it is not finite in the precision, or so small that it loses digits there or all of itself.
        """
        with np.errstate(over="ignore", under="ignore"):
            rounded = float(np.float32(value)) if self.single else float(value)
        if not math.isfinite(rounded):
            raise NoCError(f"the number {value}, which is not finite in this precision")
        if self.single and value and abs(rounded) < LEAST_SINGLE:
            raise NoCError(f"the number {value}, which is too small for this precision")
        text = str(np.float32(value)) if self.single else repr(rounded)
        text += "" if "." in text or "e" in text else ".0"
        text += "f" if self.single else ""
        return f"({text})" if text.startswith("-") else text

    def statements(self, lines: Sequence[str]) -> list[str]:
        """Declarations of constants, one for each assignment of the printed ``lines``.

        Raises
        ------
        NoCError
            When an expression has no translation.
        """
        found = []
        for line in lines:
            (node,) = parsed(line).body
            assert isinstance(node, ast.Assign)
            (name,) = node.targets
            assert isinstance(name, ast.Name)
            found.append(f"const {self.prefix}real {name.id} = {self.expression(node.value)};")
        return found

    def text(self, source: str) -> str:
        """One printed expression in C.

        Parameters
        ----------
        source
            The expression.
        """
        return self.expression(parsed(source, "eval").body)

    def expression(self, node: ast.expr) -> str:
        """An expression in C, in parentheses where it is composed."""
        known = constant(node)
        if known is not None:
            return self.literal(known)
        match node:
            case ast.Name(id=name):
                return name
            case ast.UnaryOp(op=ast.USub(), operand=inner):
                return f"(-{self.expression(inner)})"
            case ast.BinOp(left=base, op=ast.Pow(), right=exponent):
                return self._power(base, exponent)
            case ast.BinOp(left=left, op=ast.Add(), right=right) if self._keeps_from_zero(right):
                return f"({self.expression(left)} + {self.literal(LEAST_SINGLE)})"
            case ast.BinOp(left=left, op=sign, right=right) if type(sign) in _SIGNS:
                return f"({self.expression(left)} {_SIGNS[type(sign)]} {self.expression(right)})"
            case ast.IfExp(test=test, body=yes, orelse=no):
                return f"({self.condition(test)} ? {self.expression(yes)} : {self.expression(no)})"
            case ast.Call(func=ast.Attribute(value=ast.Name(id="math"), attr=name), args=args) if name in FUNCTIONS:
                return self._call(name, args)
            case ast.Call(func=ast.Name(id="abs"), args=args):
                return self._call("fabs", args)
            case ast.Call(func=ast.Name(id="min" | "max" as name), args=[first, *rest]):
                found = self.expression(first)
                for part in rest:
                    other = self.expression(part)
                    found = f"(({other} {'<' if name == 'min' else '>'} {found}) ? {other} : {found})"
                return found
        raise NoCError(ast.unparse(node))

    def _keeps_from_zero(self, addend: ast.expr) -> bool:
        """Whether a number is added that single precision has not, so that a root or a divisor is not zero."""
        known = constant(addend)
        return self.single and known is not None and 0.0 < known < LEAST_SINGLE

    def condition(self, node: ast.expr) -> str:
        """A condition in C."""
        match node:
            case ast.Constant(value=bool() as value):
                return "(1 == 1)" if value else "(1 == 0)"
            case ast.BoolOp(op=sign, values=parts):
                return "(" + f" {_SIGNS[type(sign)]} ".join(self.condition(x) for x in parts) + ")"
            case ast.UnaryOp(op=ast.Not(), operand=inner):
                return f"(!{self.condition(inner)})"
            case ast.Compare(left=left, ops=[sign], comparators=[right]) if type(sign) in _SIGNS:
                return f"({self.expression(left)} {_SIGNS[type(sign)]} {self.expression(right)})"
        raise NoCError(ast.unparse(node))

    def _call(self, name: str, args: Sequence[ast.expr]) -> str:
        self.used.add(name)
        return f"{self.prefix}{name}({', '.join(self.expression(x) for x in args)})"

    def _power(self, base: ast.expr, exponent: ast.expr) -> str:
        known = constant(exponent)
        twice = None if known is None else Fraction(known) * 2
        if twice is not None and twice.denominator == 1 and abs(twice) < 2 * MOST_FACTORS:
            power, half = divmod(abs(int(twice)), 2)
            found = self.expression(base)
            parts = self._products(found, power)
            if half:
                self.used.add("sqrt")
                root = f"{self.prefix}sqrt({found})"
                parts = root if not power else f"({parts} * {root})"
            return f"({self.literal(1.0)} / {parts})" if twice < 0 else parts
        self.used.add("pow")
        return f"{self.prefix}pow({self.expression(base)}, {self.expression(exponent)})"

    def _products(self, base: str, exponent: int) -> str:
        """Product of equal factors, by a function that is emitted for its exponent."""
        if exponent < 2:
            return base if exponent else self.literal(1.0)
        self.used.add(f"power{exponent}")
        return f"{self.prefix}power{exponent}({base})"


def products(base: str, exponent: int) -> str:
    """Product of ``exponent`` equal factors by squares, in the order in which native functions compute it.

    Parameters
    ----------
    base
        Source of a factor.
    exponent
        Number of factors; positive.
    """
    found, factor, left = "", base, exponent
    while left:
        if left & 1:
            found = f"({found} * {factor})" if found else factor
        left >>= 1
        if left:
            factor = f"({factor} * {factor})"
    return found


def constant(node: ast.expr) -> float | None:
    """Value of an expression of numbers alone, as Python computes it; None for others."""
    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            return value
        case ast.Attribute(value=ast.Name(id="math"), attr="pi" | "e" as name):
            return float(getattr(math, name))
        case ast.UnaryOp(op=ast.USub(), operand=inner):
            known = constant(inner)
            return None if known is None else -known
        case ast.BinOp(left=left, op=sign, right=right) if type(sign) in _KNOWN:
            a, b = constant(left), constant(right)
            if a is None or b is None:
                return None
            try:
                return _KNOWN[type(sign)](a, b)
            except ArithmeticError:
                return None
    return None
