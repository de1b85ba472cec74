"""Checks of what bodies outside this library state: the rates must be those that their properties promise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from flocking.engine.kernels.layout import BODIES, DAMPING, MASS, Layout
from flocking.errors import InvalidInput
from flocking.formula.identities import nothing_or_itself
from flocking.model.bodies.body import Body, MotionSymbols
from flocking.model.bodies.mixtures import KIND, Mixture

if TYPE_CHECKING:
    import sympy

Formulas = Mapping[str, Sequence["sympy.Expr"]]
"""Formulas of columns by their name, one for each number."""


def check_columns(body: Body, rates: Formulas, p: Sequence[sympy.Expr]) -> None:
    """Refuse columns that are declared twice, and velocities that are not the rate of the position.

    Parameters
    ----------
    body
        The body.
    rates
        The rates that it states.
    p
        Symbols of the velocity.

    Raises
    ------
    InvalidInput
        When a column is declared twice, or a body of order 2 moves otherwise than with its velocity.
    """
    owner, names = type(body).__name__, [column.name for column in body.columns]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise InvalidInput(owner, "columns", "must be declared once each", ", ".join(twice))
    if body.order not in (1, 2):
        raise InvalidInput(owner, "order", "must be 1 or 2", body.order)
    if body.order == 2 and any(nothing_or_itself(a - b) != 0 for a, b in zip(rates.get("q", ()), p, strict=False)):
        raise InvalidInput(
            owner, "rates", "must not give 'q' another rate than p, which is the velocity of bodies of order 2",
            ", ".join(map(str, rates["q"])),
            "Leave q out; let p be the velocity, or declare a column for what drives the agent.",
        )  # fmt: skip


class StatedMotion:
    """The motion that a body states, with its numbers put in where all agents have the same.

    Parameters
    ----------
    layout
        Slots of its numbers.
    x
        What it uses about an agent.
    w
        Symbols of the velocity relative to the frame of the energy.
    lets
        Its shared expressions by symbol, in order.
    rates
        Rates of its columns.
    kinetic
        Its kinetic energy.
    others
        Further expressions on which its motion rests: where limits begin and end.
    """

    def __init__(
        self, layout: Layout, x: MotionSymbols, w: Sequence[sympy.Expr], lets: Mapping[sympy.Symbol, sympy.Expr],
        rates: Formulas, kinetic: sympy.Expr, others: Sequence[sympy.Expr],
    ) -> None:  # fmt: skip
        self._body, self._x, self._w, self._lets, self._energy = layout.bodies, x, w, lets, layout.energy
        self._numbers = _common_numbers(layout, x)
        self._rates = {name: [self._put(rate) for rate in column] for name, column in rates.items()}
        self._kinetic, self._others = self._put(kinetic), [self._put(one) for one in others]

    def _put(self, expression: sympy.Expr) -> sympy.Expr:
        """The expression without lets, and with the numbers that all agents share."""
        for symbol, value in reversed(tuple(self._lets.items())):
            expression = expression.xreplace({symbol: value})
        return expression.xreplace(self._numbers)

    def check(self) -> None:
        """Check the kinetic energy, and that rates are as `Body.homogeneous`, `Body.inert` and `Body.ideal` state.

        Raises
        ------
        InvalidInput
            When they are not; the message names the property.
        """
        body, x, owner = self._body, self._x, type(self._body).__name__
        every = [rate for name, column in self._rates.items() if (body.order, name) != (2, "q") for rate in column]
        used = set().union(*(e.free_symbols for e in (*every, self._kinetic, *self._others)))
        moving = {*x.q, *x.p, *x.u, x.t, *(s for column in x.columns.values() for s in column)}
        if strange := self._kinetic.free_symbols & moving:
            raise InvalidInput(
                owner, "kinetic", "must depend on the relative velocity and on numbers of the body alone",
                _names(strange),
                "Leave energies of place, time and columns out: what they take up or give counts as departed.",
            )  # fmt: skip
        if body.order == 1 and self._kinetic != 0:
            raise InvalidInput(
                owner, "kinetic", "must be 0 for bodies of order 1, whose velocity is their input", str(self._kinetic)
            )
        self._check_frame()
        if body.homogeneous and (places := used & {*x.q, x.t}):
            raise InvalidInput(
                owner, "homogeneous", "must not be stated where rates depend on place or time", _names(places),
                "Leave it out: engines would move the origin.",
            )  # fmt: skip
        if body.inert and (body.order == 1 or (used & {*x.p})):
            raise InvalidInput(
                owner, "inert", "must not be stated where rates depend on the velocity, nor for bodies of order 1",
                _names(used & {*x.p}) if body.order == 2 else "order 1",
            )  # fmt: skip
        if body.ideal and (what := self._not_ideal()):
            raise InvalidInput(
                owner, "summary",
                f"must state in words what agents do where {what} not those of points under the force of the law",
                repr(body.summary), "State a few words, or leave the summary of Body as it is.",
            )  # fmt: skip

    def _check_frame(self) -> None:
        """Refuse a kinetic energy of its own in a frame whose acceleration the ledger counts as that of points."""
        import sympy

        energy, frame = self._point_energy, self._energy.frame
        if frame == "lab" or nothing_or_itself(self._kinetic - energy) == 0:
            return
        if self._energy.leader is not None:
            leader = self._energy.leader.acceleration(self._x.t, lambda name: sympy.Symbol(name, real=True))
            steady = all(part == 0 for part in leader)
        else:
            steady = not sympy.simplify(self._kinetic / energy).free_symbols
        if not steady:
            raise InvalidInput(
                type(self._body).__name__, "kinetic",
                "must be that of points, m |w|^2/2, where the frame of the energy accelerates",
                str(self._kinetic), "Give the scenario an energy in the frame of the laboratory.",
            )  # fmt: skip

    @property
    def _point_energy(self) -> sympy.Expr:
        """Kinetic energy of an ideal body."""
        mass = self._put(self._x.mass)
        zero = 0 * mass
        return zero if self._body.order == 1 else mass * sum((w**2 for w in self._w), zero) / 2

    def _not_ideal(self) -> str:
        """What differs from an ideal body, in words; empty where nothing does."""
        x, body = self._x, self._body
        mass, damping = (self._put(value) for value in (x.mass, x.damping))
        zero = 0 * mass
        if body.order == 1:
            point, moved = "q", list(x.u)
        else:
            point, moved = "p", [(u - damping * p) / mass for u, p in zip(x.u, x.p, strict=True)]
        kinds: list[dict[sympy.Expr, sympy.Expr]] = [{}]
        if isinstance(body, Mixture):
            kinds = [{x.parameter(KIND): zero + k} for k in range(len(body.bodies))]
        for kind in kinds:
            rates = [rate.xreplace(kind) for rate in self._rates[point]]
            if any(nothing_or_itself(a - b) != 0 for a, b in zip(rates, moved, strict=True)):
                return "rates are"
            if nothing_or_itself(self._kinetic.xreplace(kind) - self._point_energy) != 0:
                return "kinetic energies are"
        return ""


def _common_numbers(layout: Layout, x: MotionSymbols) -> dict[sympy.Expr, sympy.Expr]:
    """Exact values of masses, damping and parameters that all agents share, by symbol."""
    import sympy

    body = layout.bodies
    values = {MASS: body.masses, DAMPING: body.damping}
    values |= {layout.slot(BODIES, name): value for name, value in body.parameters.items()}
    found: dict[sympy.Expr, sympy.Expr] = {}
    for slot, value in values.items():
        each = np.unique(np.asarray(value, dtype=np.float64))
        if each.size == 1 and np.isfinite(each[0]):
            found[sympy.Symbol(slot, real=True)] = sympy.Rational(float(each[0]))
    kind = x.parameter(KIND) if isinstance(body, Mixture) else None
    return {symbol: value for symbol, value in found.items() if symbol != kind}


def _names(symbols: set[sympy.Basic]) -> str:
    return ", ".join(sorted(map(str, symbols)))
