"""The formulas of a law for agents of order 1, whose velocity is their control and which know no velocities."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from flocking.engine.kernels.expressions import BodyFormulas, LawFormulas, PairFormulas

if TYPE_CHECKING:
    import sympy

    from flocking.engine.kernels.obstacle_formulas import ObstacleFormulas

OF_PAIRS = ("speed2", "radial", "push", "pull")
"""Symbols of a pair that are zero without velocities."""


def flow_formulas(formulas: LawFormulas) -> LawFormulas:
    """The formulas of a law with zero for every velocity in them.

    Dissipation and supply of second order are gone: a gradient flow dissipates |u|^2, and what else changes the storage
    is ``flow``, in which the symbols of velocities are those of the motion, ``u0``... and their mean ``mean_u0``... .

    Parameters
    ----------
    formulas
        Those that the parts of the law state.
    """
    m = formulas.dimension
    still = _zeros([f"{name}{k}" for name in ("p", "mean_p") for k in range(m)])
    zero = _zero()
    pairs = tuple(_pair(pair, still | _zeros(OF_PAIRS), zero) for pair in formulas.pairs)
    body = formulas.body
    resting = BodyFormulas(
        tuple(f.xreplace(still) for f in body.force), body.storage.xreplace(still), zero, zero,
        tuple(f.xreplace(still) for f in body.frame), body.flow.xreplace(still), body.motion,
    )  # fmt: skip
    obstacles = tuple(_obstacle(e, still, zero) for e in formulas.obstacles)
    return LawFormulas(m, pairs, resting, obstacles, formulas.periods)


def _zero() -> sympy.Expr:
    import sympy

    return sympy.Integer(0)


def _zeros(names: list[str] | tuple[str, ...]) -> dict[sympy.Basic, sympy.Basic]:
    import sympy

    return {sympy.Symbol(name, real=True): sympy.Integer(0) for name in names}


def _pair(pair: PairFormulas, still: dict[sympy.Basic, sympy.Basic], zero: sympy.Expr) -> PairFormulas:
    # The symbols of pairs in ``flow`` are differences and projections of controls already.
    return PairFormulas(
        pair.along.xreplace(still), zero, pair.storage.xreplace(still), zero, zero, pair.flow, pair.directed
    )


def _obstacle(formulas: ObstacleFormulas, still: dict[sympy.Basic, sympy.Basic], zero: sympy.Expr) -> ObstacleFormulas:
    geometry = tuple({name: e.xreplace(still) for name, e in stage.items()} for stage in formulas.geometry)
    force = tuple(f.xreplace(still) for f in formulas.force)
    return replace(formulas, geometry=geometry, force=force, dissipation=zero, supply=zero)
