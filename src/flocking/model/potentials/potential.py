"""Potentials: one formula psi(r) of the distance, from which slope, LaTeX and functions are derived."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from types import MappingProxyType, ModuleType
from typing import TYPE_CHECKING, Annotated

import numpy as np
from numpy.typing import ArrayLike

from flocking.errors import FormulaError
from flocking.formula.compiled import generated_module
from flocking.formula.derivatives import derivative
from flocking.formula.grammar import Formula, has_pieces
from flocking.formula.identities import MOST_ADDENDS, expanded_addends
from flocking.model.checks import Array, named_parameters, number
from flocking.model.checks import parameters as checked_parameters
from flocking.model.parts import values as fields
from flocking.model.parts.construction import given_once
from flocking.model.parts.description import Group, add_group
from flocking.model.parts.registration import register_part

if TYPE_CHECKING:
    import sympy


SEARCHED = 1e-15, 1e15, 30001
"""Range of distances in which roots are searched, and number of points: 1000 per decade."""
ROOT = 1e-15
"""Relative accuracy of a root, several units in the last place."""

TINY = float(np.finfo(float).tiny)
"""Absolute accuracy of a root, for which the relative one is to count in every unit."""

FIELD = "formula"
"""Name of the field that holds the text: a parameter of that name could be neither given by keyword nor found."""

MOST_BORDERS = 64
"""Largest number of borders of a condition, such as sin(r) < 0, which has infinitely many."""


@dataclass(frozen=True, init=False)
class Potential:
    """A pair potential psi(r) given by one formula; everything else is derived from it.

    Distances are positive: at contact a potential has the value of its formula for small ones, so that
    ``where(r > 0, a, b)`` is ``a`` everywhere.

    Parameters
    ----------
    formula
        Text in the formula grammar with the distance named ``r``, or a SymPy expression in a symbol ``r``.
    parameters
        A value for every other name of the formula, by keyword or as one mapping ``parameters``.

    Raises
    ------
    FormulaError
        If the text is not in the grammar or a name has no value.
    InvalidInput
        If a parameter is not a finite number.

    Examples
    --------
    >>> psi = Potential("1/r + 1/(R - r)", R=4)
    >>> float(psi(2.0))
    1.0
    """

    formula: Annotated[Formula, fields.formula("r")]
    parameters: Annotated[Mapping[str, float], fields.NAMED_NUMBERS] = field(default_factory=dict)

    @given_once("formula")
    def __init__(self, /, formula: str | Formula | sympy.Expr, **parameters: float | Mapping[str, float]) -> None:
        if isinstance(formula, str):
            formula = Formula(formula, "Potential")
        elif not isinstance(formula, Formula):
            from flocking.formula.symbolic import from_sympy

            formula = from_sympy(formula, "Potential")
        given = named_parameters("Potential", parameters)
        needed = formula.names - {"r"}
        if FIELD in needed:
            rule = f"must not have a parameter called {FIELD}: the text has that name"
            raise FormulaError("Potential", "formula", rule, formula.text, "Rename it.")
        if "r" in given:
            raise FormulaError("Potential", "r", "is the distance and takes no value", given["r"])
        if missing := sorted(needed - set(given)):
            raise FormulaError(
                "Potential", "formula", f"uses {missing[0]!r}, which has no value", formula.text,
                f"Give it one: Potential(..., {missing[0]}=1.0). The distance is called r.",
            )  # fmt: skip
        if unused := sorted(set(given) - needed):
            raise FormulaError("Potential", unused[0], "is not in the formula", formula.text, "Remove it or use it.")
        object.__setattr__(self, "formula", formula)
        object.__setattr__(self, "parameters", MappingProxyType(checked_parameters("Potential", given)))

    def __hash__(self) -> int:
        return hash((self.formula, tuple(self.parameters.items())))

    def __reduce__(self) -> tuple[object, ...]:
        return (_rebuild, (self.formula.text, dict(self.parameters)))

    def __repr__(self) -> str:
        # In few digits where these are the number.
        shown = ((name, f"{value:g}", value) for name, value in self.parameters.items())
        values = "".join(f", {name}={text if float(text) == value else repr(value)}" for name, text, value in shown)
        return f"Potential({self.formula.text!r}{values})"

    def with_parameters(self, **parameters: float) -> Potential:
        """The same formula with some parameters changed."""
        return Potential(self.formula, **{**self.parameters, **parameters})

    def expression(self, r: sympy.Expr, values: Mapping[str, sympy.Expr] | None = None) -> sympy.Expr:
        """SymPy form at distance ``r``; parameters are ``values``, by default their numbers."""
        import sympy

        from flocking.formula.symbolic import to_sympy

        numbers: dict[str, sympy.Expr] = {k: sympy.Rational(v) for k, v in self.parameters.items()}
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
        return str(sympy.latex(derivative(psi, r)))

    def __call__(self, r: ArrayLike) -> Array:
        """Values psi(r); shape of ``r``."""
        return self._evaluate("value", r)

    @cached_property
    def at_contact(self) -> float:
        """psi(0)."""
        return float(self(0.0))

    def slope(self, r: ArrayLike) -> Array:
        """Slopes psi'(r); shape of ``r``."""
        return self._evaluate("slope", r)

    def curvature(self, r: ArrayLike) -> Array:
        """Second derivatives psi''(r); shape of ``r``."""
        return self._evaluate("curvature", r)

    def _evaluate(self, which: str, r: ArrayLike) -> Array:
        names = tuple(self.parameters)
        module = generated_module(
            ("potential", names), self.formula.structure, (self,), lambda: _derivatives(self),
            lambda stated: _array_source(stated, names),
        )  # fmt: skip
        distances = np.asarray(r, dtype=np.float64)
        with np.errstate(all="ignore"):
            # Python floats would raise an exception where arrays give NaN or infinity.
            values = getattr(module, which)(distances, *map(np.float64, self.parameters.values()))
        found = np.asarray(values, dtype=np.float64) + np.zeros_like(distances)
        lost = np.isnan(found)
        if lost.any() and self._plain is not None:
            found = np.where(lost & ~np.isnan(distances), self._plain._evaluate(which, distances), found)
        return found

    @cached_property
    def _plain(self) -> Potential | None:
        """The same with numbers for parameters that are exponents of 0 or 1; None where there are none.

        A derivative n b**(n - 1) of such a power is 0 times infinity where its base b is zero.
        """
        names = _exponents(self.formula.tree)
        known = {
            name: ("number", value) for name, value in self.parameters.items() if name in names and value in (0.0, 1.0)
        }
        if not known:
            return None
        rest = {name: value for name, value in self.parameters.items() if name not in known}
        return Potential(self.formula.with_parts(known), parameters=rest)

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
        bump = "(1 + cos(pi*(r - fade)/(fade_end - fade)))/2"
        return self._wrap(f"where(r < fade, PSI, where(r < fade_end, {bump} * PSI, 0))", fade=inner, fade_end=outer)

    def _wrap(self, pattern: str, **new: float) -> Potential:
        """Insert the potential into a pattern: PSI is psi(r), PSI_AT_x is psi(x) with a new parameter x."""
        inner = self.formula.tree
        values, parts = dict(self.parameters), {"PSI": inner}
        for name, value in new.items():
            free = name
            while free in self.parameters:
                free += "_2"
            values[free], parts[name] = value, ("name", free)
            parts[f"PSI_AT_{name}"] = self.formula.with_parts({"r": ("name", free)}).tree
        return Potential(_pattern(pattern).with_parts(parts), parameters=values)


