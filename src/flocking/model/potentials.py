"""Potentials: one formula psi(r) of the distance, from which slope, LaTeX and functions are derived."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from flocking.errors import FormulaError
from flocking.formula.compiled import generated_module
from flocking.formula.grammar import Formula
from flocking.model.checks import Array, number
from flocking.model.checks import parameters as checked_parameters

if TYPE_CHECKING:
    import sympy


@dataclass(frozen=True, init=False)
class Potential:
    """A pair potential psi(r) given by one formula; everything else is derived from it.

    Parameters
    ----------
    formula
        Text in the formula grammar with the distance named ``r``, or a SymPy expression in a symbol ``r``.
    parameters
        A value for every other name of the formula.

    Raises
    ------
    FormulaError
        When the text is not in the grammar or a name has no value.
    InvalidInput
        When a parameter is not a finite number.

    Examples
    --------
    >>> psi = Potential("1/r + 1/(R - r)", R=4)
    >>> float(psi(2.0))
    1.0
    """

    formula: Formula
    parameters: Mapping[str, float]

    def __init__(self, formula: str | Formula | sympy.Expr, **parameters: float) -> None:
        if isinstance(formula, str):
            formula = Formula(formula, "Potential")
        elif not isinstance(formula, Formula):
            from flocking.formula.symbolic import from_sympy

            formula = from_sympy(formula, "Potential")
        needed = formula.names - {"r"}
        if "r" in parameters:
            raise FormulaError("Potential", "r", "is the distance and takes no value", parameters["r"])
        if missing := sorted(needed - set(parameters)):
            raise FormulaError(
                "Potential", "formula", f"uses {missing[0]!r}, which has no value", formula.text,
                f"Give it one: Potential(..., {missing[0]}=1.0). The distance is called r.",
            )  # fmt: skip
        if unused := sorted(set(parameters) - needed):
            raise FormulaError("Potential", unused[0], "is not in the formula", formula.text, "Remove it or use it.")
        object.__setattr__(self, "formula", formula)
        object.__setattr__(self, "parameters", MappingProxyType(checked_parameters("Potential", parameters)))

    def __hash__(self) -> int:
        return hash((self.formula, tuple(self.parameters.items())))

    def __reduce__(self) -> tuple[Any, ...]:
        return (_rebuild, (self.formula.text, dict(self.parameters)))

    def __repr__(self) -> str:
        values = "".join(f", {name}={value:g}" for name, value in self.parameters.items())
        return f"Potential({self.formula.text!r}{values})"

    def with_parameters(self, **parameters: float) -> Potential:
        """The same formula with some parameters changed."""
        return Potential(self.formula, **{**self.parameters, **parameters})

    def expression(self, r: sympy.Expr, values: Mapping[str, sympy.Expr] | None = None) -> sympy.Expr:
        """SymPy form at distance ``r``; parameters are ``values``, or their numbers when absent."""
        import sympy

        from flocking.formula.symbolic import to_sympy

        numbers: dict[str, sympy.Expr] = {k: sympy.nsimplify(v, rational=True) for k, v in self.parameters.items()}
        return to_sympy(self.formula, {**numbers, **(values or {}), "r": r})

    def symbolic(self) -> tuple[sympy.Symbol, sympy.Expr]:
        """The symbol r and psi(r) with its parameters as symbols, for printing and algebra."""
        import sympy

        r = sympy.Symbol("r", positive=True)
        return r, self.expression(r, {name: sympy.Symbol(name, real=True) for name in self.parameters})

    def latex(self) -> str:
        """LaTeX of psi(r)."""
        import sympy

        return str(sympy.latex(self.symbolic()[1]))

    def slope_latex(self) -> str:
        """LaTeX of psi'(r), derived from the formula."""
        import sympy

        r, psi = self.symbolic()
        return str(sympy.latex(sympy.diff(psi, r)))

    def __call__(self, r: ArrayLike) -> Array:
        """Values psi(r); shape of ``r``."""
        return self._evaluate("value", r)

    def slope(self, r: ArrayLike) -> Array:
        """Slopes psi'(r); shape of ``r``."""
        return self._evaluate("slope", r)

    def curvature(self, r: ArrayLike) -> Array:
        """Second derivatives psi''(r); shape of ``r``."""
        return self._evaluate("curvature", r)

    def _evaluate(self, which: str, r: ArrayLike) -> Array:
        names = tuple(self.parameters)
        module = generated_module(("potential", self.formula.structure, names), lambda: _array_source(self))
        distances = np.asarray(r, dtype=np.float64)
        with np.errstate(all="ignore"):
            values = getattr(module, which)(distances, *self.parameters.values())
        return np.asarray(values, dtype=np.float64) + np.zeros_like(distances)

    def kinks(self) -> tuple[float, ...]:
        """Distances at which two pieces of a piecewise formula meet, in ascending order."""
        return piece_borders(self)

    def cut(self, radius: float) -> Potential:
        """The potential inside ``radius`` and zero from there on (a jump, unless psi(radius) = 0)."""
        return self._wrap("where(r < cut, PSI, 0)", cut=number("Potential.cut", "radius", radius, above=0.0))

    def capped(self, radius: float) -> Potential:
        """The potential inside ``radius`` and the constant psi(radius) from there on (continuous)."""
        inside = number("Potential.capped", "radius", radius, above=0.0)
        return self._wrap("where(r < cap, PSI, PSI_AT_cap)", cap=inside)

    def shifted(self, distance: float) -> Potential:
        """The potential minus its value at ``distance``."""
        at = number("Potential.shifted", "distance", distance, above=0.0)
        return self._wrap("PSI - PSI_AT_zero_at", zero_at=at)

    def smoothed(self, radius: float, onset: float) -> Potential:
        """The potential times a cosine bump: 1 until ``onset``, 0 from ``radius`` on (continuous slope)."""
        outer = number("Potential.smoothed", "radius", radius, above=0.0)
        inner = number("Potential.smoothed", "onset", onset, above=0.0, below=outer)
        bump = "where(r < fade, 1, where(r < fade_end, (1 + cos(pi*(r - fade)/(fade_end - fade)))/2, 0))"
        return self._wrap(f"{bump} * PSI", fade=inner, fade_end=outer)

    def _wrap(self, pattern: str, **new: float) -> Potential:
        from flocking.formula.grammar import render

        taken = set(self.parameters)
        names = {}
        for name in new:
            free = name
            while free in taken:
                free += "_2"
            names[name] = free
        inner = render(self.formula.tree)
        text = pattern
        for name, free in names.items():
            text = text.replace(f"PSI_AT_{name}", f"({_substitute(self.formula, free)})")
            text = _rename(text, name, free)
        text = text.replace("PSI", f"({inner})")
        return Potential(text, **self.parameters, **{names[k]: v for k, v in new.items()})


