"""Bodies that change what reaches another body: the chain from the desired force to the motion."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from flocking.errors import InvalidInput
from flocking.model.bodies.body import Body, Column, Limit, MotionSymbols
from flocking.model.checks import Array, check_each
from flocking.model.symmetries import SYMMETRIES

if TYPE_CHECKING:
    import sympy

    from flocking.model.world.control import Control

INNER = "body_"
"""What the names of lets, parameters and held numbers of the inner body begin with."""


@dataclass(frozen=True, eq=False)
class WrappedBody(Body):
    """A body that stands between the desired force and another body, whose columns it keeps.

    A subclass states what it adds: `passed` to the inner body, `own_columns` and so on. Masses, damping and headings
    are those of the inner body.

    Parameters
    ----------
    body
        The inner body, which is nearer to the motion.

    Raises
    ------
    InvalidInput
        When it is no body, or has a column that this one adds.
    """

    body: Body

    def check_inner(self) -> None:
        """Check the inner body, and take its masses, damping and headings.

        Raises
        ------
        InvalidInput
            When it is no body, or has a column that this one adds.
        """
        owner = type(self).__name__
        if not isinstance(self.body, Body):
            raise InvalidInput(owner, "body", "must be a body, such as PointMass", self.body)
        if self.body.discrete:
            raise InvalidInput(
                owner, "body", "must move continuously", type(self.body).__name__,
                "A body that sets its velocity at ticks stands alone.",
            )  # fmt: skip
        taken = {c.name for c in self.body.columns} & {c.name for c in self.own_columns}
        if taken:
            raise InvalidInput(
                owner, "body", "must not have a column of the same name", sorted(taken)[0],
                f"Use {owner} once in a chain.",
            )  # fmt: skip
        for name in ("masses", "damping", "headings"):
            object.__setattr__(self, name, getattr(self.body, name))

    @property
    def order(self) -> int:
        """That of the inner body."""
        return self.body.order

    @property
    def directions(self) -> tuple[str, ...]:
        """Those of the inner body."""
        return self.body.directions

    @property
    def own_columns(self) -> tuple[Column, ...]:
        """Columns that this body adds: none."""
        return ()

    @property
    def own_parameters(self) -> dict[str, float | Array]:
        """Numbers that its own formulas use: none."""
        return {}

    def own_held(self, dimension: int) -> tuple[str, ...]:
        """Held numbers that it adds: none."""
        return ()

    def own_limits(self, x: MotionSymbols) -> dict[str, Limit]:
        """Limits that it adds: none."""
        return {}

    def own_lets(self, x: MotionSymbols) -> dict[str, sympy.Expr]:
        """Expressions that its own formulas share: none."""
        return {}

    def own_drawn(self, elapsed: float, n: int, dimension: int) -> dict[str, Array]:
        """Numbers that the clock sets for it: none.

        Parameters
        ----------
        elapsed
            Time since the start of the run.
        """
        return {}

    def passed(self, x: MotionSymbols) -> Sequence[sympy.Expr]:
        """The force that the inner body is given as the desired one."""
        return x.u

    def own_rates(self, x: MotionSymbols) -> dict[str, Sequence[sympy.Expr]]:
        """Rates of `own_columns`."""
        return {}

    def inner(self, x: MotionSymbols) -> MotionSymbols:
        """What the inner body may use."""
        return replace(
            x, u=self.passed(x), parameter=lambda name: x.parameter(INNER + name),
            let=lambda name: x.let(INNER + name), held=lambda name: x.held(INNER + name),
        )  # fmt: skip

    def rates(self, x: MotionSymbols) -> dict[str, Sequence[sympy.Expr]]:
        """Those of the inner body under what is passed on, and its own."""
        return {**self.body.rates(self.inner(x)), **self.own_rates(x)}

    def lets(self, x: MotionSymbols) -> dict[str, sympy.Expr]:
        """Its own, then those of the inner body."""
        return {**self.own_lets(x), **{INNER + name: e for name, e in self.body.lets(self.inner(x)).items()}}

    def kinetic(self, x: MotionSymbols, relative: Sequence[sympy.Expr]) -> sympy.Expr:
        """That of the inner body.

        Parameters
        ----------
        x
            The agent.
        relative
            Its velocity relative to the frame.
        """
        return self.body.kinetic(self.inner(x), relative)

    @property
    def columns(self) -> tuple[Column, ...]:
        """Those of the inner body, then its own."""
        return (*self.body.columns, *self.own_columns)

    @property
    def parameters(self) -> dict[str, float | Array]:
        """Its own, and those of the inner body."""
        return {**self.own_parameters, **{INNER + name: value for name, value in self.body.parameters.items()}}

    @property
    def structure(self) -> tuple[object, ...]:
        """Its own kind, and the structure of the inner body."""
        return (*super().structure, *self.own_structure, self.body.structure)

    @property
    def own_structure(self) -> tuple[object, ...]:
        """What determines its formulas beside run-time parameters: nothing."""
        return ()

    def start(self, column: str, q: Array, p: Array) -> Array:
        """Where a column begins: zero for its own.

        Parameters
        ----------
        column
            Its name.
        q, p
            Positions and velocities, shape (N, m).
        """
        inside = any(c.name == column for c in self.body.columns)
        return self.body.start(column, q, p) if inside else super().start(column, q, p)

    def missing_columns(self, given: Mapping[str, Array], q: Array, p: Array) -> dict[str, Array]:
        """Columns of the inner body by its own rule, and its own.

        Parameters
        ----------
        given
            Columns of the state by name.
        q, p
            Its positions and velocities, shape (N, m).
        """
        own = {c.name: self.start(c.name, q, p) for c in self.own_columns if c.name not in given}
        return {**self.body.missing_columns(given, q, p), **own}

    def check_scenario(self, control: Control, q: Array, p: Array) -> None:
        """That of the inner body.

        Parameters
        ----------
        control, q, p
            As for `Body.check_scenario`.

        Raises
        ------
        InvalidInput
            When the inner body refuses.
        """
        self.body.check_scenario(control, q, p)

    def held(self, dimension: int) -> tuple[str, ...]:
        """Its own, then those of the inner body."""
        return (*self.own_held(dimension), *(INNER + name for name in self.body.held(dimension)))

    def limits(self, x: MotionSymbols) -> dict[str, Limit]:
        """Its own, then those of the inner body."""
        return {**self.own_limits(x), **{INNER + k: limit for k, limit in self.body.limits(self.inner(x)).items()}}

    def drawn(self, elapsed: float, n: int, dimension: int) -> dict[str, Array]:
        """Its own, and those of the inner body.

        Parameters
        ----------
        elapsed
            Time since the start of the run.
        n, dimension
            Numbers of agents and axes.
        """
        inside = {INNER + name: value for name, value in self.body.drawn(elapsed, n, dimension).items()}
        return {**self.own_drawn(elapsed, n, dimension), **inside}

    def drawn_until(self, elapsed: float) -> float:
        """That of the inner body."""
        return self.body.drawn_until(elapsed)

    @property
    def own_summary(self) -> str:
        """Its own effect, in a few words."""
        return super().summary

    @property
    def summary(self) -> str:
        """Its own effect, and that of the inner body."""
        return ", ".join(filter(None, (self.own_summary, self.body.summary)))

    @property
    def homogeneous(self) -> bool:
        """That of the inner body."""
        return self.body.homogeneous

    @property
    def own_lost(self) -> frozenset[str]:
        """Symmetries of the inner body that this one may break: all but locality and relabelling."""
        return SYMMETRIES - {"locality", "relabelling"}

    @property
    def symmetries(self) -> frozenset[str]:
        """Those of the inner body but for `own_lost`, and relabelling only where nothing is drawn in the chain."""
        drawn = {"relabelling"} if self.drawn_until(0.0) < math.inf else set()
        return self.body.symmetries - self.own_lost - drawn

    def check_count(self, n: int) -> None:
        """Check that values of each agent are given for ``n`` agents, here and in the inner body.

        Raises
        ------
        InvalidInput
            When an array has another length.
        """
        for name, value in self.own_parameters.items():
            check_each(type(self).__name__, name, value, n)
        self.body.check_count(n)
