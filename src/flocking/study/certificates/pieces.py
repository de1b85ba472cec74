"""Formulas of one's own: whether their pieces meet, decided exactly, and whether a weight is known."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from flocking.arrays import Array
from flocking.errors import FormulaError
from flocking.formula.grammar import LARGEST_EXPONENT
from flocking.formula.identities import MOST_ADDENDS, expanded_addends
from flocking.formula.interval_values import enclosed
from flocking.formula.intervals import Interval
from flocking.model.graphs.all_pairs import Complete
from flocking.model.graphs.distance_graphs import Fixed, Graph, Hysteresis, Proximity
from flocking.model.graphs.smooth_graphs import Smooth
from flocking.model.terms.pair_terms import Consensus, PairTerm

if TYPE_CHECKING:
    import sympy

    from flocking.model.leaders_and_obstacles.leaders import Leader

NEAREST, FARTHEST = 1e-100, 1e100
"""Distances of the first division from an end at zero, and from any number to an infinite end."""

BOXES, PARTS, ROUNDS = 256, 16, 11
"""Intervals of the first division of a range, parts of each that is looked at again, and rounds: 16^11 is 2^44."""

MOST_BOXES = 4096
"""Intervals that a round looks at most at again; more of them mean a denominator that vanishes on a range."""

MOST_QUOTIENTS = 12
"""Quotients that are joined at most: the numerator has the product of all the other denominators."""

LEADER_ERROR = 1e-11
"""Bound of the relative error of a leader's position by quadrature, which has 12 digits."""

LARGEST_ROOT = 4
"""Largest denominator of an exponent whose power is one of a root: sums of exponents have products of them."""

KNOWN_GRAPHS = (Complete, Fixed, Proximity, Hysteresis, Smooth)
"""Graphs whose weights are known: 1, or a bump of the library between 0 and 1."""


def has_known_weight(graph: Graph) -> bool:
    """Whether the weight of the links of a ``graph`` is known, see `KNOWN_GRAPHS`."""
    return type(graph) in KNOWN_GRAPHS and isinstance(getattr(graph, "bump", ""), str)


def unknown_weight(term: PairTerm, graph: Graph) -> Graph | None:
    """The graph whose weight multiplies a velocity consensus and may be anything; None where there is none.

    Parameters
    ----------
    term
        The term.
    graph
        Graph of the law.
    """
    if not isinstance(term, Consensus) or not term.weighted:
        return None
    over = term.over or graph
    return None if has_known_weight(over) else over


