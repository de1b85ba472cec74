"""Velocity alignment: weights that decrease with the distance, and the average over the neighbours."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from flocking.model.checks import Array, number, scalar_or_each
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.parts.registration import register_part
from flocking.model.symmetries import SYMMETRIES
from flocking.model.terms.pair_terms import AVERAGE, PairTerm, Value, check_graph
from flocking.model.terms.symbols import PairSymbols

if TYPE_CHECKING:
    import sympy
    from numpy.typing import ArrayLike


@register_part("cucker_smale")
@dataclass(frozen=True)
class CuckerSmale(PairTerm):
    """Alignment of weight K/(sigma^2 + r^2)^beta: sum over neighbours of that times p_j - p_i (Cucker, Smale 2007).

    The authors let all pairs act, over the graph `Complete`, and divide by nothing. With weights K/N give K/N as gain.

    Parameters
    ----------
    gain
        K; not negative.
    exponent
        beta; not negative. The weights are not summable over the distance up to beta = 1/2.
    scale
        sigma, the distance over which the weight is level; positive.
    over
        Graph of this term; the graph of the law by default.

    Raises
    ------
    InvalidInput
        If a value is out of range.
    """

    gain: float
    exponent: float
    scale: float = 1.0
    over: Graph | None = None

    def __post_init__(self) -> None:
        check_graph("CuckerSmale", self.over)
        object.__setattr__(self, "gain", number("CuckerSmale", "gain", self.gain, least=0.0))
        object.__setattr__(self, "exponent", number("CuckerSmale", "exponent", self.exponent, least=0.0))
        object.__setattr__(self, "scale", number("CuckerSmale", "scale", self.scale, above=0.0))

    @property
    def parameters(self) -> dict[str, Value]:
        """Gain, exponent and scale."""
        return {"gain": self.gain, "exponent": self.exponent, "scale": self.scale}

    @property
    def structure(self) -> tuple[object, ...]:
        """The name."""
        return ("CuckerSmale",)

    def drag(self, x: PairSymbols) -> sympy.Expr:
        """K/(sigma^2 + r^2)^beta."""
        return x.parameter("gain") * (x.parameter("scale") ** 2 + x.r**2) ** (-x.parameter("exponent"))

    def dissipation(self, x: PairSymbols) -> sympy.Expr:
        """The weight times |p_j - p_i|^2."""
        return self.drag(x) * x.speed2


@register_part("velocity_average")
@dataclass(frozen=True)
class VelocityAverage(PairTerm):
    """Alignment with the average: gain times the mean of p_j - p_i over agent i itself and its n_i neighbours.

    u_i = c/(1 + n_i) sum over neighbours of (p_j - p_i). The nearest-neighbour rule of headings set at ticks (Vicsek,
    Czirok, Ben-Jacob, Cohen and Shochet 1995) follows with c = 1/period, see
    `flocking.model.bodies.discrete_bodies.Heading`. Neighbours that have different numbers of neighbours act on each
    other with different weights, so that momentum is not kept.

    Parameters
    ----------
    gain
        The factor c, or one per agent; not negative.
    over
        Graph of this term; the graph of the law by default.

    Raises
    ------
    InvalidInput
        If a gain is negative or not finite.
    """

    gain: float | Array = 1.0
    over: Graph | None = field(default=None, kw_only=True)
    functional: ClassVar[str] = AVERAGE

    if TYPE_CHECKING:  # Lists are accepted.

        def __init__(self, gain: ArrayLike = 1.0, *, over: Graph | None = None) -> None: ...

    def __post_init__(self) -> None:
        check_graph("VelocityAverage", self.over)
        object.__setattr__(self, "gain", scalar_or_each("VelocityAverage", "gain", self.gain, least=0.0))

    @property
    def parameters(self) -> dict[str, Value]:
        """The gain."""
        return {"gain": self.gain}

    @property
    def structure(self) -> tuple[object, ...]:
        """The name."""
        return ("VelocityAverage",)

    @property
    def symmetries(self) -> frozenset[str]:
        """All but momentum; agents are alike if they share one gain."""
        return SYMMETRIES - {"momentum"} - ({"relabelling"} if np.ndim(self.gain) else set())

    def drag(self, x: PairSymbols) -> sympy.Expr:
        """c/(1 + n_i)."""
        return x.parameter("gain") * x.functional

    def dissipation(self, x: PairSymbols) -> sympy.Expr:
        """The coefficient times |p_j - p_i|^2."""
        return self.drag(x) * x.speed2

    def supply(self, x: PairSymbols) -> sympy.Expr:
        """Zero: all power is dissipated."""
        import sympy

        return sympy.Integer(0)