def _exponents(tree: object) -> frozenset[str]:
    """Names of parameters in the exponents of a formula."""
    if not isinstance(tree, tuple):
        return frozenset()
    inside = frozenset[str]().union(*map(_exponents, tree))
    return inside | _names(tree[2]) if tree[0] == "**" else inside


def _names(tree: object) -> frozenset[str]:
    if not isinstance(tree, tuple):
        return frozenset()
    return frozenset({str(tree[1])}) if tree[0] == "name" else frozenset[str]().union(*map(_names, tree))


@cache
def _pattern(text: str) -> Formula:
    return Formula(text, "Potential")


def _derived(potential: object) -> object:
    """Derive the slope, so that a formula that cannot be differentiated is rejected where it was typed."""
    return potential.at_contact if isinstance(potential, Potential) else None


add_group(Group("potential", Potential, key=None))
register_part("potential", tried=_derived)(Potential)


def _rebuild(text: str, parameters: dict[str, float]) -> Potential:
    return Potential(text, **parameters)


def piece_borders(potential: Potential) -> tuple[float, ...]:
    """Distances where pieces of the formula meet, ascending, from its conditions.

    Borders that are roots of a polynomial of degree 2 or less are exact; others are searched on
    [1e-15, 1e15], and at most `MOST_BORDERS` are kept.
    """
    if not has_pieces(potential.formula.tree):
        return ()
    names = tuple(potential.parameters)
    module = generated_module(
        ("borders", names), potential.formula.structure, (potential,), potential.symbolic,
        lambda stated: _border_source(stated, names),
    )  # fmt: skip
    return zeros_of(module, [np.float64(v) for v in potential.parameters.values()])