def jump(
    expression: sympy.Expr, r: sympy.Symbol, first: float = 0.0, last: float = np.inf, *, with_ends: bool = False
) -> str:
    """Where a formula may jump, in a few words; empty where it is continuous between two numbers.

    Pieces may begin and end at numbers that are compared with r; their values there must be equal, exactly. No
    denominator may vanish, of a tangent neither: on the two sides of its zero a quotient may have different limits, as
    abs(r - 1)/(r - 1) has.

    Parameters
    ----------
    expression
        The formula; all its numbers are known.
    r
        Its variable.
    first, last
        The numbers.
    with_ends
        Whether the values at the numbers themselves are looked at: a piece that begins at one of them may leave it out.
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
    for place, before, after in _meetings(expression, r, places, (first, last), with_ends):
        difference = before.subs(r, place) - after.subs(r, place)
        if difference != 0 and sympy.simplify(difference) != 0:
            return f"it is not known to be continuous at {float(place):.6g}"
    for denominator in _denominators(expression):
        place = vanishing(denominator, r, first, last)
        if place is not None:
            return f"a denominator, {denominator}, may vanish near {place:.6g}"
    return ""


def _meetings(
    expression: sympy.Expr, r: sympy.Symbol, places: set[sympy.Expr], ends: tuple[float, float], with_ends: bool
) -> list[tuple[sympy.Expr, sympy.Expr, sympy.Expr]]:
    """Places at which pieces meet, with the formula below and above each; at the ends it is that of the end itself."""
    if not places:
        return []
    inside = sorted((p for p in places if ends[0] < float(p) < ends[1]), key=lambda p: float(p))
    branches = [_at(expression, r, _between(low, high)) for low, high in pairwise([ends[0], *inside, ends[1]])]
    found = list(zip(inside, branches, branches[1:], strict=False))
    if with_ends:
        found += [(p, _at(expression, r, p), branches[0]) for p in places if float(p) == ends[0]]
        found += [(p, branches[-1], _at(expression, r, p)) for p in places if float(p) == ends[1]]
    return found


def inside(expression: sympy.Expr, r: sympy.Symbol, last: float) -> sympy.Expr:
    """The formula that holds between zero and a number: without pieces that begin at that number or beyond.

    A pair that is linked has the energy of its formula below the radius, whatever that is at the radius itself.

    Parameters
    ----------
    expression
        The formula; all its numbers are known.
    r
        Its variable.
    last
        The number.
    """
    import sympy

    found = {}
    for relation in expression.atoms(sympy.core.relational.Relational):
        place = _place(relation, r)
        if place is not None and float(place) >= last:
            # It has one truth value on that side.
            found[relation] = relation.subs(r, sympy.Rational(last) / 2)
    return expression.xreplace(found)


def leader_jump(leader: Leader, first: float, last: float) -> str:
    """Where the velocity of a leader may jump between two times or at one of them: its acceleration does not show it.

    What it is at the start itself, and no longer after it, would count as its velocity there. See `jump`.

    Parameters
    ----------
    leader
        The leader.
    first, last
        The times.
    """
    import sympy

    t = sympy.Symbol("t", real=True)
    numbers = {name: sympy.Rational(value) for name, value in leader.parameters.items()}
    velocity = leader.velocity(t, lambda name: numbers[name])
    found = (jump(sympy.sympify(v), t, first, last, with_ends=True) for v in velocity)
    return next((text for text in found if text), "")


def leader_at(leader: Leader, time: float) -> tuple[Interval, Interval]:
    """Position and velocity of a leader at a time, enclosed, shape (m,) each.

    Formulas are evaluated on intervals. A position without a closed form is computed by quadrature, to 12 digits.

    Parameters
    ----------
    leader, time
        The leader and the time.
    """
    import sympy

    t = sympy.Symbol("t", real=True)
    numbers = {name: sympy.Rational(value) for name, value in leader.parameters.items()}
    stated = [leader.position(t, lambda name: numbers[name]), leader.velocity(t, lambda name: numbers[name])]
    found = []
    for computed, formulas in zip(leader.at(time), stated, strict=False):
        try:
            if formulas is None:
                raise FormulaError("leader", "position", "has no closed form", str(leader))
            parts = [enclosed(sympy.sympify(each), t, Interval.of(time)) for each in formulas]
            found.append(Interval(np.array([float(x.lo) for x in parts]), np.array([float(x.hi) for x in parts])))
        except FormulaError:
            slack = LEADER_ERROR * (1.0 + np.abs(computed))
            found.append(Interval(computed - slack, computed + slack))
    return found[0], found[1]


def _between(low: sympy.Expr | float, high: sympy.Expr | float) -> sympy.Expr:
    """A number between two, of which one may be infinite."""
    import sympy

    below, above = (
        sympy.Rational(x) if isinstance(x, float) and np.isfinite(x) else sympy.sympify(x) for x in (low, high)
    )
    if below.is_infinite or above.is_infinite:
        return above - 1 if below.is_infinite else below + 1
    return (below + above) / 2


def _denominators(expression: sympy.Expr) -> list[sympy.Expr]:
    """What a formula divides by; the cosine of what it takes the tangent of."""
    import sympy

    powers = [e.base for e in expression.atoms(sympy.Pow) if not e.exp.is_nonnegative]
    return [*powers, *(sympy.cos(e.args[0]) for e in expression.atoms(sympy.tan))]


def vanishing(expression: sympy.Expr, r: sympy.Symbol, first: float, last: float) -> float | None:
    """A number between two near which a formula may be zero; None where it is proven to be zero nowhere between them.

    Parameters
    ----------
    expression
        The formula; all its numbers are known.
    r
        Its variable.
    first, last
        The numbers; the formula may vanish at either.
    """
    if expression.is_positive or (expression == r and first >= 0.0):
        return None
    edges = _division(first, last)
    boxes = Interval(edges[:-1], edges[1:])
    for _ in range(ROUNDS):
        found = enclosed(expression, r, boxes)
        near = ~((found.lo > 0.0) | (found.hi < 0.0))
        if not near.any():
            return None
        low, high = boxes.lo[near], boxes.hi[near]
        if len(low) > MOST_BOXES:
            break
        shares = np.linspace(0.0, 1.0, PARTS + 1)
        inside = np.where(np.isfinite(high), high, np.maximum(2.0 * np.abs(low), 1.0))
        places = low[:, None] + (inside - low)[:, None] * shares
        places[:, -1] = high
        boxes = Interval(places[:, :-1].ravel(), places[:, 1:].ravel())
    return float(low[0])


def _division(first: float, last: float) -> Array:
    """Edges of a first division of the numbers between two; an end is left out by one unit of rounding."""
    low, high = float(np.nextafter(first, np.inf)), float(np.nextafter(last, -np.inf))
    if first == 0.0:
        low = NEAREST
    top = high if np.isfinite(last) else FARTHEST
    even = np.linspace(low, top if np.isfinite(last) else low + 1.0, BOXES + 1)
    spread = np.geomspace(max(abs(low), NEAREST), top, BOXES) if low >= 0.0 and top > low else np.empty(0)
    edges = np.unique(np.concatenate([[low], even, spread[(spread > low) & (spread < top)], [top]]))
    return np.asarray(edges if np.isfinite(last) else np.append(edges, np.inf))


def _place(relation: sympy.Basic, r: sympy.Symbol) -> sympy.Expr | None:
    """The number that a relation compares r with; None for another relation."""
    import sympy

    left, right = relation.args
    difference = sympy.sympify(left - right)
    if not difference.is_polynomial(r) or difference.free_symbols != {r}:
        return None
    polynomial = sympy.Poly(difference, r)
    place = -polynomial.coeff_monomial(1) / polynomial.LC() if polynomial.degree() == 1 else None
    return place if place is not None and place.is_real and place.is_finite else None


def _at(expression: sympy.Expr, r: sympy.Symbol, place: sympy.Expr) -> sympy.Expr:
    """The formula without pieces that holds at a place; about it, too, where none begins or ends there."""
    import sympy

    def chosen(*branches: sympy.Tuple) -> sympy.Expr:
        for value, condition in branches:
            if condition.subs(r, place) == sympy.true:
                return value
        return sympy.nan

    # Inner pieces are replaced first.
    return expression.replace(lambda e: isinstance(e, sympy.Piecewise), lambda e: chosen(*e.args))


def factored(expression: sympy.Expr) -> sympy.Expr:
    """The same formula as a product, piece by piece: its sign is then easier to enclose; itself where it is long.

    Parameters
    ----------
    expression
        The formula.
    """
    import sympy

    if isinstance(expression, sympy.Piecewise):
        return sympy.Piecewise(*((factored(value), condition) for value, condition in expression.args))
    quotients = [p for p in expression.atoms(sympy.Pow) if p.exp.could_extract_minus_sign()]
    if expanded_addends(expression) > MOST_ADDENDS or len(quotients) > MOST_QUOTIENTS:
        return expression
    # exp(-p r/q) would be the p-th power of a generator, with a p of sixteen digits where it is that of a double.
    masks = {e: sympy.Dummy() for e in expression.atoms(sympy.exp, sympy.Pow) if not _is_short_power(e)}
    product = sympy.factor(sympy.together(expression.xreplace(masks)))
    return product.xreplace({mask: e for e, mask in masks.items()})


def _is_short_power(expression: sympy.Expr) -> bool:
    """Whether an exponential or power is a polynomial, or quotient of such, of small degree in a root of its base."""
    import sympy

    base, exponent = expression.as_base_exp()
    small = exponent.is_Rational and abs(exponent.p) <= LARGEST_EXPONENT and exponent.q <= LARGEST_ROOT
    return bool(small and base != sympy.E)
