"""The formulas of a law, collected from its parts, from which every kernel is printed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from flocking.engine.kernels.displacements import Periods
from flocking.engine.kernels.layout import BODIES, DAMPING, MASS, Layout
from flocking.engine.kernels.obstacle_formulas import ObstacleFormulas, obstacle_formulas
from flocking.engine.kernels.stated_motions import StatedMotion, check_columns
from flocking.errors import InvalidInput
from flocking.formula.contact import defined_at_contact
from flocking.formula.derivatives import derivative
from flocking.formula.identities import nothing_or_itself
from flocking.formula.stated_symbols import StatedSymbols
from flocking.model.bodies.body import Body, MotionSymbols
from flocking.model.leaders_and_obstacles.leaders import Leader
from flocking.model.terms.body_terms import Compensate
from flocking.model.terms.fading_potentials import Fade
from flocking.model.terms.symbols import BodySymbols, PairSymbols

if TYPE_CHECKING:
    import sympy

    from flocking.model.terms.pair_terms import PairTerm


@dataclass(frozen=True)
class PairFormulas:
    """Sum of all pair terms over one graph, per ordered pair.

    ``flow`` is the supply of first-order agents, whose velocity is their control.

    Parameters
    ----------
    along
        Coefficient of n_ij.
    drag
        Coefficient of p_j - p_i.
    storage, dissipation, supply
        Energy stored by, power dissipated by and power supplied to an ordered pair.
    directed
        Whether the graph has pairs (i, j) without (j, i).
    """

    along: sympy.Expr
    drag: sympy.Expr
    storage: sympy.Expr
    dissipation: sympy.Expr
    supply: sympy.Expr
    flow: sympy.Expr
    directed: bool

    def named(self) -> dict[str, sympy.Expr]:
        """The formulas by name."""
        return {name: getattr(self, name) for name in ("along", "drag", "storage", "dissipation", "supply")}


@dataclass(frozen=True)
class MotionFormulas:
    """How the columns of an agent change under the force ``u0...`` of the law.

    Parameters
    ----------
    columns
        Names of the columns and how many numbers each has, in the order of the state vector: ``q``, ``p`` for agents of
        order 2, then the body's own.
    lets
        What is computed once for the rates, in order.
    rates
        Rate of every number, ``rate_q0`` and so on.
    kinetic
        Kinetic energy, in terms of ``w0...``, the velocity relative to the frame of the energy.
    departure
        Power that a body of order 2 adds to that of the desired force and the damping.
    departs
        Whether the point on which the law acts may move otherwise than an ideal body under the desired force.
    limits
        Where each limit begins and ends to act, ``begins_0``, ``ends_0`` and so on, in the order of `Body.limits`.
    """

    columns: tuple[tuple[str, int], ...]
    lets: dict[str, sympy.Expr]
    rates: dict[str, sympy.Expr]
    kinetic: sympy.Expr
    departure: sympy.Expr
    departs: bool
    limits: dict[str, sympy.Expr]


@dataclass(frozen=True)
class BodyFormulas:
    """Sum of all body terms, per agent.

    ``flow`` is the supply of first-order agents, in terms of their velocity ``u0...`` and its mean ``mean_u0...``.

    Parameters
    ----------
    force
        One formula for each axis.
    storage, dissipation, supply
        Energy stored by, power dissipated by and power supplied to an agent.
    motion
        How the columns of the agent change under the force.
    """

    force: tuple[sympy.Expr, ...]
    storage: sympy.Expr
    dissipation: sympy.Expr
    supply: sympy.Expr
    frame: tuple[sympy.Expr, ...]
    flow: sympy.Expr
    motion: MotionFormulas

    def named(self) -> dict[str, sympy.Expr]:
        """The formulas by name."""
        forces = {f"force{k}": f for k, f in enumerate(self.force)}
        return {**forces, "storage": self.storage, "dissipation": self.dissipation, "supply": self.supply}


@dataclass(frozen=True)
class LawFormulas:
    """All formulas of a law and its energy in ``dimension`` dimensions.

    Parameters
    ----------
    pairs
        One entry for each graph of the law.
    body
        Formulas of one agent by itself.
    obstacles
        One entry for each group of obstacles.
    periods
        Lengths after which axes repeat, one entry for each axis.
    """

    dimension: int
    pairs: tuple[PairFormulas, ...]
    body: BodyFormulas
    obstacles: tuple[ObstacleFormulas, ...]
    periods: Periods


def _symbol(name: str) -> sympy.Symbol:
    import sympy

    return sympy.Symbol(name, real=True)


def _vector(name: str, dimension: int) -> list[sympy.Symbol]:
    return [_symbol(f"{name}{k}") for k in range(dimension)]


def law_formulas(layout: Layout, dimension: int, *, integrals: bool = True) -> LawFormulas:
    """Collect the formulas of a law from its parts.

    Symbols: ``r``, ``speed2``, ``radial``, ``functional``, ``push`` and ``pull`` of a pair; ``q0...``, ``p0...``,
    ``t``, ``mean_q0...``, ``mean_p0...`` of an agent; the slots of `Layout` for parameters.

    Parameters
    ----------
    integrals
        Whether energies that are integrals are stored; else what they exceed a closed form by counts as supplied.
    """
    body = _body_formulas(layout, dimension)
    leaders = (None, *layout.leaders())
    motions = {layout.leader_number(x): _leader_motion(layout, x, dimension) for x in leaders}
    obstacles = obstacle_formulas(layout, dimension, body.frame, motions)
    periods = tuple(None if slot is None else _symbol(slot) for slot in layout.period_slots(dimension))
    return LawFormulas(dimension, tuple(_pair_formulas(layout, integrals)), body, obstacles, periods)


def _parameters(layout: Layout, owner: str) -> Callable[[str], sympy.Expr]:
    return lambda name: _symbol(layout.slot(owner, name))


def _asked(known: StatedSymbols, layout: Layout, owner: str) -> Callable[[str], sympy.Expr]:
    """Gives the parameters of a part, whose symbols it may then use."""
    return known.asked("x.parameter", _parameters(layout, owner), lambda: [n for o, n in layout.slots if o == owner])


def _fade(layout: Layout, term: PairTerm) -> Fade | None:
    fall = layout.falls.get(layout.fall_owner(term))
    if fall is None:
        return None
    symbols = [_parameters(layout, layout.fall_owner(term))(name) for name in fall.parameters]
    return Fade(symbols[0], symbols[1], tuple(symbols[2:]))


def _pair_formulas(layout: Layout, integrals: bool) -> list[PairFormulas]:
    import sympy

    r = sympy.Symbol("r", positive=True)
    names = ("along", "drag", "storage", "dissipation", "supply")
    found = []
    for number, graph in enumerate(layout.law.graphs):
        symbols = StatedSymbols(graph, [r])
        weight = graph.weight(r, _asked(symbols, layout, f"graph{number}"))
        symbols.check("weight", weight)
        terms = [t for t in layout.law.pair_terms if layout.law.graph_number(t) == number]
        paired = not graph.directed and all("momentum" in t.symmetries for t in terms)
        total: dict[str, sympy.Expr] = dict.fromkeys((*names, "flow"), sympy.Integer(0))
        for term in terms:
            given = r, weight, _symbol("speed2"), _symbol("radial"), _symbol("functional")
            known, fade = StatedSymbols(term, given), _fade(layout, term) if integrals else None
            x = PairSymbols(*given, _asked(known, layout, layout.term_owner(term)), fade)
            stated = {name: sympy.sympify(getattr(term, name)(x)) for name in names}
            for name, value in stated.items():
                known.check(name, value)
            if not paired:
                stated["supply"] += _unpaired_power(stated["along"], stated["drag"])
            for name, value in {**stated, "flow": _flow(stated, x, paired)}.items():
                total[name] += value
        defined = {name: defined_at_contact(value, r) for name, value in total.items()}
        found.append(PairFormulas(**defined, directed=graph.directed))
    return found


def _unpaired_power(along: sympy.Expr, drag: sympy.Expr) -> sympy.Expr:
    """Power of pair forces beyond that of opposite pairs, which the terms state: it is supplied.

    Counted as two per undirected link, like the others. The agent's own velocity relative to the frame enters
    (``push``, ``pull``). Summed over both orders of a pair with equal coefficients it vanishes.
    """
    return along * (2 * _symbol("push") + _symbol("radial")) + drag * (2 * _symbol("pull") + _symbol("speed2"))


def _flow(stated: dict[str, sympy.Expr], x: PairSymbols, paired: bool) -> sympy.Expr:
    """Supply of first-order agents, dq/dt = u: what the storage gains beyond -|u|^2, the rate of a gradient flow."""
    # Forces of first-order agents have no velocities in them; ``radial`` and ``push`` are here those of the motion.
    along = stated["along"].subs({_symbol("radial"): 0, _symbol("speed2"): 0})
    # The slope of an integral is the force, which differentiating its series would not show.
    slope = along if x.fade is not None else derivative(stated["storage"], x.r)
    rate = slope * _symbol("radial")
    if paired:
        return nothing_or_itself(rate - along * _symbol("radial"))
    return 2 * along * _symbol("push") + rate


def _leader_motion(
    layout: Layout, leader: Leader | None, dimension: int
) -> tuple[Sequence[sympy.Expr], Sequence[sympy.Expr], Sequence[sympy.Expr]]:
    import sympy

    if leader is None:
        zero = [sympy.Integer(0)] * dimension
        return zero, zero, zero
    t, owner = _symbol("t"), f"leader{layout.leader_number(leader)}"
    known, given = StatedSymbols(leader, [t]), _parameters(layout, owner)
    parameter = _asked(known, layout, owner)
    place, velocity = leader.position(t, parameter), leader.velocity(t, parameter)
    acceleration = leader.acceleration(t, parameter)
    known.check("position", *(place or ()))
    known.check("velocity", *velocity)
    known.check("acceleration", *acceleration)
    return place if place is not None else [given(f"place_{k}") for k in range(dimension)], velocity, acceleration


def _body_formulas(layout: Layout, dimension: int) -> BodyFormulas:
    import sympy

    energy = layout.energy
    q, p = _vector("q", dimension), _vector("p", dimension)
    mean_p = _vector("mean_p", dimension)
    mass, damping = _symbol(MASS), _symbol(DAMPING)
    frame_place, frame_velocity, frame_acceleration = _leader_motion(layout, energy.leader, dimension)
    origin = {"lab": None, "leader": frame_place, "centre of mass": _vector("mean_q", dimension)}[energy.frame]
    frame: Sequence[sympy.Expr] = mean_p if energy.frame == "centre of mass" else frame_velocity
    force: list[sympy.Expr] = [sympy.Integer(0)] * dimension
    storage = sympy.Integer(0)
    relative = [a - b for a, b in zip(p, frame, strict=True)]
    damped: sympy.Expr = sum((damping * v * w for v, w in zip(p, relative, strict=True)), sympy.Integer(0))
    # Damping that the law compensates is no dissipation of the theorem's: the two cancel within the supply.
    compensated = any(isinstance(t, Compensate) for t in layout.law.body_terms)
    dissipation: sympy.Expr = sympy.Integer(0) if compensated else damped
    # A frame that accelerates adds an inertial force; in the centre of mass it cancels over the group.
    supply: sympy.Expr = -mass * sum(
        (a * w for a, w in zip(frame_acceleration, relative, strict=True)), sympy.Integer(0)
    )
    supply -= damped if compensated else sympy.Integer(0)
    gaps: list[sympy.Expr] = [sympy.Integer(0)] * dimension
    for term in layout.law.body_terms:
        place, velocity, acceleration = _leader_motion(layout, term.leader, dimension)
        means = _vector("mean_q", dimension), mean_p
        known = StatedSymbols(term, [_symbol("t"), mass, damping])
        for vector in (q, p, *means, origin or (), frame, place, velocity, acceleration):
            known.add(vector)
        x = BodySymbols(
            q, p, _symbol("t"), mass, damping, *means, origin, frame, place, velocity, acceleration,
            _asked(known, layout, layout.term_owner(term)),
        )  # fmt: skip
        pushed, stored = list(term.force(x)), sympy.sympify(term.storage(x))
        force = [a + b for a, b in zip(force, pushed, strict=True)]
        storage += stored
        # A term that descends its own storage leaves nothing for the ledger of first-order agents.
        gaps = [g + nothing_or_itself(f + sympy.diff(stored, c)) for g, f, c in zip(gaps, pushed, q, strict=True)]
        dissipated, supplied = term.balance(x)
        known.check("force", *pushed)
        known.check("storage", stored)
        known.check("balance", dissipated, supplied)
        dissipation += dissipated
        supply += supplied
    passing = sympy.diff(storage, _symbol("t"))
    for leader in layout.leaders():
        if not leader.closed_form:
            place, velocity, _ = _leader_motion(layout, leader, dimension)
            passing += sum((sympy.diff(storage, x) * v for x, v in zip(place, velocity, strict=True)), sympy.Integer(0))
    # The centre of mass of first-order agents moves with the mean of their controls.
    for axis, rate in zip(_vector("mean_q", dimension), _vector("mean_u", dimension), strict=True):
        passing += sympy.diff(storage, axis) * rate
    flow = passing + sum((g * u for g, u in zip(gaps, _vector("u", dimension), strict=True)), sympy.Integer(0))
    motion = motion_formulas(layout, dimension)
    return BodyFormulas(tuple(force), storage, dissipation, supply, tuple(frame), flow, motion)


def _each(body: Body, name: str, rates: object) -> list[sympy.Expr]:
    """The rates of a column, one for each of its numbers."""
    import sympy

    if not isinstance(rates, list | tuple | sympy.MatrixBase):
        rule = f"must give a list of rates for the column {name!r}, one for each of its numbers"
        raise InvalidInput(type(body).__name__, "rates", rule, rates)
    return [sympy.sympify(rate) for rate in rates]


def motion_formulas(layout: Layout, dimension: int) -> MotionFormulas:
    """How the columns of the agents of a layout change.

    Raises
    ------
    InvalidInput
        When the body states a rate for a column it does not have, or none for one it has, or is not what its properties
        state, see `flocking.engine.kernels.stated_motions`.
    """
    import sympy

    body, zero = layout.bodies, sympy.Integer(0)
    second = body.order == 2
    q, p, u, w = (_vector(name, dimension) for name in "qpuw")
    own = tuple(body.widths(dimension).items())
    rows = layout.held_rows(dimension)
    numbers = _symbol("t"), _symbol(MASS), _symbol(DAMPING)
    further = {name: _vector(f"column_{name}_", size) for name, size in own}
    known = StatedSymbols(body, numbers)
    for vector in (q, p, u, w, *further.values()):
        known.add(vector)
    x = MotionSymbols(
        q, p if second else [zero] * dimension, u, *numbers, further, _asked(known, layout, BODIES),
        lambda name: _symbol(f"let_{name}"),
        known.asked("x.held", lambda name: _symbol(f"A{rows[name]}"), lambda: rows),
    )  # fmt: skip
    lets = {f"let_{name}": sympy.sympify(e) for name, e in body.lets(x).items()}
    for name, e in lets.items():
        known.check("lets", e)
        known.add([_symbol(name)])
    stated = {name: _each(body, name, rates) for name, rates in body.rates(x).items()}
    known.check("rates", *(rate for rates in stated.values() for rate in rates))
    check_columns(body, stated, p)
    moving = {"q": p, **stated} if second else stated
    columns = (("q", dimension), *((("p", dimension),) if second else ()), *own)
    found = {name: len(rates) for name, rates in moving.items()}
    if found != dict(columns):
        raise InvalidInput(type(body).__name__, "rates", f"must be those of {dict(columns)}", str(found))
    departs = not second and any(rate - desired != 0 for rate, desired in zip(moving["q"], u, strict=True))
    kinetic, departure = sympy.sympify(body.kinetic(x, w)), zero
    known.check("kinetic", kinetic)
    if second:
        rates = moving["p"]
        slopes, desired = [sympy.diff(kinetic, a) for a in w], [a - x.damping * b for a, b in zip(u, p, strict=True)]
        # Written so that it is exactly zero where a rate is exactly the desired one.
        departure = sum((s * (r - f / x.mass) for s, r, f in zip(slopes, rates, desired, strict=True)), zero)
        departure += sum((f * (s / x.mass - c) for s, f, c in zip(slopes, desired, w, strict=True)), zero)
        for name, e in reversed(lets.items()):
            departure = departure.xreplace({_symbol(name): e})
        departure = nothing_or_itself(departure)
        departs = departure != 0
    limits: dict[str, sympy.Expr] = {}
    for k, limit in enumerate(body.limits(x).values()):
        limits |= {f"begins_{k}": sympy.sympify(limit.begins), f"ends_{k}": sympy.sympify(limit.ends)}
    known.check("limits", *limits.values())
    if known.checked:
        symbols = {_symbol(name): e for name, e in lets.items()}
        StatedMotion(layout, x, w, symbols, moving, kinetic, list(limits.values())).check()
    named = {f"rate_{name}{k}": rate for name, _ in columns for k, rate in enumerate(moving[name])}
    return MotionFormulas(columns, lets, named, kinetic, departure, departs, limits)
