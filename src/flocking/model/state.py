"""States of a group, and the fixed properties of its agents."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np

from flocking.arrays import Links
from flocking.errors import InvalidInput, SuspectInput
from flocking.model.checks import Array, array, axes_of, number, one_of, scalar_or_each

SPACE = 3
"""Dimensions beyond which it is said that rows are agents: columns may have been meant."""


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

    Raises
    ------
    InvalidInput
        When shapes disagree, a value is not finite, or there is no agent.
    """

    q: Array
    p: Array = None  # type: ignore[assignment]
    t: float = 0.0
    links: Links | None = None

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
                stacklevel=3,
            )
        object.__setattr__(self, "q", q)
        object.__setattr__(self, "p", p)
        object.__setattr__(self, "t", number("State", "t", self.t))
        if self.links is not None:
            if axes_of(self.links) != 2:
                raise InvalidInput("State", "links", f"must be an ({self.n}, {self.n}) matrix", self.links)
            links = np.array(self.links, dtype=bool)
            if links.shape != (self.n, self.n) or links.diagonal().any():
                raise InvalidInput(
                    "State",
                    "links",
                    f"must be an ({self.n}, {self.n}) matrix with a false diagonal",
                    f"shape {links.shape}",
                )
            links.setflags(write=False)
            object.__setattr__(self, "links", links)

    @property
    def n(self) -> int:
        """Number of agents."""
        return int(self.q.shape[0])

    @property
    def dimension(self) -> int:
        """Number of space dimensions."""
        return int(self.q.shape[1])


@dataclass(frozen=True, eq=False)
class Agents:
    """What the agents are: m_i dv_i/dt = u_i - k_i v_i (Shi (1)), or dq_i/dt = u_i for order 1.

    Parameters
    ----------
    masses
        One mass for all, or one per agent; positive.
    damping
        Velocity damping gains k_i, one for all or one per agent; not negative.
    order
        2 for double integrators, 1 for first-order agents such as the agreement protocol (12)-(13).
    headings
        Heading angles in radians, shape (N,), or rotation matrices, shape (N, d, d); None when the graph
        does not look at headings.

    Raises
    ------
    InvalidInput
        When a mass is not positive, a damping gain is negative, or the order is neither 1 nor 2.
    """

    masses: float | Array = 1.0
    damping: float | Array = 0.0
    order: int = 2
    headings: Array | None = None

    def __post_init__(self) -> None:
        masses = scalar_or_each("Agents", "masses", self.masses)
        if (np.asarray(masses) <= 0).any():
            raise InvalidInput("Agents", "masses", "must be positive", self.masses)
        object.__setattr__(self, "masses", masses)
        object.__setattr__(self, "damping", scalar_or_each("Agents", "damping", self.damping, least=0.0))
        one_of("Agents", "order", self.order, (1, 2), "must be 1 or 2")
        if self.headings is not None:
            ndim = axes_of(self.headings)
            if ndim not in (1, 3):
                raise InvalidInput("Agents", "headings", "must have shape (N,) or (N, d, d)", f"{ndim} axes")
            object.__setattr__(self, "headings", array("Agents", "headings", self.headings, ndim=ndim))

    def check_count(self, n: int) -> None:
        """Check that per-agent values are given for exactly ``n`` agents.

        Raises
        ------
        InvalidInput
            When an array has another length.
        """
        for name in ("masses", "damping", "headings"):
            value = getattr(self, name)
            if value is not None and np.ndim(value) and len(value) != n:
                raise InvalidInput(
                    "Agents", name, f"must have one value for each of the {n} agents", f"{len(value)} values"
                )