def _rebuild(text: str, parameters: dict[str, float]) -> Potential:
    return Potential(text, **parameters)


def _rename(text: str, name: str, free: str) -> str:
    import re

    return re.sub(rf"\b{name}\b", free, text)


def _substitute(formula: Formula, name: str) -> str:
    return _rename(formula.structure, "r", name)


def piece_borders(potential: Potential) -> tuple[float, ...]:
    """Distances where pieces of the formula meet: read from its conditions, without SymPy where none."""
    if "where(" not in potential.formula.structure:
        return ()
    names = tuple(potential.parameters)
    module = generated_module(("borders", potential.formula.structure, names), lambda: _border_source(potential))
    found = {float(b) for b in module.borders(*potential.parameters.values())}
    return tuple(sorted(b for b in found if np.isfinite(b) and b > 0))


def _array_source(potential: Potential) -> str:
    import sympy

    from flocking.formula.printing import code

    r, psi = potential.symbolic()
    arguments = ", ".join(["r", *potential.parameters])
    lines = ["import numpy", ""]
    for name, expression in zip(
        ("value", "slope", "curvature"), (psi, sympy.diff(psi, r), sympy.diff(psi, r, 2)), strict=True
    ):
        lines += [f"def {name}({arguments}):", f"    return {code(expression, arrays=True)}", ""]
    return "\n".join(lines)


def _border_source(potential: Potential) -> str:
    import sympy

    from flocking.formula.printing import code

    r, psi = potential.symbolic()
    roots: set[Any] = set()
    for relation in psi.atoms(sympy.core.relational.Relational):
        roots |= set(sympy.solve(relation.lhs - relation.rhs, r))
    texts = sorted(code(root, arrays=False) for root in roots if root.free_symbols <= psi.free_symbols - {r})
    arguments = ", ".join(potential.parameters)
    return f"import math\n\ndef borders({arguments}):\n    return [{', '.join(texts)}]\n"
