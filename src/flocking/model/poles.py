"""Distances at which a potential is infinite, read from its formula."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from flocking.formula.compiled import generated_module
from flocking.model.potentials import Potential, zeros_of, zeros_source

if TYPE_CHECKING:
    import sympy

NEAR, NEARER = 1e-6, 1e-11
"""How far below a distance, as a fraction of it, the slope is looked at."""
STEEPER = 1e4
"""By how much the slope grows from the one to the other at a pole; a logarithm's grows by 1e5."""


def poles(potential: Potential) -> tuple[float, ...]:
    """Positive distances r0 with psi(r) unbounded as r -> r0 from below, ascending.

    They are zeros of denominators and of arguments of logarithms: exact for polynomials of degree 2 or less, others
    are searched on [1e-6, 1e6].
    """
    structure = potential.formula.structure
    if not any(sign in structure for sign in ("/", "**", "log(", "tan(")):
        return ()
    names = tuple(potential.parameters)
    module = generated_module(
        ("poles", names), structure, (potential,), potential.symbolic, lambda stated: _source(stated, names)
    )
    found = zeros_of(module, [np.float64(v) for v in potential.parameters.values()])
    return tuple(r for r in found if _diverges(potential, r))


def _diverges(potential: Potential, at: float) -> bool:
    far, near = (abs(float(potential.slope(at * (1 - gap)))) for gap in (NEAR, NEARER))
    if np.isnan(far) or np.isnan(near):
        return False
    return near == np.inf or near > STEEPER * far


def _source(stated: tuple[sympy.Symbol, sympy.Expr], names: tuple[str, ...]) -> str:
    import sympy

    r, psi = stated
    below: set[Any] = {p.base for p in psi.atoms(sympy.Pow) if p.exp.is_number and p.exp.is_negative}
    below |= {f.args[0] for f in psi.atoms(sympy.log)} | {sympy.cos(f.args[0]) for f in psi.atoms(sympy.tan)}
    return zeros_source(r, below, names)
