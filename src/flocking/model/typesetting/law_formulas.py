"""A law and its parts as LaTeX, derived from the formulas that kernels are derived from."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from flocking.errors import FlockingError
from flocking.model.bodies.body import Body, MotionSymbols
from flocking.model.checks import Array
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.leaders_and_obstacles.leaders import Leader
from flocking.model.parts.registration import description_of
from flocking.model.potentials.potential import Potential
from flocking.model.terms.avoidance import ObstacleTerm
from flocking.model.terms.body_terms import BodyTerm
from flocking.model.terms.pair_terms import AVERAGE, PairTerm, Term
from flocking.model.terms.symbols import BodySymbols, ObstacleSymbols, PairSymbols
from flocking.model.typesetting.stated import StatedLaw
from flocking.model.typesetting.symbols import (
    Names,
    by_name,
    named_function,
    numbered,
    parameter_latex,
    value_of_vectors,
    with_stand_ins,
)

if TYPE_CHECKING:
    import sympy

    Components = Mapping[str, Sequence[sympy.Expr]]

UNPRINTABLE = (FlockingError, IndexError, KeyError, TypeError, ValueError, AttributeError, NotImplementedError)
"""Errors of parts whose formulas have no form for one axis, or need more than is known here."""

DRAWS = 5
"""Random vectors at which a vector form is compared with the components that it stands for."""

AGREEMENT = 1e-9
"""Relative difference of the two by rounding."""


@dataclass(frozen=True)
class TermFormula:
    """One term as LaTeX.

    Parameters
    ----------
    term
        The term.
    latex
        Its contribution to u_i; its name where its formula has no printable form.
    exact
        Whether it is its formula.
    potentials
        The potentials in it, by their names in LaTeX.
    numbers
        Numbers of its parameters among different ones of a name in the law, where they are not the first.
    """

    term: Term
    latex: str
    exact: bool
    potentials: dict[str, Potential]
    numbers: Mapping[str, int] = field(default_factory=dict)


def law_latex(law: StatedLaw, dimension: int = 2) -> str:
    """The control u_i of a law, one term a line.

    Parameters
    ----------
    law
        The law.
    dimension
        Number of axes.
    """
    lines = []
    for k, each in enumerate(term_formulas(law, dimension)):
        minus = each.latex.startswith("-")
        sign = "" if k == 0 else "-" if minus else "+"
        lines.append(f"{sign}{each.latex[1:].lstrip() if k and minus else each.latex}")
    rows = r" \\ & \quad ".join(lines)
    return rf"\begin{{aligned}} u_i = & {rows} \end{{aligned}}"


def term_formulas(law: StatedLaw, dimension: int = 2) -> list[TermFormula]:
    """Every term of a law as LaTeX.

    Parameters
    ----------
    law
        The law.
    dimension
        Number of axes.
    """
    every = zip(law.terms, numbers_of(law.terms), strict=True)
    return [_term(term, law, dimension, numbers) for term, numbers in every]


def numbers_of(terms: Sequence[Term]) -> list[dict[str, int]]:
    """Of each term the numbers of what it has among different values of one name, where it is not the first.

    Parameters
    ----------
    terms
        Terms of a law.
    """
    known: dict[str, list[object]] = {}
    found = []
    for term in terms:
        kind = description_of(term)
        fields = {} if kind is None else {x.name: getattr(term, x.attribute, None) for x in kind.fields.values()}
        named = {name: x for name, x in fields.items() if isinstance(x, Potential | Leader) or name == "bump"}
        # Numbers of a potential stand in no formula of a term.
        plain = not any(isinstance(x, Potential) for x in fields.values())
        named |= {name: fields.get(name, x) for name, x in term.parameters.items() if plain or name in fields}
        numbers: dict[str, int] = {}
        for name, value in named.items():
            values = known.setdefault(name, [])
            place = next((k for k, other in enumerate(values) if _same(value, other)), len(values))
            values += [value] * (place == len(values))
            numbers |= {name: place + 1} if place else {}
        found.append(numbers)
    return found


def _same(a: object, b: object) -> bool:
    if a is b:
        return True
    if isinstance(a, Leader) and isinstance(b, Leader):
        return type(a) is type(b) and a.structure == b.structure and a.parameters == b.parameters
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        return np.array_equal(a, b)
    return type(a) is type(b) and bool(a == b)


def _term(term: Term, law: StatedLaw, dimension: int, numbers: Mapping[str, int]) -> TermFormula:
    try:
        shown, potentials = by_name(term, numbers)
    except UNPRINTABLE:
        shown, potentials = term, {}
    latex: str | None = None
    try:
        if isinstance(shown, PairTerm):
            number = law.graph_number(term) if isinstance(term, PairTerm) else 0
            latex = _pair(shown, number, _is_weighted(term, law), numbers)
        elif isinstance(shown, ObstacleTerm):
            latex = _near_obstacles(shown, dimension, numbers)
        elif isinstance(shown, BodyTerm):
            latex = _of_body(shown, dimension, numbers)
    except UNPRINTABLE:
        latex = None
    exact = latex is not None
    return TermFormula(
        term, latex or rf"\mathrm{{{type(term).__name__}}}_i", exact, potentials if exact else {}, numbers
    )


def _is_weighted(term: Term, law: StatedLaw) -> bool:
    import sympy

    graph = getattr(term, "over", None) or law.graph
    r = sympy.Symbol("r", positive=True)
    return bool(graph.weight(r, Names().parameter(graph.parameters)) != 1)


def neighbours_latex(number: int) -> str:
    """Set of the neighbours of agent i in the graph of this number."""
    return "N_i" if number == 0 else rf"N_i^{{({number + 1})}}"


def _pair(term: PairTerm, number: int, weighted: bool, numbers: Mapping[str, int]) -> str:
    import sympy

    names = Names(numbers)
    r = names.scalar("r_{ij}")
    weight = named_function(numbered("a", number + 1))(r) if weighted else sympy.Integer(1)
    average = getattr(term, "functional", False) == AVERAGE
    count = rf"\frac{{1}}{{1 + \left|{neighbours_latex(number)}\right|}}"
    functional = names.scalar(count if average else numbered("s_i", number + 1))
    symbols = PairSymbols(
        r, weight, names.scalar(r"\left\|p_j - p_i\right\|^2"), names.scalar(r"\dot{r}_{ij}"), functional,
        names.parameter(term.parameters),
    )  # fmt: skip
    along, drag = term.along(symbols), term.drag(symbols)
    parts = []
    for coefficient, direction in ((along, r"\mathbf{n}_{ij}"), (drag, r"\left(p_j - p_i\right)")):
        if coefficient == 0:
            continue
        text = names.print(coefficient)
        if isinstance(coefficient, sympy.Add):
            text = rf"\left[{text}\right]"
        parts.append(direction if coefficient == 1 else rf"{text}\,{direction}")
    inside = " + ".join(parts) or "0"
    if len(parts) > 1:
        inside = rf"\left[{inside}\right]"
    return rf"\sum_{{j \in {neighbours_latex(number)}}} {inside}"


def _of_body(term: BodyTerm, dimension: int, numbers: Mapping[str, int]) -> str:
    names = Names(numbers)
    vector = names.vector
    parameter = names.parameter(term.parameters)
    latex = {
        "q": "q_i", "p": "p_i", "mean_q": r"\bar{q}", "mean_p": r"\bar{p}", "frame_q": "q_f", "frame_p": "p_f",
        **_leader_latex(numbers),
    }  # fmt: skip
    scalars = {"t": names.scalar("t"), "mass": names.scalar("m_i"), "damping": names.scalar("k_i")}
    vectors = {name: vector(text) for name, text in latex.items()}

    def force(values: Components) -> Sequence[sympy.Expr]:
        return term.force(BodySymbols(**values, **scalars, parameter=parameter))

    return _vector_form(force, vectors, names, dimension)


def _leader_latex(numbers: Mapping[str, int]) -> dict[str, str]:
    """Place, velocity and acceleration of the leader of a term."""
    shown = {"leader_q": "x_0", "leader_p": "v_0", "leader_a": r"\dot{v}_0"}
    return {name: numbered(latex, numbers.get("leader", 1)) for name, latex in shown.items()}


def _near_obstacles(term: ObstacleTerm, dimension: int, numbers: Mapping[str, int]) -> str:
    import sympy

    names = Names(numbers)
    parameter = names.parameter(term.parameters)
    latex = {
        "q": "q_i", "p": "p_i", "normal": r"\mathbf{n}_{ik}", "boundary": r"\hat{p}_{ik}", "anchor": "b_k",
        "frame_p": "p_f", **_leader_latex(numbers),
    }  # fmt: skip
    scalars = {"t": names.scalar("t"), "mass": names.scalar("m_i"), "distance": names.scalar("d_{ik}")}
    vectors = {name: names.vector(text) for name, text in latex.items()}
    centres = {x.anchor(sympy.Symbol("t", real=True), sympy.Symbol) is not None for x in term.obstacles}

    def force(anchored: bool) -> Callable[[Components], Sequence[sympy.Expr]]:
        def stated(values: Components) -> Sequence[sympy.Expr]:
            anchor = values["anchor"] if anchored else None
            given = {name: value for name, value in values.items() if name != "anchor"}
            return term.obstacle_force(ObstacleSymbols(**given, anchor=anchor, **scalars, parameter=parameter))

        return stated

    shown = {_vector_form(force(each), vectors, names, dimension) for each in centres or {False}}
    if len(shown) > 1:
        raise ValueError("obstacles with a centre act otherwise than those without")
    reach = parameter_latex("range", number=numbers.get("range", 1))
    return rf"\sum_{{k:\, d_{{ik}} \le {reach}}} \left[{shown.pop()}\right]"


def _vector_form(
    force: Callable[[Components], Sequence[sympy.Expr]],
    vectors: dict[str, sympy.Symbol],
    names: Names,
    dimension: int,
) -> str:
    """A force as one formula of vectors, which is compared with its components at random vectors."""
    import sympy

    one = force({name: [symbol] for name, symbol in vectors.items()})[0]
    one = sympy.sympify(one)
    axes: Components = {name: [sympy.Symbol(f"{name}_{k}", real=True) for k in range(dimension)] for name in vectors}
    many = [sympy.sympify(x) for x in force(axes)]
    rng = np.random.default_rng(0)
    others = [s for s in names.latex if s not in names.vectors]
    for _ in range(DRAWS):
        drawn = {name: rng.normal(size=dimension) for name in vectors}
        numbers = {s: np.array(np.exp(rng.normal())) for s in others}
        single = numbers | {symbol: drawn[name] for name, symbol in vectors.items()}
        flat = numbers | {axes[name][k]: drawn[name][k] for name in vectors for k in range(dimension)}
        computed = np.broadcast_to(value_of_vectors(one, single, names), (dimension,))
        meant = np.array([_number(x, flat) for x in many])
        if not np.allclose(computed, meant, rtol=AGREEMENT, atol=AGREEMENT):
            raise ValueError("the components are not those of a vector formula")
    return names.print(one)


def _number(expression: sympy.Expr, numbers: Mapping[sympy.Symbol, Array]) -> float:
    """Value of one component."""
    return float(with_stand_ins(expression).evalf(subs={s: float(numbers[s]) for s in expression.free_symbols}))


def weight_latex(graph: Graph, number: int = 0) -> str:
    """Weight a(r) of a link of a graph, of that ``number`` in its law, from 0; empty where it is 1."""
    import sympy

    names = Names()
    r = names.scalar("r")
    try:
        weight = graph.weight(r, names.parameter(graph.parameters))
        name = numbered("a", number + 1)
        return "" if weight == 1 else f"{name}(r) = {names.print(sympy.piecewise_fold(weight))}"
    except UNPRINTABLE:
        return ""


def motion_latex(body: Body) -> list[str]:
    """Rates of change of an agent; empty where they have no form for one axis.

    Parameters
    ----------
    body
        What the agents are.
    """
    names = Names()
    try:
        columns = {c.name: [names.vector(rf"\mathrm{{{c.name}}}_i")] for c in body.columns if c.width is None}
        parameter = names.parameter(body.parameters)
        symbols = MotionSymbols(
            [names.vector("q_i")], [names.vector("p_i")], [names.vector("u_i")], names.scalar("t"),
            _constant(names, body.masses, "m", 1.0), _constant(names, body.damping, "k", 0.0), columns, parameter,
            lambda name: names.scalar(parameter_latex(name)), lambda name: names.scalar(parameter_latex(name)),
        )  # fmt: skip
        if body.discrete or body.limits(symbols) or body.lets(symbols) or body.held(1):
            return []
        rates = body.rates(symbols)
        shown = [r"\dot{q}_i = p_i"] if body.order > 1 else []
        for name, rate in rates.items():
            left = rf"\dot{{{name}}}_i" if len(name) == 1 else rf"\dot{{\mathrm{{{name}}}}}_i"
            shown.append(f"{left} = {names.print(rate[0])}")
        return shown
    except UNPRINTABLE:
        return []


def _constant(names: Names, value: ArrayLike, letter: str, usual: float) -> sympy.Expr:
    import sympy

    if np.ndim(value) == 0 and value == usual:
        return sympy.Float(usual) if usual != round(usual) else sympy.Integer(int(usual))
    return names.scalar(f"{letter}_i")


__all__ = ["TermFormula", "law_latex", "motion_latex", "neighbours_latex", "term_formulas", "weight_latex"]
