"""The motion of a leader as source of Python functions."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from flocking.arrays import Array

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


def motions(
    function: Callable[..., Sequence[Sequence[float]]], times: Array, numbers: Sequence[float], dimension: int
) -> Array:
    """Positions, velocities and accelerations at many times, shape (K, 3, m); NaN where they have no real value.

    Parameters
    ----------
    function
        Gives the three of one time, see `leader_source`.
    times
        The times, shape (K,).
    numbers
        Parameters of the leader.
    dimension
        Number of axes m.
    """
    none, found = [[math.nan] * dimension] * 3, []
    for t in times.tolist():
        try:
            found.append(function(t, *numbers))
        except (ValueError, ArithmeticError, TypeError):
            found.append(none)
    try:
        return np.array(found, dtype=np.float64).reshape(-1, 3, dimension)
    except TypeError:  # The square root of a negative number is complex.
        if len(found) == 1:
            return np.array([none])
        return np.concatenate([motions(function, times[k : k + 1], numbers, dimension) for k in range(len(times))])


def _branches(velocity: sympy.Expr) -> list[sympy.Expr]:
    """A component of the velocity on each of its pieces; NaN if there are too many."""
    import sympy

    if velocity.count(sympy.Piecewise) > MOST_BRANCHES.bit_length():
        return [sympy.nan]
    folded = sympy.piecewise_fold(velocity)
    pieces = [value for value, _ in folded.args] if isinstance(folded, sympy.Piecewise) else [folded]
    return pieces if len(pieces) <= MOST_BRANCHES and not any(p.has(sympy.Piecewise) for p in pieces) else [sympy.nan]
