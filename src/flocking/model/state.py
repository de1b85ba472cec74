"""States of a group, and the fixed properties of its agents."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Annotated

import numpy as np

from flocking.arrays import Links
from flocking.errors import InvalidInput, SuspectInput
from flocking.model.bodies.body import MotionSymbols
from flocking.model.bodies.point_bodies import PointMass, Points, SingleIntegrator
from flocking.model.checks import NUMBERS, Array, array, axes_of, number, one_of
from flocking.model.parts import values
from flocking.model.parts.description import Group, add_group
from flocking.model.parts.registration import register_part

if TYPE_CHECKING:
    import sympy
    from numpy.typing import ArrayLike

SPACE = 3
"""Dimensions beyond which an error adds that rows are agents: columns may have been meant."""

WIDEST = 1e150
"""Largest extent of a group: squares of longer distances are no numbers, and such distances would be infinite."""

NARROWEST = 1e-140
"""Least extent of a group that is not in one point: squares of shorter distances lose digits, or are 0."""

CALLER = 4
"""Stack level of a warning for the line that makes a state: this class, its constructor, and the check of names."""


@register_part()
@dataclass(frozen=True, eq=False)
class State:
    """Positions and velocities of N agents in m dimensions at one time.

    Parameters
    ----------
    q
        Positions, shape (N, m).
    p
        Velocities, shape (N, m). At rest when absent.
    t
        Time.
    links
        Link memory, shape (N, N), ``links[i, j]`` true when agent i senses agent j. None before a graph
        has been asked for its initial links.
    columns
        Further columns of the agents by name, shape (N, width) each, see `flocking.model.bodies.body.Body.columns`.

    Raises
    ------
    InvalidInput
        When shapes disagree, a value is not finite, or there is no agent.
    """

    q: Array
    p: Array = None  # type: ignore[assignment]
    t: float = 0.0
    links: Links | None = None
    columns: Annotated[Mapping[str, Array], values.NAMED_ROWS] = field(default_factory=dict)

    if TYPE_CHECKING:

        def __init__(
            self,
            q: ArrayLike,
            p: ArrayLike | None = None,
            t: float = 0.0,
            links: ArrayLike | None = None,
            columns: Mapping[str, ArrayLike] = ...,
        ) -> None: ...

    def __post_init__(self) -> None:
        q = array("State", "q", self.q, ndim=2)
        if q.shape[0] < 1 or q.shape[1] < 1:
            raise InvalidInput("State", "q", "must hold at least 1 agent in at least 1 dimension", f"shape {q.shape}")
        p = array("State", "p", np.zeros_like(q) if self.p is None else self.p, ndim=2)
        if p.shape != q.shape:
            raise InvalidInput(
                "State", "p", f"must have the shape of q, {q.shape}", f"shape {p.shape}", "Give one velocity per agent."
            )
        if q.shape[1] > SPACE:
            warnings.warn(
                f"State: q has shape {q.shape}, which is {q.shape[0]} agents in {q.shape[1]} dimensions: rows are "
                "agents. Give q.T where columns are.",
                SuspectInput,
                stacklevel=CALLER,
            )
        object.__setattr__(self, "q", q)
        object.__setattr__(self, "p", p)
        object.__setattr__(self, "t", number("State", "t", self.t))
        object.__setattr__(self, "columns", self._checked_columns())
        if self.links is not None:
            if axes_of(self.links) != 2:
                raise InvalidInput("State", "links", f"must be an ({self.n}, {self.n}) matrix", self.links)
            given = np.asarray(self.links)
            if given.dtype != bool and (given.dtype.kind not in NUMBERS or ((given != 0) & (given != 1)).any()):
                raise InvalidInput("State", "links", "must hold true or false, or 1 or 0, for each pair", self.links)
            links = given.astype(bool)
            if links.shape != (self.n, self.n) or links.diagonal().any():
                rule, own = (
                    f"must be an ({self.n}, {self.n}) matrix with a false diagonal",
                    np.flatnonzero(links.diagonal()),
                )
                wrong = (
                    f"shape {links.shape}" if links.shape != (self.n, self.n) else f"a link of agent {own[0]} to itself"
                )
                raise InvalidInput("State", "links", rule, wrong)
            links.setflags(write=False)
            object.__setattr__(self, "links", links)

    def check_extent(self, owner: str, name: str = "start") -> None:
        """Check that distances of agents are numbers if the places differ.

        Parameters
        ----------
        owner
            Who looks at the distances, for the message.
        name
            Its name for the state.

        Raises
        ------
        InvalidInput
            If all agents lie closer together than 1e-140, but not in one point: squares of their distances are 0. If
            agents are farther apart than 1e150: squares of their distances are no numbers.
        """
        extent = self._extent
        if extent > WIDEST:
            rule = f"must have places that differ by at most {WIDEST:g}"
            raise InvalidInput(owner, name, rule, extent, "Choose another unit of length.")
        if 0.0 < extent < NARROWEST:
            rule = f"must have places that differ by more than {NARROWEST:g}, or not at all"
            raise InvalidInput(owner, name, rule, extent, "Choose another unit of length.")

    @cached_property
    def _extent(self) -> float:
        with np.errstate(over="ignore"):
            return float(np.abs(self.q - self.q[0]).max())

    @cached_property
    def sizes(self) -> tuple[float, float]:
        """Largest distance of a coordinate from its mean over the group, and largest component of a velocity."""
        spread = float(np.abs(self.q - self.q.mean(axis=0)).max(initial=0.0))
        return spread, float(np.abs(self.p).max(initial=0.0))

    def _checked_columns(self) -> dict[str, Array]:
        if not isinstance(self.columns, Mapping):
            raise InvalidInput("State", "columns", "must give an array for each name", self.columns)
        found = {}
        for name, given in self.columns.items():
            values = array("State", f"columns[{name!r}]", given, ndim=2)
            if len(values) != self.n:
                raise InvalidInput(
                    "State", f"columns[{name!r}]", f"must have a row for each of the {self.n} agents",
                    f"shape {values.shape}",
                )  # fmt: skip
            found[str(name)] = values
        return found

    @property
    def n(self) -> int:
        """Number of agents."""
        return int(self.q.shape[0])

    @property
    def dimension(self) -> int:
        """Number of space dimensions."""
        return int(self.q.shape[1])


add_group(Group("start", State, key="draw", default="given"))


@dataclass(frozen=True, eq=False)
class Agents(Points):
    """What the agents are: m_i dv_i/dt = u_i - k_i v_i (Shi (1)), or dq_i/dt = u_i for order 1.

    It is `PointMass` or `SingleIntegrator`, chosen by the order.

    Parameters
    ----------
    masses
        One mass for all, or one per agent; positive.
    damping
        Velocity damping gains k_i, one for all or one per agent; not negative, and 0 for order 1.
    order
        2 for double integrators, 1 for first-order agents such as the agreement protocol (12)-(13).
    headings
        Heading angles in radians, shape (N,), or rotation matrices, shape (N, d, d); None when the graph
        does not look at headings.

    Raises
    ------
    InvalidInput
        When a mass is not positive, a damping gain is negative or not 0 for order 1, or the order is neither 1 nor 2.
    """

    masses: float | Array = 1.0
    damping: float | Array = 0.0
    order: Annotated[int, values.ORDER] = 2
    headings: Annotated[Array | None, values.HEADINGS] = None

    if TYPE_CHECKING:

        def __init__(
            self, masses: ArrayLike = 1.0, damping: ArrayLike = 0.0, order: int = 2, headings: ArrayLike | None = None
        ) -> None: ...

    def __post_init__(self) -> None:
        one_of("Agents", "order", self.order, (1, 2), "must be 1 or 2")
        self.check_fields()
        if self.order == 1 and np.any(np.asarray(self.damping)):
            raise InvalidInput(
                "Agents", "damping", "must be 0 for agents of order 1", self.damping,
                "Their velocity is the control: there is none of their own to damp.",
            )  # fmt: skip

    @cached_property
    def _body(self) -> PointMass | SingleIntegrator:
        if self.order == 1:
            return SingleIntegrator(self.masses, self.headings)
        return PointMass(self.masses, self.damping, self.headings)

    def rates(self, x: MotionSymbols) -> dict[str, Sequence[sympy.Expr]]:
        """Those of `PointMass` or `SingleIntegrator`."""
        return self._body.rates(x)

    @property
    def structure(self) -> tuple[object, ...]:
        """That of `PointMass` or `SingleIntegrator`."""
        return self._body.structure

    @property
    def inert(self) -> bool:
        """Whether no agent is damped; never for order 1."""
        return self._body.inert


register_part("agents")(Agents)
