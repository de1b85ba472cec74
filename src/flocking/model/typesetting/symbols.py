"""Symbols of formulas for printing: one axis stands for a vector, and functions keep their names."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from flocking.model.checks import Array
from flocking.model.parts.registration import description_of
from flocking.model.potentials.bumps import Bump
from flocking.model.potentials.potential import Potential

if TYPE_CHECKING:
    import sympy

SMALLEST = 1e-100
"""Numbers below this stand in roots against a division by zero alone, and are not printed."""


def numbered(latex: str, number: int) -> str:
    """A symbol with a number among its subscripts, where it is not the first of those with one name.

    Parameters
    ----------
    latex
        The symbol.
    number
        1, 2, ...
    """
    if number == 1:
        return latex
    head, found, below = latex.rpartition("_")
    if not found:
        return rf"{latex}_{{{number}}}"
    return rf"{head}_{{{below[1:-1] if below.startswith('{') else below},{number}}}"


def parameter_latex(name: str, *, each: bool = False, number: int = 1) -> str:
    """Symbol of a parameter: a letter by itself, a gain as c with what it is the gain of, others upright.

    Parameters
    ----------
    name
        Its name.
    each
        Whether each agent has its own.
    number
        Its number among different ones of that name.
    """
    own = "i," if each else ""
    if name == "weights":
        found = "w_{ij}"
    elif name == "gain":
        found = "c_i" if each else "c"
    elif name.endswith("_gain"):
        found = rf"c_{{{own}\mathrm{{{name[:-5].replace('_', chr(92) + ' ')}}}}}"
    elif len(name) == 1:
        found = f"{name}_i" if each else name
    else:
        text = name.replace("_", r"\ ")
        found = rf"\mathrm{{{text}}}_i" if each else rf"\mathrm{{{text}}}"
    return numbered(found, number)


class Names:
    """Symbols with their LaTeX, and which of them are vectors.

    Parameters
    ----------
    numbers
        Numbers of parameters among different ones of a name, where they are not the first.
    """

    def __init__(self, numbers: Mapping[str, int] | None = None) -> None:
        self.numbers = numbers or {}
        self.latex: dict[sympy.Symbol, str] = {}
        self.vectors: set[sympy.Symbol] = set()

    def scalar(self, latex: str, rank: str = "b") -> sympy.Symbol:
        """A symbol of a number, shown as ``latex``; those of lower ``rank`` stand before others in products."""
        import sympy

        found = sympy.Symbol(f"{rank}{len(self.latex):04d}", real=True)
        self.latex[found] = latex
        return found

    def vector(self, latex: str) -> sympy.Symbol:
        """A symbol that stands for a vector, shown as ``latex``."""
        found = self.scalar(latex, "v")
        self.vectors.add(found)
        return found

    def parameter(self, values: Mapping[str, object]) -> Callable[[str], sympy.Symbol]:
        """Symbols of the parameters of a part by name; ``values`` state which differ from agent to agent."""
        made: dict[str, sympy.Symbol] = {}

        def named(name: str) -> sympy.Symbol:
            if name not in made:
                value = values.get(name)
                each = isinstance(value, np.ndarray) or bool(getattr(value, "per_agent", False))
                number = self.numbers.get(name, 1)
                made[name] = self.scalar(parameter_latex(name, each=each, number=number), "a")
            return made[name]

        return named

    def print(self, expression: sympy.Expr) -> str:
        """LaTeX of an expression."""
        return str(_printer(self).doprint(_plain(expression)))


def named_function(latex: str) -> Any:
    """A function whose slope is printed with a prime.

    Parameters
    ----------
    latex
        Its name in LaTeX.
    """
    import sympy

    slope = type("Slope", (sympy.Function,), {"nargs": 1, "shown": f"{latex}'"})
    return type("Named", (sympy.Function,), {"nargs": 1, "shown": latex, "fdiff": lambda f, _=1: slope(f.args[0])})


class NamedPotential(Potential):
    """A potential that is printed by its name.

    Parameters
    ----------
    potential
        The potential.
    latex
        Its name.
    """

    def __init__(self, potential: Potential, latex: str) -> None:
        object.__setattr__(self, "formula", potential.formula)
        object.__setattr__(self, "parameters", potential.parameters)
        object.__setattr__(self, "function", named_function(latex))

    def expression(self, r: sympy.Expr, values: Mapping[str, sympy.Expr] | None = None) -> sympy.Expr:
        """The name at distance ``r``; ``values`` of parameters are not shown."""
        return self.function(r)  # type: ignore[attr-defined]


class NamedBump(Bump):
    """A bump function that is printed by its name.

    Parameters
    ----------
    bump
        The function.
    latex
        Its name.
    """

    def __init__(self, bump: Bump, latex: str) -> None:
        super().__init__(bump.name, bump.formula)
        object.__setattr__(self, "function", named_function(latex))

    def expression(self, z: sympy.Expr, k0: sympy.Expr) -> sympy.Expr:
        """The name at ``z``; the onset ``k0`` is not shown."""
        return self.function(z)  # type: ignore[attr-defined]


def by_name(part: Any, numbers: Mapping[str, int] | None = None) -> tuple[Any, dict[str, Potential]]:
    """A term whose potentials and bump functions are printed by their names, and its potentials by those names.

    Parameters
    ----------
    part
        The term.
    numbers
        Numbers of its fields among different ones of a name, where they are not the first.
    """
    from dataclasses import replace

    from flocking.model.potentials.bumps import bump_named

    kind = description_of(part)
    if kind is None:
        return part, {}
    changed: dict[str, object] = {}
    shown: dict[str, Potential] = {}
    for field in kind.fields.values():
        value = getattr(part, field.attribute)
        if isinstance(value, Potential):
            latex = r"\psi" if field.name == "potential" else rf"\psi_{{\mathrm{{{field.name}}}}}"
            latex = numbered(latex, (numbers or {}).get(field.name, 1))
            changed[field.attribute] = NamedPotential(value, latex)
            shown[latex] = value
        elif field.name == "bump":
            shape = numbered(r"\rho", (numbers or {}).get(field.name, 1))
            changed[field.attribute] = NamedBump(bump_named(type(part).__name__, value), shape)
    return (replace(part, **changed) if changed else part), shown


def _plain(expression: sympy.Expr) -> sympy.Expr:
    import sympy

    tiny = {x: sympy.Integer(0) for x in expression.atoms(sympy.Float) if abs(float(x)) < SMALLEST}
    return expression.xreplace(tiny) if tiny else expression


def _printer(names: Names) -> Any:
    import sympy
    from sympy.printing.latex import LatexPrinter

    class Printer(LatexPrinter):  # type: ignore[misc]
        def _print_Function(self, expr: sympy.Expr, exp: str | None = None) -> str:  # noqa: N802
            shown = getattr(type(expr), "shown", None)
            if shown is None:
                return str(super()._print_Function(expr, exp))
            text = rf"{shown}{{\left({self._print(expr.args[0])}\right)}}"
            return text if exp is None else rf"\left[{text}\right]^{{{exp}}}"

        def _print_Pow(self, expr: sympy.Expr) -> str:  # noqa: N802
            if expr.exp.is_number and (expr.exp / 2).is_integer and expr.base.free_symbols & names.vectors:
                norm = rf"\left\|{self._print(expr.base)}\right\|"
                if expr.exp > 0:
                    return rf"{norm}^{{{expr.exp}}}"
                return rf"\frac{{1}}{{{norm}^{{{-expr.exp}}}}}"
            inner = expr.base
            if (
                abs(expr.exp) == sympy.Rational(1, 2)
                and inner.is_Pow
                and inner.exp == 2
                and inner.free_symbols & names.vectors
            ):
                norm = rf"\left\|{self._print(inner.base)}\right\|"
                return norm if expr.exp > 0 else rf"\frac{{1}}{{{norm}}}"
            return str(super()._print_Pow(expr))

        def _print_Abs(self, expr: sympy.Expr, exp: str | None = None) -> str:  # noqa: N802
            if not expr.free_symbols & names.vectors:
                return str(super()._print_Abs(expr, exp))
            norm = rf"\left\|{self._print(expr.args[0])}\right\|"
            return norm if exp is None else rf"{norm}^{{{exp}}}"

    return Printer({"symbol_names": names.latex, "order": "none"})


def with_stand_ins(expression: sympy.Expr) -> sympy.Expr:
    """The expression with a sine of its own phase in place of each function that is printed by name."""
    import sympy

    return expression.replace(
        lambda e: hasattr(type(e), "shown"), lambda e: sympy.sin(e.args[0] + sum(map(ord, type(e).shown)))
    )


def value_of_vectors(expression: sympy.Expr, numbers: Mapping[sympy.Symbol, Array], names: Names) -> Array:
    """Value of a formula in which one axis stands for a vector: sums add vectors, even powers are those of norms.

    Parameters
    ----------
    expression
        The formula.
    numbers
        Arrays for vectors, and arrays without axes for numbers.
    names
        Which symbols are vectors.

    Returns
    -------
    array
        A vector, or an array without axes.

    Raises
    ------
    TypeError
        Where it has no value as a formula of vectors.
    """
    import sympy

    if expression.is_Symbol:
        return numbers[expression]
    if not expression.free_symbols & names.vectors:
        inner = {s: float(numbers[s]) for s in expression.free_symbols}
        return np.array(float(with_stand_ins(expression).evalf(subs=inner)))
    values = [value_of_vectors(x, numbers, names) for x in expression.args]
    vectors = [v for v in values if v.ndim]
    if isinstance(expression, sympy.Add) and len({v.ndim for v in values}) == 1:
        return np.asarray(np.sum(values, axis=0))
    if isinstance(expression, sympy.Mul) and len(vectors) <= 1:
        scale = np.prod([v for v in values if not v.ndim])
        return np.asarray(scale * vectors[0] if vectors else scale)
    if isinstance(expression, sympy.Pow) and not values[1].ndim:
        base, power = values
        if not base.ndim:
            return np.asarray(base**power)
        if power % 2 == 0:
            return np.asarray(np.linalg.norm(base) ** power)
    if isinstance(expression, sympy.Function) and not vectors:
        return np.array(float(with_stand_ins(expression.func(*map(sympy.Float, values)))))
    raise TypeError(f"{expression.func} has no vector form")
