"""Formulas made of pieces: whether they are continuous, decided exactly."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import sympy


def jump(expression: sympy.Expr, r: sympy.Symbol) -> str:
    """Where a formula may jump, in a few words; empty where it is continuous for every r > 0 at which it is finite.

    Pieces may begin and end at numbers that are compared with r; their values there must be equal, exactly.

    Parameters
    ----------
    expression
        The formula; all its numbers are known.
    r
        Its variable, positive.
    """
    import sympy

    if expression.has(sympy.sign, sympy.Heaviside, sympy.floor, sympy.ceiling, sympy.Mod):
        return "it has a function that jumps"
    places: set[sympy.Expr] = set()
    for piecewise in expression.atoms(sympy.Piecewise):
        for _, condition in piecewise.args:
            for relation in condition.atoms(sympy.core.relational.Relational):
                place = _place(relation, r)
                if place is None:
                    return f"the condition {relation} does not compare r with a number"
                places.add(place)
    ordered = sorted((p for p in places if p.is_positive), key=lambda p: float(p))
    edges = [sympy.Integer(0), *ordered]
    middles = [*((a + b) / 2 for a, b in pairwise(edges)), edges[-1] + 1]
    parts = pairwise([_at(expression, r, middle) for middle in middles])
    for place, (before, after) in zip(ordered, parts, strict=True):
        difference = before.subs(r, place) - after.subs(r, place)
        if difference != 0 and sympy.simplify(difference) != 0:
            return f"it is not known to be continuous at {float(place):.6g}"
    return ""


def _place(relation: sympy.Basic, r: sympy.Symbol) -> sympy.Expr | None:
    """The number that a relation compares r with; None for another relation."""
    left, right = relation.args
    for variable, number in ((left, right), (right, left)):
        if variable == r and not number.free_symbols and number.is_real and number.is_finite:
            return number
    return None


def _at(expression: sympy.Expr, r: sympy.Symbol, place: sympy.Expr) -> sympy.Expr:
    """The formula without pieces that holds about a place at which none begins or ends."""
    import sympy

    def chosen(*branches: sympy.Tuple) -> sympy.Expr:
        for value, condition in branches:
            if condition.subs(r, place) == sympy.true:
                return value
        return sympy.nan

    # Inner pieces are replaced first.
    return expression.replace(lambda e: isinstance(e, sympy.Piecewise), lambda e: chosen(*e.args))


def factored(expression: sympy.Expr) -> sympy.Expr:
    """The same formula as a product, piece by piece: its sign is then easier to enclose.

    Parameters
    ----------
    expression
        The formula.
    """
    import sympy

    if isinstance(expression, sympy.Piecewise):
        return sympy.Piecewise(*((factored(value), condition) for value, condition in expression.args))
    return sympy.factor(sympy.together(expression))
