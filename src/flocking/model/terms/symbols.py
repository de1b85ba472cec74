"""The symbols in the formulas of parts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import sympy

    from flocking.model.terms.fading_potentials import Fade


@dataclass(frozen=True)
class PairSymbols:
    """Symbols of an ordered pair (i, j) for pair terms, j a neighbour of i.

    Parameters
    ----------
    weight
        Weight a_ij of the link, an expression in ``r``.
    speed2
        Squared relative speed |p_j - p_i|^2.
    radial
        Component of p_j - p_i along n_ij: the rate of change of ``r``.
    functional
        Functional s_i of the graph for agent i (Shi, Remark 3).
    parameter
        Symbol of a parameter of the term, by name.
    fade
        The integral of `PairTerm.fall`.
    """

    r: sympy.Expr
    weight: sympy.Expr
    speed2: sympy.Expr
    radial: sympy.Expr
    functional: sympy.Expr
    parameter: Callable[[str], sympy.Expr]
    fade: Fade | None = None


@dataclass(frozen=True)
class BodySymbols:
    """Symbols of agent i for body terms.

    Parameters
    ----------
    q, p
        Position and velocity, m expressions each.
    mass, damping
        m_i and k_i.
    mean_q, mean_p
        Centre of mass and its velocity; using them makes a term not distributed.
    frame_q, frame_p
        Origin of the frame in which the energy is taken, and its velocity. The origin of the lab frame is None.
    leader_q, leader_p, leader_a
        Position, velocity and acceleration of the term's leader, m expressions each.
    parameter
        Symbol of a parameter of the term, by name.
    """

    q: Sequence[sympy.Expr]
    p: Sequence[sympy.Expr]
    t: sympy.Expr
    mass: sympy.Expr
    damping: sympy.Expr
    mean_q: Sequence[sympy.Expr]
    mean_p: Sequence[sympy.Expr]
    frame_q: Sequence[sympy.Expr] | None
    frame_p: Sequence[sympy.Expr]
    leader_q: Sequence[sympy.Expr]
    leader_p: Sequence[sympy.Expr]
    leader_a: Sequence[sympy.Expr]
    parameter: Callable[[str], sympy.Expr]


@dataclass(frozen=True)
class ObstacleSymbols:
    """Symbols of agent i and one obstacle within range, for obstacle terms.

    Parameters
    ----------
    q, p
        Position and velocity of the agent, m expressions each.
    mass
        m_i.
    distance
        Signed distance of the agent from the boundary.
    normal
        Unit normal at the nearest boundary point, away from the obstacle.
    boundary
        Velocity of the nearest boundary point as agent and obstacle move (Olfati-Saber (56)).
    anchor
        Centre b_k of the obstacle, or None.
    frame_p
        Velocity of the frame in which the energy is taken.
    leader_q, leader_p, leader_a
        Position, velocity and acceleration of the term's leader, m expressions each.
    parameter
        Symbol of a parameter of the term, by name.
    """

    q: Sequence[sympy.Expr]
    p: Sequence[sympy.Expr]
    t: sympy.Expr
    mass: sympy.Expr
    distance: sympy.Expr
    normal: Sequence[sympy.Expr]
    boundary: Sequence[sympy.Expr]
    anchor: Sequence[sympy.Expr] | None
    frame_p: Sequence[sympy.Expr]
    leader_q: Sequence[sympy.Expr]
    leader_p: Sequence[sympy.Expr]
    leader_a: Sequence[sympy.Expr]
    parameter: Callable[[str], sympy.Expr]
