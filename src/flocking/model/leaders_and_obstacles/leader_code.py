"""The motion of a leader as source of Python functions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import sympy

MOST_BRANCHES = 64
"""Largest number of branches of a piecewise velocity that are bounded separately; beyond it there is no bound."""


def leader_source(
    stated: tuple[Sequence[sympy.Expr] | None, Sequence[sympy.Expr], Sequence[sympy.Expr]], names: tuple[str, ...]
) -> str:
    """Source of the motion of a leader, and of its velocity on each piece.

    Parameters
    ----------
    stated
        Position, or None if no closed form is known, velocity and acceleration.
    names
        Names of its parameters.
    """
    from flocking.formula.printing import code

    def written(values: Sequence[sympy.Expr]) -> str:
        return "[" + ", ".join(code(v, arrays=False) for v in values) + "]"

    q, p, a = stated
    place = written(q) if q is not None else f"[math.nan] * {len(p)}"
    return (
        f"import math\n\nCLOSED = {q is not None}\n\n\ndef leader(t, {', '.join(names)}):\n"
        f"    return {place}, {written(p)}, {written(a)}\n\n\n"
        f"def branches(t, {', '.join(names)}):\n    return [{', '.join(written(_branches(v)) for v in p)}]\n"
    )


def _branches(velocity: sympy.Expr) -> list[sympy.Expr]:
    """A component of the velocity on each of its pieces; NaN if there are too many."""
    import sympy

    if velocity.count(sympy.Piecewise) > MOST_BRANCHES.bit_length():
        return [sympy.nan]
    folded = sympy.piecewise_fold(velocity)
    pieces = [value for value, _ in folded.args] if isinstance(folded, sympy.Piecewise) else [folded]
    return pieces if len(pieces) <= MOST_BRANCHES and not any(p.has(sympy.Piecewise) for p in pieces) else [sympy.nan]
