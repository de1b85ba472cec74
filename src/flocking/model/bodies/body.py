"""The declaration of a body: named columns, their rates, and the input that a desired force becomes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import Array, array, axes_of, check_each, scalar_or_each
from flocking.model.parts.description import Group, add_group

if TYPE_CHECKING:
    import sympy

    from flocking.model.world.control import Control

MOTION = ("q", "p")
"""Columns that hold the point on which a law acts: its position, and its velocity where a body has one."""

MOVES_ON = 2
"""Order of bodies that keep a velocity without a force; those of order 1 rest then."""

LIMIT_ROUNDS = 4
"""Rounds in which limits may change at one instant: one that acts may make another one begin or end."""


@dataclass(frozen=True)
class Column:
    """A named quantity that every agent has beside position and velocity, and that changes with time.

    Parameters
    ----------
    name
        Its name, an identifier of Python.
    width
        How many numbers it has; None for one for each axis of space.

    Raises
    ------
    InvalidInput
        When the name is no identifier or that of a position or velocity, or the width is not positive.
    """

    name: str
    width: int | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name.isidentifier() or self.name in MOTION:
            raise InvalidInput("Column", "name", "must be an identifier other than q and p", self.name)
        if self.width is not None and (
            isinstance(self.width, bool) or not isinstance(self.width, int) or self.width < 1
        ):
            raise InvalidInput("Column", "width", "must be a positive integer, or None", self.width)

    def size(self, dimension: int) -> int:
        """How many numbers an agent has in ``dimension`` dimensions."""
        return dimension if self.width is None else self.width


@dataclass(frozen=True)
class Limit:
    """When something in a body begins and ceases to act on an agent.

    A number of the agent, see `Body.held`, is 0 before it acts and 1 while it does.

    Parameters
    ----------
    begins
        Expression that is positive where it acts on an agent on which it did not act.
    ends
        Expression that is positive where it does not act any more.
    """

    begins: sympy.Expr
    ends: sympy.Expr


@dataclass(frozen=True)
class MotionSymbols:
    """What a body may use about agent i.

    Parameters
    ----------
    q, p
        Position and velocity, m expressions each; velocities of bodies without that column are zero.
    u
        Force of the law, m expressions.
    mass, damping
        m_i and k_i.
    columns
        Expressions of each further column, by name.
    parameter
        Symbol of one of the body's own parameters, by name.
    let
        Symbol of one of the expressions of `Body.lets`, by name.
    held
        Symbol of one of the numbers of `Body.held`, by name.
    """

    q: Sequence[sympy.Expr]
    p: Sequence[sympy.Expr]
    u: Sequence[sympy.Expr]
    t: sympy.Expr
    mass: sympy.Expr
    damping: sympy.Expr
    columns: Mapping[str, Sequence[sympy.Expr]]
    parameter: Callable[[str], sympy.Expr]
    let: Callable[[str], sympy.Expr]
    held: Callable[[str], sympy.Expr]


class Body(ABC):
    """What an agent is: which numbers describe it and how they change under the force of its law.

    A body has a position ``q``, the point on which the law acts. One of order 2 has a velocity ``p`` beside it,
    with ``q' = p``; one of order 1 has none, and the law takes it as zero. Further columns are those of `columns`.
    A subclass is a frozen dataclass that states `order` and `rates`, and what else is not as here. Its fields may be
    numbers or one number for each agent; those that formulas need are its `parameters`.
    """

    masses: float | Array = 1.0
    """One mass for all, or one for each agent: the weight of an agent in means, and that of terms which use it."""
    damping: float | Array = 0.0
    """Velocity damping gains k_i, one for all or one for each agent."""
    headings: Array | None = None
    """Directions that do not change, for graphs that use them."""
    discrete: bool = False
    """Whether velocities are set at ticks and stay as they are between, see
    `flocking.model.bodies.discrete_bodies.DiscreteBody`."""

    @property
    @abstractmethod
    def order(self) -> int:
        """2 where an agent has a velocity of its own, 1 where its velocity is its input."""

    @abstractmethod
    def rates(self, x: MotionSymbols) -> dict[str, Sequence[sympy.Expr]]:
        """Rate of change of every column: ``p`` for bodies of order 2, ``q`` for those of order 1, and all others."""

    def lets(self, x: MotionSymbols) -> dict[str, sympy.Expr]:
        """Expressions that are computed once for `rates`, in order: each may use those before it, by ``x.let``."""
        return {}

    def kinetic(self, x: MotionSymbols, relative: Sequence[sympy.Expr]) -> sympy.Expr:
        """Kinetic energy of an agent: m |w|^2/2 of its velocity relative to the frame of the energy, 0 for order 1.

        Parameters
        ----------
        x
            The agent.
        relative
            Its velocity w relative to the frame, m expressions.
        """
        import sympy

        if self.order == 1:
            return sympy.Integer(0)
        return x.mass * sum((w**2 for w in relative), sympy.Integer(0)) / 2

    @property
    def columns(self) -> tuple[Column, ...]:
        """What an agent has beside position and velocity."""
        return ()

    def widths(self, dimension: int) -> dict[str, int]:
        """How many numbers an agent has in each of `columns`, in ``dimension`` dimensions, by name."""
        return {column.name: column.size(dimension) for column in self.columns}

    @property
    def directions(self) -> tuple[str, ...]:
        """Names of those columns that are unit vectors in space, which pictures draw and fields of view may use."""
        return ()

    @property
    def parameters(self) -> dict[str, float | Array]:
        """Numbers that formulas use, by name, beside masses and damping."""
        return {}

    @property
    def structure(self) -> tuple[object, ...]:
        """What fixes the formulas: the kind of body and everything of it that is no run-time parameter."""
        return (type(self).__module__, type(self).__qualname__)

    def start(self, column: str, q: Array, p: Array) -> Array:
        """Values of a column where a start does not give them: zero.

        Parameters
        ----------
        column
            Its name.
        q, p
            Positions and velocities, shape (N, m).
        """
        return np.zeros((len(q), self.widths(q.shape[1])[column]))

    def missing_columns(self, given: Mapping[str, Array], q: Array, p: Array) -> dict[str, Array]:
        """Where the columns begin that a state does not give, by name.

        Parameters
        ----------
        given
            Columns of the state by name.
        q, p
            Its positions and velocities, shape (N, m).
        """
        return {c.name: self.start(c.name, q, p) for c in self.columns if c.name not in given}

    def held(self, dimension: int) -> tuple[str, ...]:
        """Names of numbers of each agent that stay as they are until something happens: none.

        Those that `limits` names are 0 or 1, the others are those of `drawn`.
        """
        return ()

    def limits(self, x: MotionSymbols) -> dict[str, Limit]:
        """What acts only at times, by the name of the number that is 1 while it does."""
        return {}

    def drawn(self, elapsed: float, n: int, dimension: int) -> dict[str, Array]:
        """Numbers of ``n`` agents that are set by the clock, shape (n,) each, by name.

        Parameters
        ----------
        elapsed
            Time since the start of the run.
        """
        return {}

    def drawn_until(self, elapsed: float) -> float:
        """The first time since the start after ``elapsed`` at which `drawn` changes; infinite if it never does."""
        return np.inf

    @property
    def summary(self) -> str:
        """What agents do other than to exert the desired force as points, in a few words; empty where nothing is."""
        return f"agents are {type(self).__name__}"

    @property
    def ideal(self) -> bool:
        """Whether the point on which the law acts moves as that of an ideal body of the same order does."""
        return not self.summary

    @property
    def homogeneous(self) -> bool:
        """Whether rates are the same everywhere and at all times; then engines may choose the origin."""
        return False

    @property
    def inert(self) -> bool:
        """Whether rates are also the same for all observers who move uniformly."""
        return False

    @property
    def symmetries(self) -> frozenset[str]:
        """Symmetries of `flocking.model.symmetries` that the motion of the bodies keeps: those that are known here.

        Agents take their own numbers with them where they are renumbered.
        """
        found = {"locality"}
        if np.isinf(self.drawn_until(0.0)):
            found.add("relabelling")
        if self.inert and self.order == MOVES_ON:
            found.add("galilean")
        return frozenset(found)

    def check_scenario(self, control: Control, q: Array, p: Array) -> None:
        """Check that agents can act when ``control`` states, and begin where and how they do; most can.

        Parameters
        ----------
        control
            When they act.
        q, p
            Positions and velocities at the start, shape (N, m).

        Raises
        ------
        InvalidInput
            When they cannot.
        """
        return None

    def check_fields(self) -> None:
        """Check masses, damping and headings, and put them in the form that engines use.

        Raises
        ------
        InvalidInput
            When a mass is not positive, a damping gain is negative, or headings have no such shape.
        """
        owner = type(self).__name__
        object.__setattr__(self, "masses", scalar_or_each(owner, "masses", self.masses, above=0.0))
        object.__setattr__(self, "damping", scalar_or_each(owner, "damping", self.damping, least=0.0))
        if self.headings is not None:
            ndim = axes_of(self.headings)
            if ndim not in (1, 3):
                given = f"{ndim} axes" if ndim >= 0 else "sequences of different lengths"
                raise InvalidInput(owner, "headings", "must have shape (N,) or (N, d, d)", given)
            object.__setattr__(self, "headings", array(owner, "headings", self.headings, ndim=ndim))

    def check_count(self, n: int) -> None:
        """Check that per-agent values are given for exactly ``n`` agents.

        Raises
        ------
        InvalidInput
            When an array has another length.
        """
        own = {"masses": self.masses, "damping": self.damping, "headings": self.headings, **self.parameters}
        for name, value in own.items():
            check_each(type(self).__name__, name, value, n)


add_group(Group("agents", Body, key="kind", default="agents"))
