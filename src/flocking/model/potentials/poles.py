"""Distances at which a potential is infinite, found from its formula."""

from __future__ import annotations

import itertools
import re
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from flocking.formula.compiled import generated_module
from flocking.model.potentials.potential import Potential, zeros_of, zeros_source

if TYPE_CHECKING:
    import sympy

NEAR, NEARER = 1e-6, 1e-11
"""Relative distances below a point at which the slope is evaluated."""
STEEPER = 1e4
"""Smallest growth of the slope between the two at a pole; for a logarithm it is 1e5."""
SAMPLES, FAR = 402, 4.0
"""Number of distances between two borders of pieces, and largest distance relative to the last border."""

MOST_REMEMBERED = 1024
"""Potentials whose properties are stored: sweeps change numbers of one for each run, and the store is bounded."""

MAY_END = re.compile(r"sqrt\(|log\(|\*\*\s*(?!-?\d+(?![\d./])|\(-?\d+\))")
"""What may have no real value: roots, logarithms, and powers unless their exponent is a whole number."""


@lru_cache(maxsize=MOST_REMEMBERED)
def poles(potential: Potential) -> tuple[float, ...]:
    """Positive distances r0 with psi(r) unbounded as r -> r0 from below, ascending.

    They are zeros of denominators and of arguments of logarithms: exact for polynomials of degree 2 or less, others
    are searched on [1e-15, 1e15].
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


@lru_cache(maxsize=MOST_REMEMBERED)
def sides(potential: Potential, pole: float) -> tuple[str, str]:
    """Behaviour of the potential below and above a pole: ``"rises"``, ``"falls"`` or ``"ends"``.

    It ends if it has no finite value.

    Parameters
    ----------
    pole
        One of its `poles`.
    """
    found = []
    for sign in (-1.0, 1.0):
        far, near = (float(potential(pole * (1 + sign * gap))) for gap in (NEAR, NEARER))
        known = np.isfinite(far) and not np.isnan(near)
        found.append("ends" if not known else "falls" if near < far else "rises")
    return found[0], found[1]


@lru_cache(maxsize=MOST_REMEMBERED)
def acts_only_beyond(potential: Potential, radius: float) -> float | None:
    """Smallest distance at which a potential has a slope, if it has none below ``radius``; else None.

    A formula without pieces has a slope somewhere below any radius, or none at all.
    """
    kinks = potential.kinks()
    if not kinks or (potential.slope(radius * np.linspace(0.0, 1.0, SAMPLES)[1:-1]) != 0).any():
        return None
    borders = np.array([radius, *(x for x in kinks if x > radius), FAR * max(radius, kinks[-1])])
    if any((potential.slope(x * np.array([1 - NEAR, 1 + NEAR])) != 0).any() for x in kinks if x < radius * (1 - NEAR)):
        return None
    for low, high in itertools.pairwise(borders):
        if (potential.slope(np.linspace(low, high, SAMPLES)[1:-1]) != 0).any():
            return float(low)
    return None


@lru_cache(maxsize=MOST_REMEMBERED)
def without_value(potential: Potential, radius: float) -> float | None:
    """A distance below ``radius`` from which on a potential has no real value or slope; None if none was found.

    Values are looked for at `SAMPLES` distances, and only in formulas with a part that may have none.
    """
    if not MAY_END.search(potential.formula.structure):
        return None
    r = radius * np.linspace(0.0, 1.0, SAMPLES)[1:-1]
    lost = np.isnan(potential(r)) | np.isnan(potential.slope(r))
    # Two in a row: a single one may be a quotient of zeros.
    both = lost[:-1] & lost[1:]
    return float(r[both.argmax()]) if both.any() else None


def _diverges(potential: Potential, at: float) -> bool:
    far, near = (abs(float(potential.slope(at * (1 - gap)))) for gap in (NEAR, NEARER))
    if np.isnan(far) or np.isnan(near):
        return False
    return near == np.inf or near > STEEPER * far


def _source(stated: tuple[sympy.Symbol, sympy.Expr], names: tuple[str, ...]) -> str:
    import sympy

    r, psi = stated
    below: set[object] = {p.base for p in psi.atoms(sympy.Pow) if p.exp.is_number and p.exp.is_negative}
    below |= {f.args[0] for f in psi.atoms(sympy.log)} | {sympy.cos(f.args[0]) for f in psi.atoms(sympy.tan)}
    return zeros_source(r, below, names)
