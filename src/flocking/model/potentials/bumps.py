"""Bump functions rho(z): 1 up to an onset, 0 from 1 on, smooth and decreasing between (Olfati-Saber (16))."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np
from numpy.typing import ArrayLike

from flocking.errors import InvalidInput
from flocking.formula.compiled import generated_module
from flocking.formula.derivatives import derivative
from flocking.formula.grammar import Formula
from flocking.model.checks import Array, number, one_of, text
from flocking.model.parts import values
from flocking.model.parts.description import Group, Short, add_group
from flocking.model.parts.registration import register_part

if TYPE_CHECKING:
    import sympy


GRID, REFINED = 2001, 1e-12
"""Number of grid points for the steepest slope, and accuracy of its refinement."""


@dataclass(frozen=True)
class Bump:
    """A bump function rho(z; k0), one formula in ``z`` and ``k0``; its slope is derived.

    Parameters
    ----------
    name
        Its name.
    formula
        Text in the formula grammar with the names ``z`` and ``k0``.

    Raises
    ------
    FormulaError
        If the text is not in the grammar.
    InvalidInput
        If it contains another name than ``z`` and ``k0``.
    """

    name: str
    formula: Annotated[Formula, values.formula("z", "k0")]

    if TYPE_CHECKING:  # A string is accepted.

        def __init__(self, name: str, formula: str | Formula) -> None: ...

    def __post_init__(self) -> None:
        text("Bump", "name", self.name)
        checked = self.formula if isinstance(self.formula, Formula) else Formula(self.formula, "Bump")
        if checked.names != {"z", "k0"}:
            raise InvalidInput("Bump", "formula", "must use exactly the names z and k0", checked.text)
        object.__setattr__(self, "formula", checked)

    @property
    def structure(self) -> str:
        """The formula in canonical form."""
        return self.formula.structure

    def expression(self, z: sympy.Expr, k0: sympy.Expr) -> sympy.Expr:
        """SymPy form at ``z`` with onset ``k0``."""
        from flocking.formula.symbolic import to_sympy

        return to_sympy(self.formula, {"z": z, "k0": k0})

    def __call__(self, z: ArrayLike, k0: float) -> Array:
        """Values rho(z; k0); shape of ``z``."""
        return self._evaluate("value", z, k0)

    def slope(self, z: ArrayLike, k0: float) -> Array:
        """Slopes rho'(z; k0); shape of ``z``."""
        return self._evaluate("slope", z, k0)

    def steepest(self, k0: float) -> float:
        """L_rho, the largest |rho'(z; k0)| (Olfati-Saber, after (36)); found on a grid and refined."""
        from scipy.optimize import minimize_scalar

        onset = number("Bump", "k0", k0, least=0.0, below=1.0)
        grid = np.linspace(onset, 1.0, GRID)
        slopes = np.abs(self.slope(grid, onset))
        best = int(np.argmax(slopes))
        low, high = grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)]
        found = minimize_scalar(
            lambda z: -abs(float(self.slope(z, onset))),
            bounds=(low, high),
            method="bounded",
            options={"xatol": REFINED},
        )
        return max(float(slopes[best]), -float(found.fun))

    def _evaluate(self, which: str, z: ArrayLike, k0: float) -> Array:
        module = generated_module("bump", self.structure, (self,), lambda: _derivatives(self), _array_source)
        points = np.asarray(z, dtype=np.float64)
        with np.errstate(all="ignore"):
            values = getattr(module, which)(points, float(k0))
        return np.asarray(values, dtype=np.float64) + np.zeros_like(points)


def _derivatives(bump: Bump) -> dict[str, sympy.Expr]:
    import sympy

    z, k0 = sympy.Symbol("z", real=True), sympy.Symbol("k0", real=True)
    rho = bump.expression(z, k0)
    return {"value": rho, "slope": derivative(rho, z)}


def _array_source(stated: Mapping[str, sympy.Expr]) -> str:
    from flocking.formula.printing import code

    lines = ["import numpy", ""]
    for name, expression in stated.items():
        lines += [f"def {name}(z, k0):", f"    return {code(expression, arrays=True)}", ""]
    return "\n".join(lines)


BUMPS = {
    "cosine": Bump("cosine", "where(z <= k0, 1, where(z < 1, (1 + cos(pi*(z - k0)/(1 - k0)))/2, 0))"),
    "quintic": Bump(
        "quintic",
        "where(z <= k0, 1, where(z < 1,"
        " ((1 - z)/(1 - k0))**3*(1 + 3*(z - k0)/(1 - k0) + 6*((z - k0)/(1 - k0))**2), 0))",
    ),
    "infinite": Bump(
        "infinite",
        "where(z <= k0, 1, where(z < 1, (1 - tanh(((1 - k0)/(1 - z) - (1 - k0)/(z - k0))/2))/2, 0))",
    ),
}
"""Bumps by name: ``cosine`` has one continuous derivative, ``quintic`` two, ``infinite`` all."""


add_group(Group("bump", Bump, default="bump", short=Short(values.choice(*BUMPS), str, (str,))))
register_part("bump")(Bump)


def bump_named(owner: str, bump: str | Bump) -> Bump:
    """The bump of that name, or the bump itself.

    Raises
    ------
    InvalidInput
        If there is no bump of that name.
    """
    if isinstance(bump, Bump):
        return bump
    one_of(owner, "bump", bump, BUMPS, f"must be one of {', '.join(BUMPS)} or a Bump")
    return BUMPS[bump]
