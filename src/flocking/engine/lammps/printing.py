"""Printing of SymPy expressions for LAMMPS variables and for ``pair_style lepton``."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, ClassVar

from flocking.errors import UnsupportedLaw
from flocking.formula.visitor import ExpressionVisitor

if TYPE_CHECKING:
    import sympy

_COMMON = {"Abs": "abs", "sin": "sin", "cos": "cos", "tan": "tan", "exp": "exp", "atan": "atan"}


class _Printer(ExpressionVisitor[str]):
    """Prints arithmetic, fully parenthesized; subclasses add functions and conditional expressions."""

    folds_numbers = True
    functions: ClassVar[Mapping[str, str]] = _COMMON

    def __init__(self, names: Mapping[str, str]) -> None:
        self.names = names

    def symbol(self, node: sympy.Symbol) -> str:
        """Text of a name."""
        return self.names.get(node.name, str(node.name))

    def truth(self, node: sympy.Basic) -> str:
        """Text of true or false."""
        return "1" if node else "0"

    def number(self, node: sympy.Expr) -> str:
        """Text of a number."""
        value = float(node)
        return repr(value) if value >= 0 else f"(-{abs(value)!r})"

    def sum(self, node: sympy.Add) -> str:
        """Text of a sum."""
        return f"({'+'.join(map(self.visit, node.args))})"

    def product(self, node: sympy.Mul) -> str:
        """Text of a product; negative powers become divisions."""
        import sympy

        above, below = [], []
        for a in node.args:
            if isinstance(a, sympy.Pow) and a.exp.is_number and a.exp.is_negative:
                below.append(self.visit(sympy.Pow(a.base, -a.exp)))
            else:
                above.append(self.visit(a))
        text = "*".join(above) or "1"
        return f"({text}/({'*'.join(below)}))" if below else f"({text})"

    def power(self, node: sympy.Pow) -> str:
        """Text of a power."""
        return self._power(node.base, node.exp)

    def _power(self, base: object, exponent: sympy.Expr) -> str:
        import sympy

        if exponent.is_number and exponent.is_negative:
            return f"(1/{self._power(base, -exponent)})" if exponent != -1 else f"(1/{self.visit(base)})"
        if exponent == sympy.Rational(1, 2):
            return f"sqrt({self.visit(base)})"
        if exponent.is_Integer:
            return f"(({self.visit(base)})^{int(exponent)})"
        if exponent.is_Rational and exponent.q == 2:
            return f"(({self.visit(base)})^{int(exponent - sympy.Rational(1, 2))}*sqrt({self.visit(base)}))"
        return f"(({self.visit(base)})^{self.visit(exponent)})"

    def function(self, node: sympy.Basic) -> str:
        """Text of a function."""
        name, arguments = type(node).__name__, list(map(self.visit, node.args))
        if name in self.functions:
            return f"{self.functions[name]}({', '.join(arguments)})"
        if name in ("sinh", "cosh", "tanh"):
            x = arguments[0]
            up, down = f"exp({x})", f"exp(-({x}))"
            halves = {"sinh": f"(0.5*({up}-{down}))", "cosh": f"(0.5*({up}+{down}))"}
            # exp is only applied to arguments that cannot overflow.
            return halves.get(name, f"(1-2/(exp(2*({x}))+1))")
        if name in ("Max", "Min"):
            return self._extreme(name, arguments)
        raise self.refusal(name, node)

    def refusal(self, name: str, node: sympy.Basic) -> Exception:
        """The error for a function that LAMMPS does not have."""
        return UnsupportedLaw(f"LAMMPS does not have the function {name}. Use engine='tiles' or 'exact'.")

    def piecewise(self, node: sympy.Piecewise) -> str:
        """Text of a piecewise expression: nested conditionals."""
        *front, (last, _) = node.args
        text = self.visit(last)
        for value, condition in reversed(front):
            text = self._choice(self.visit(condition), self.visit(value), text)
        return text

    def condition(self, node: sympy.Basic) -> str:
        """Text of a condition."""
        import sympy

        if isinstance(node, sympy.And | sympy.Or | sympy.Not):
            return self._joined(node, [self.visit(a) for a in node.args])
        if not isinstance(node, sympy.Rel):
            raise self.refusal(type(node).__name__, node)
        return self._comparison(self.visit(node.lhs), node.rel_op, self.visit(node.rhs))

    @abstractmethod
    def _choice(self, condition: str, yes: str, no: str) -> str:
        """Text of a conditional expression."""

    @abstractmethod
    def _joined(self, node: sympy.Basic, parts: list[str]) -> str:
        """Text of a logical operation."""

    @abstractmethod
    def _comparison(self, left: str, sign: str, right: str) -> str:
        """Text of a comparison."""

    @abstractmethod
    def _extreme(self, name: str, arguments: list[str]) -> str:
        """Text of the largest or smallest of several values."""


class VariablePrinter(_Printer):
    """Formulas of equal-style and atom-style variables."""

    functions: ClassVar[Mapping[str, str]] = {**_COMMON, "log": "ln"}

    def _choice(self, condition: str, yes: str, no: str) -> str:
        # ternary() evaluates only the selected branch; the other may divide by zero.
        return f"ternary({condition}, {yes}, {no})"

    def _joined(self, node: sympy.Basic, parts: list[str]) -> str:
        import sympy

        if isinstance(node, sympy.Not):
            return f"(!{parts[0]})"
        return f"({(' && ' if isinstance(node, sympy.And) else ' || ').join(parts)})"

    def _comparison(self, left: str, sign: str, right: str) -> str:
        return f"({left} {sign} {right})"

    def _extreme(self, name: str, arguments: list[str]) -> str:
        text = arguments[0]
        for other in arguments[1:]:
            text = f"ternary(({text} {'>' if name == 'Max' else '<'} {other}), {text}, {other})"
        return text


class LeptonPrinter(_Printer):
    """Expressions for ``pair_style lepton``, which differentiates them."""

    functions: ClassVar[Mapping[str, str]] = {**_COMMON, "log": "log", "sinh": "sinh", "cosh": "cosh", "tanh": "tanh"}

    def _choice(self, condition: str, yes: str, no: str) -> str:
        return f"select({condition},{yes},{no})"

    def _joined(self, node: sympy.Basic, parts: list[str]) -> str:
        import sympy

        if isinstance(node, sympy.Not):
            return f"(1-{parts[0]})"
        return f"({'*'.join(parts)})" if isinstance(node, sympy.And) else self._extreme("Max", parts)

    def _comparison(self, left: str, sign: str, right: str) -> str:
        # step(x) is 1 from x = 0 on.
        return {
            "<": f"(1-step({left}-{right}))", "<=": f"step({right}-{left})", ">": f"(1-step({right}-{left}))",
            ">=": f"step({left}-{right})", "==": f"delta({left}-{right})", "!=": f"(1-delta({left}-{right}))",
        }[sign]  # fmt: skip

    def _extreme(self, name: str, arguments: list[str]) -> str:
        text = arguments[0]
        for other in arguments[1:]:
            text = f"{name.lower()}({text},{other})"
        return text


def variable(expression: sympy.Expr, names: Mapping[str, str]) -> str:
    """A formula for LAMMPS's ``variable`` command; ``names`` maps symbols to names in LAMMPS.

    Raises
    ------
    UnsupportedLaw
        If the expression contains a function that LAMMPS does not have.
    """
    return VariablePrinter(names).visit(expression)


def lepton(expression: object) -> str:
    """An expression in r for ``pair_style lepton``, without spaces.

    Raises
    ------
    UnsupportedLaw
        If the expression contains a function that Lepton does not have.
    """
    return LeptonPrinter({}).visit(expression).replace(" ", "")
