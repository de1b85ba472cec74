"""SymPy expressions printed for LAMMPS: for its variables, and for the expressions of ``pair_style lepton``."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, ClassVar

from flocking.errors import UnsupportedLaw

if TYPE_CHECKING:
    import sympy

_COMPARE = {
    "StrictLessThan": "<", "LessThan": "<=", "StrictGreaterThan": ">", "GreaterThan": ">=", "Equality": "==",
    "Unequality": "!=",
}  # fmt: skip

_COMMON = {"sin": "sin", "cos": "cos", "tan": "tan", "exp": "exp", "atan": "atan"}


class _Writer(ABC):
    """Writes arithmetic, fully bracketed; a dialect adds its functions and its choice between two values."""

    functions: ClassVar[Mapping[str, str]] = _COMMON

    def __init__(self, names: Mapping[str, str]) -> None:
        self.names = names

    def write(self, e: sympy.Expr) -> str:
        """Text of an expression or condition."""
        import sympy

        if e.is_Symbol:
            return self.names.get(e.name, e.name)
        if e in (sympy.true, sympy.false):
            return "1" if e == sympy.true else "0"
        if isinstance(e, sympy.Piecewise):
            return self._pieces(e)
        if e.is_Boolean:
            return self._condition(e)
        if e.is_number and not e.has(sympy.Function):
            value = float(e)
            return repr(value) if value >= 0 else f"(-{abs(value)!r})"
        if isinstance(e, sympy.Add):
            return "(" + "+".join(self.write(a) for a in e.args) + ")"
        if isinstance(e, sympy.Mul):
            return self._product(e)
        if isinstance(e, sympy.Pow):
            return self._power(e.base, e.exp)
        return self._call(type(e).__name__, e.args)

    def _product(self, e: sympy.Expr) -> str:
        import sympy

        above, below = [], []
        for a in e.args:
            if isinstance(a, sympy.Pow) and a.exp.is_number and a.exp.is_negative:
                below.append(self.write(sympy.Pow(a.base, -a.exp)))
            else:
                above.append(self.write(a))
        text = "*".join(above) or "1"
        return f"({text}/({'*'.join(below)}))" if below else f"({text})"

    def _power(self, base: object, exponent: sympy.Expr) -> str:
        import sympy

        if exponent.is_number and exponent.is_negative:
            return f"(1/{self._power(base, -exponent)})" if exponent != -1 else f"(1/{self.write(base)})"
        if exponent == sympy.Rational(1, 2):
            return f"sqrt({self.write(base)})"
        if exponent.is_Integer:
            return f"(({self.write(base)})^{int(exponent)})"
        if exponent.is_Rational and exponent.q == 2:
            return f"(({self.write(base)})^{int(exponent - sympy.Rational(1, 2))}*sqrt({self.write(base)}))"
        return f"(({self.write(base)})^{self.write(exponent)})"

    def _call(self, name: str, arguments: Sequence[sympy.Expr]) -> str:
        if name in self.functions:
            return f"{self.functions[name]}({', '.join(self.write(a) for a in arguments)})"
        if name in ("sinh", "cosh", "tanh"):
            x = self.write(arguments[0])
            up, down = f"exp({x})", f"exp(-({x}))"
            halves = {"sinh": f"(0.5*({up}-{down}))", "cosh": f"(0.5*({up}+{down}))"}
            # exp of the positive side alone: neither overflows.
            return halves.get(name, f"(1-2/(exp(2*({x}))+1))")
        if name == "Abs":
            return f"abs({self.write(arguments[0])})"
        if name in ("Max", "Min"):
            return self._extreme(name, [self.write(a) for a in arguments])
        raise UnsupportedLaw(f"LAMMPS has no form of the function {name}. Use engine='tiles' or 'exact'.")

    def _pieces(self, e: sympy.Expr) -> str:
        *front, (last, _) = e.args
        text = self.write(last)
        for value, condition in reversed(front):
            text = self._choice(self._condition(condition), self.write(value), text)
        return text

    @abstractmethod
    def _choice(self, condition: str, yes: str, no: str) -> str:
        """Text that chooses between two values."""

    @abstractmethod
    def _condition(self, e: object) -> str:
        """Text of a condition."""

    @abstractmethod
    def _extreme(self, name: str, arguments: list[str]) -> str:
        """Text of the largest or smallest of several values."""


class VariableWriter(_Writer):
    """Formulas of equal-style and atom-style variables."""

    functions: ClassVar[Mapping[str, str]] = {**_COMMON, "log": "ln"}

    def _choice(self, condition: str, yes: str, no: str) -> str:
        # Evaluates the chosen branch alone: the other may divide by zero.
        return f"ternary({condition}, {yes}, {no})"

    def _condition(self, e: sympy.Expr) -> str:
        import sympy

        if e in (sympy.true, sympy.false):
            return "1" if e == sympy.true else "0"
        if isinstance(e, sympy.And | sympy.Or):
            sign = " && " if isinstance(e, sympy.And) else " || "
            return "(" + sign.join(self._condition(a) for a in e.args) + ")"
        if isinstance(e, sympy.Not):
            return f"(!{self._condition(e.args[0])})"
        return f"({self.write(e.lhs)} {_COMPARE[type(e).__name__]} {self.write(e.rhs)})"

    def _extreme(self, name: str, arguments: list[str]) -> str:
        text = arguments[0]
        for other in arguments[1:]:
            text = f"ternary(({text} {'>' if name == 'Max' else '<'} {other}), {text}, {other})"
        return text


class LeptonWriter(_Writer):
    """Expressions of ``pair_style lepton``, which differentiates them itself."""

    functions: ClassVar[Mapping[str, str]] = {**_COMMON, "log": "log", "sinh": "sinh", "cosh": "cosh", "tanh": "tanh"}

    def _choice(self, condition: str, yes: str, no: str) -> str:
        return f"select({condition},{yes},{no})"

    def _condition(self, e: sympy.Expr) -> str:
        import sympy

        if e in (sympy.true, sympy.false):
            return "1" if e == sympy.true else "0"
        if isinstance(e, sympy.And):
            return "(" + "*".join(self._condition(a) for a in e.args) + ")"
        if isinstance(e, sympy.Or):
            text = self._condition(e.args[0])
            for other in e.args[1:]:
                text = f"max({text},{self._condition(other)})"
            return text
        if isinstance(e, sympy.Not):
            return f"(1-{self._condition(e.args[0])})"
        left, right, kind = self.write(e.lhs), self.write(e.rhs), _COMPARE[type(e).__name__]
        # step(x) is 1 from x = 0 on.
        forms = {
            "<": f"(1-step({left}-{right}))", "<=": f"step({right}-{left})", ">": f"(1-step({right}-{left}))",
            ">=": f"step({left}-{right})", "==": f"delta({left}-{right})", "!=": f"(1-delta({left}-{right}))",
        }  # fmt: skip
        return forms[kind]

    def _extreme(self, name: str, arguments: list[str]) -> str:
        text = arguments[0]
        for other in arguments[1:]:
            text = f"{name.lower()}({text},{other})"
        return text


def variable(expression: sympy.Expr, names: Mapping[str, str]) -> str:
    """A formula for LAMMPS's ``variable`` command; ``names`` replaces symbols by what LAMMPS calls them.

    Raises
    ------
    UnsupportedLaw
        When the expression has a function that LAMMPS lacks.
    """
    return VariableWriter(names).write(expression)


def lepton(expression: object) -> str:
    """An expression in r for ``pair_style lepton``, without blanks.

    Raises
    ------
    UnsupportedLaw
        When the expression has a function that Lepton lacks.
    """
    return LeptonWriter({}).write(expression).replace(" ", "")
