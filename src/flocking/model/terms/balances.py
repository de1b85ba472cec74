"""Check of the energy balance of a term: power + rate of storage + dissipation - supply = 0 in every state.

The terms of this library are checked by its tests. A term from elsewhere is checked when its law is built: SymPy
simplifies the sum, and if it does not find zero the sum is evaluated in random states, first in double precision, and
with 40 digits if the result is inconclusive.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from flocking.errors import InvalidInput
from flocking.formula.identities import is_zero
from flocking.formula.stated_symbols import StatedSymbols
from flocking.model.checks import Array
from flocking.model.terms.state_symbols import BodyStates, PairStates, States, draw

if TYPE_CHECKING:
    import sympy

    from flocking.model.graphs.distance_graphs import Graph
    from flocking.model.terms.avoidance import ObstacleTerm
    from flocking.model.terms.body_terms import BodyTerm
    from flocking.model.terms.pair_terms import PairTerm
    from flocking.model.terms.symbols import BodySymbols, ObstacleSymbols

SUSPICIOUS, WRONG = 1e-9, 1e-10
"""Residual relative to the largest term of the sum above which it is evaluated with 40 digits, and rejected."""

DIGITS, CHECKED_STATES = 40, 40
"""Digits of the second evaluation, and approximate number of states in which it is made; limits the time."""

MOST_REMEMBERED = 256
"""Terms whose balance is stored: every law checks its own again, and the store of expressions is bounded."""

EQUAL_FACTORS = 1e-6
"""Largest relative spread of equal factors in several states; they are computed with 40 digits and rounded."""

FEWEST_STATES = 20
"""Smallest number of finite states for a check; nearly every state exposes a wrong formula."""


@dataclass(frozen=True)
class Balance:
    """The balance of one term, as expressions of the symbols of a state.

    Parameters
    ----------
    power
        Power of the force in the frame of the energy.
    storage
        Rate of the stored energy.
    dissipation, supply
        Powers dissipated and supplied.
    """

    power: sympy.Expr
    storage: sympy.Expr
    dissipation: sympy.Expr
    supply: sympy.Expr

    @property
    def parts(self) -> tuple[sympy.Expr, ...]:
        """The four terms with the signs of the sum."""
        return self.power, self.storage, self.dissipation, -self.supply


def from_library(part: object) -> bool:
    """Whether the class of a part is from this library, whose formulas are tested."""
    return type(part).__module__.split(".")[0] == "flocking"


def check_pair_term(term: PairTerm, graph: Graph) -> None:
    """Check that the storage, dissipation and supply of a pair term are those of its forces.

    Parameters
    ----------
    term
        The term.

    Raises
    ------
    InvalidInput
        If they are not; the message contains the wrong factor, if there is one.
    """
    if from_library(term):
        return
    import sympy

    states = PairStates(term, graph)
    x = states.symbols
    along, drag, stored = term.along(x), term.drag(x), term.storage(x)
    stated = {"along": along, "drag": drag, "dissipation": term.dissipation(x), "supply": term.supply(x)}
    known = StatedSymbols(term, (x.r, x.weight, x.speed2, x.radial, x.functional, *states.constants))
    for method, formula in stated.items():
        known.check(method, formula)
    _only(term, stored, {x.r}, states, "of r")
    balance = Balance(
        -along * x.radial - drag * x.speed2, sympy.diff(stored, x.r) * x.radial, stated["dissipation"], stated["supply"]
    )
    _check(type(term).__name__, balance, states)


def check_body_term(term: BodyTerm, dimension: int) -> None:
    """Check that the storage and the balance of a body term are those of its force, in the lab frame and a moving one.

    Parameters
    ----------
    term
        The term.

    Raises
    ------
    InvalidInput
        If they are not; the message contains the wrong factor, if there is one.
    """
    if from_library(term) and (term.leader is None or from_library(term.leader)):
        return
    import sympy

    from flocking.model.terms.avoidance import ObstacleTerm

    for moving in (False, True):
        states = BodyStates(term, dimension, moving)
        x = states.symbols
        stored, force, balance = term.storage(x), term.force(x), term.balance(x)
        known = StatedSymbols(term, (*states.rates, x.mass, x.damping, *states.constants))
        for vector in (x.p, x.frame_p, x.leader_q, x.leader_p, x.leader_a):
            known.add(vector)
        known.check("force", *force)
        known.check("balance", *balance)
        _only(term, stored, states.rates, states, "of positions and the time")
        rate = sum((sympy.diff(stored, s) * v for s, v in states.rates.items()), sympy.Integer(0))
        _check(type(term).__name__, Balance(_power(force, x), rate, *balance), states)
        if isinstance(term, ObstacleTerm):
            _check_obstacle_term(term, dimension, moving)


def _check_obstacle_term(term: ObstacleTerm, dimension: int, moving: bool) -> None:
    import sympy

    for anchored in (False, True):
        states = BodyStates(term, dimension, moving)
        x = states.near_obstacle(anchored)
        balance = Balance(_power(term.obstacle_force(x), x), sympy.Integer(0), *term.obstacle_balance(x))
        _check(type(term).__name__, balance, states)


def _power(force: Sequence[sympy.Expr], x: BodySymbols | ObstacleSymbols) -> sympy.Expr:
    import sympy

    return sum((f * (v - w) for f, v, w in zip(force, x.p, x.frame_p, strict=True)), sympy.Integer(0))


def _only(term: object, stored: sympy.Expr, allowed: Iterable[sympy.Expr], states: States, what: str) -> None:
    """Check that the rate of a stored energy follows from the velocities."""
    odd = sorted(str(s) for s in stored.free_symbols - set(allowed) - set(states.constants))
    if odd:
        raise InvalidInput(
            type(term).__name__, "storage", f"must be a function {what} and of parameters", odd[0],
            "Energy that depends on velocities has a rate that depends on accelerations.",
        )  # fmt: skip


def _check(owner: str, balance: Balance, states: States) -> None:
    import sympy

    symbols = tuple(sorted({s for e in balance.parts for s in e.free_symbols}, key=str))
    proven = balance.dissipation == 0 and is_zero(sum(balance.parts, sympy.Integer(0)))
    if proven:
        return
    known = frozenset((s, v) for s, v in states.constants.items() if s in symbols)
    fault = _fault(balance.parts, symbols, known, states.lengths)
    if fault is not None:
        raise InvalidInput(owner, *fault)


Fault = tuple[str, str, object, str]
"""Parameter, rule, value and fix of an error."""


@lru_cache(maxsize=MOST_REMEMBERED)
def _fault(
    parts: tuple[sympy.Expr, ...],
    symbols: tuple[sympy.Symbol, ...],
    known: frozenset[sympy.Symbol],
    lengths: tuple[float, ...],
) -> Fault | None:
    import sympy

    drawn = draw(symbols, dict(known), lengths)
    compiled = sympy.lambdify(symbols, list(parts), "numpy", cse=True)
    with np.errstate(all="ignore"):
        found = np.array([np.broadcast_to(np.asarray(v), drawn.shape[1:]) for v in compiled(*drawn)])
    found = np.where(np.isreal(found), found.real, np.nan).astype(np.float64)
    finite = np.isfinite(found).all(axis=0)
    if finite.sum() < FEWEST_STATES:
        return (
            "along" if "r" in map(str, symbols) else "force", "must have finite values in most states",
            f"{finite.sum()} of {len(finite)} random states",
            "Its energy balance cannot be checked. Check the domain of its formulas.",
        )  # fmt: skip
    drawn, found = drawn[:, finite], found[:, finite]
    scale = np.abs(found).max(axis=0)
    doubtful = np.flatnonzero(np.abs(found.sum(axis=0)) > SUSPICIOUS * scale)
    if len(doubtful) and not is_zero(sum(parts, sympy.Integer(0))):
        exact, rest = _with_digits(parts, symbols, drawn[:, doubtful[:: 1 + len(doubtful) // CHECKED_STATES]])
        off = np.abs(rest) > WRONG * np.abs(exact).max(axis=0)
        if off.any():
            return _described(exact[:, off], rest[off])
    negative = found[2] < -SUSPICIOUS * scale
    if negative.any():
        return (
            "dissipation", "must not be negative", float(found[2][negative].min()),
            "Power that is added belongs to the supply.",
        )  # fmt: skip
    return None


def _with_digits(parts: Sequence[sympy.Expr], symbols: Sequence[sympy.Symbol], states: Array) -> tuple[Array, Array]:
    """The parts in some states, shape (4, states), and their sum, both computed with 40 digits."""
    import mpmath
    import sympy

    compiled = sympy.lambdify(symbols, list(parts), "mpmath")
    columns, rest = [], []
    with mpmath.workdps(DIGITS):
        for state in states.T:
            values = [mpmath.re(v) for v in compiled(*(mpmath.mpf(float(v)) for v in state))]
            columns.append([float(v) for v in values])
            rest.append(float(mpmath.fsum(values)))
    return np.array(columns).T, np.array(rest)


def _described(parts: Array, rest: Array) -> Fault:
    """The wrong one of storage, dissipation and supply, and its factor, in states where the sum is not zero."""
    power, storage, dissipation, supply = parts * np.array([1.0, 1.0, 1.0, -1.0])[:, None]
    names = ("dissipation", "storage", "supply")
    stated = (dissipation, storage, supply)
    needed = (supply - power - storage, supply - power - dissipation, power + storage + dissipation)
    for name, given, right in zip(names, stated, needed, strict=True):
        usable = np.abs(right) > WRONG * np.abs(parts).max(axis=0)
        if usable.all() and (np.abs(given) > 0).any():
            factors = given / right
            if np.ptp(factors) <= EQUAL_FACTORS * np.abs(factors).max():
                what = "the rate of what follows" if name == "storage" else "what follows"
                return (
                    name, "must be that of the stated forces", f"{factors[0]:.6g} times {what} from them",
                    "In every state: power + rate of storage + dissipation - supply = 0.",
                )  # fmt: skip
    worst = int(np.argmax(np.abs(rest) / np.abs(parts).max(axis=0)))
    left = f"power {power[worst]:.6g} + rate of storage {storage[worst]:.6g} + dissipation {dissipation[worst]:.6g}"
    return (
        "balance", "must add up to zero in every state",
        f"{left} - supply {supply[worst]:.6g} = {rest[worst]:.6g}",
        "Define storage and dissipation by the forces, and the rest as supply.",
    )  # fmt: skip