def zeros_of(module: ModuleType, values: list[np.float64]) -> tuple[float, ...]:
    """Positive zeros, ascending, of the expressions of a module made by `zeros_source`.

    Parameters
    ----------
    values
        Values of the parameters, in the order of the names.
    """
    with np.errstate(all="ignore"):
        found = {float(b) for b in module.exact(*values)}
        for gap in module.gaps:
            found |= set(_sign_changes(gap, values))
    return tuple(sorted(b for b in found if np.isfinite(b) and b > 0))


def _sign_changes(gap: Callable[..., Array], values: list[np.float64]) -> list[float]:
    from scipy.optimize import brentq

    grid = np.geomspace(*SEARCHED)
    signs = np.sign(gap(grid, *values) + np.zeros_like(grid))
    found = [float(r) for r in grid[signs == 0]]

    def one(r: float) -> float:
        return float(gap(np.float64(r), *values))

    for k in np.flatnonzero(signs[:-1] * signs[1:] < 0):
        if np.sign(one(grid[k])) * np.sign(one(grid[k + 1])) >= 0.0:
            continue  # so large an argument of a sine that its sign is another one than in an array
        found.append(float(brentq(one, grid[k], grid[k + 1], xtol=TINY, rtol=ROOT)))
        if len(found) >= MOST_BORDERS:
            break
    return sorted(found)[:MOST_BORDERS]


def _derivatives(potential: Potential) -> dict[str, sympy.Expr]:
    from flocking.formula.contact import defined_at_contact

    r, psi = potential.symbolic()
    stated = {"value": psi, "slope": derivative(psi, r), "curvature": derivative(psi, r, 2)}
    return {name: defined_at_contact(expression, r) for name, expression in stated.items()}


def _array_source(stated: Mapping[str, sympy.Expr], names: tuple[str, ...]) -> str:
    from flocking.formula.printing import code

    lines = ["import numpy", ""]
    for name, expression in stated.items():
        lines += [f"def {name}({', '.join(['r', *names])}):", f"    return {code(expression, arrays=True)}", ""]
    return "\n".join(lines)


def _border_source(stated: tuple[sympy.Symbol, sympy.Expr], names: tuple[str, ...]) -> str:
    import sympy

    r, psi = stated
    relations = psi.atoms(sympy.core.relational.Relational)
    return zeros_source(r, [relation.lhs - relation.rhs for relation in relations], names)


def zeros_source(r: sympy.Symbol, expressions: Iterable[sympy.Expr], names: tuple[str, ...]) -> str:
    """Source of functions whose zeros are those of expressions in ``r``: solved in closed form for simple polynomials.

    Parameters
    ----------
    names
        Names of the parameters.
    """
    import sympy

    from flocking.formula.printing import code

    exact, gaps = [], []
    for gap in expressions:
        if r not in gap.free_symbols:
            continue
        short = expanded_addends(gap) <= MOST_ADDENDS
        if short and gap.is_polynomial(r) and sympy.degree(gap, r) <= 2:
            exact += sympy.solve(gap, r)
        else:
            gaps.append(gap)
    lines = ["import numpy", "", f"def exact({', '.join(names)}):"]
    lines += [f"    return [{', '.join(sorted(code(b, arrays=True) for b in exact if not b.has(sympy.I)))}]", ""]
    for k, gap in enumerate(sorted(gaps, key=str)):
        lines += [f"def gap{k}({', '.join(['r', *names])}):", f"    return {code(gap, arrays=True)}", ""]
    lines += [f"gaps = [{', '.join(f'gap{k}' for k in range(len(gaps)))}]"]
    return "\n".join(lines) + "\n"
