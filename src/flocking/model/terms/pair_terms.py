"""Pair terms of a control law: contributions of a neighbour j to the control of agent i."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated

import numpy as np
from numpy.typing import ArrayLike

from flocking.errors import InvalidInput
from flocking.formula.derivatives import derivative
from flocking.model.checks import Array, check_each, one_of, scalar_or_each, truth
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.graphs.weights import HashedWeights, MatrixWeights, PairWeights
from flocking.model.parts import values
from flocking.model.parts.description import Group, Nested, add_group
from flocking.model.parts.registration import register_part
from flocking.model.potentials.potential import Potential
from flocking.model.symmetries import SYMMETRIES
from flocking.model.terms.schedules import Schedule
from flocking.model.terms.symbols import PairSymbols

if TYPE_CHECKING:
    import sympy

    from flocking.model.leaders_and_obstacles.obstacles import Obstacle
    from flocking.model.terms.fading_potentials import Fall

Value = float | Array | PairWeights | Schedule
"""A parameter: one number, one number per agent, or one per pair; the first two may change at given times."""

WEIGHTINGS, STORED = ("energy", "force"), ("integral", "potential")
"""Choices of `Gradient`."""

AVERAGE = "average"
"""The functional of terms that average over an agent and its neighbours: one over their number."""


class Term(ABC):
    """Base class of the terms of a law."""

    @property
    @abstractmethod
    def parameters(self) -> dict[str, Value]:
        """Run-time parameters by name."""

    @property
    @abstractmethod
    def structure(self) -> tuple[object, ...]:
        """Everything that determines the formulas of the term, without the values of its parameters."""

    @property
    def symmetries(self) -> frozenset[str]:
        """Symmetries of the term, a subset of `SYMMETRIES`."""
        return SYMMETRIES

    def check_count(self, n: int) -> None:
        """Check that per-agent and per-pair parameters fit ``n`` agents.

        Raises
        ------
        InvalidInput
            If one has another length.
        """
        for name, value in self.parameters.items():
            if isinstance(value, PairWeights):
                value.check_count(n)
            elif isinstance(value, Schedule):
                value.check_count(type(self).__name__, name, n)
            else:
                check_each(type(self).__name__, name, value, n)

    def check_dimension(self, dimension: int) -> None:
        """Check that the term fits ``dimension`` space dimensions; most fit any."""
        return None

    def solids(self, dimension: int) -> tuple[Obstacle, ...]:
        """Obstacles in ``dimension`` space dimensions that agents under this term are not to enter; none for most."""
        return ()


class PairTerm(Term):
    """A term that sums over neighbours: u_i += along * n_ij + drag * (p_j - p_i).

    A subclass defines `along` or `drag` or both as SymPy expressions of the given symbols, and if they exist the
    stored energy, the dissipated power and the supplied power, each per ordered pair. They must be consistent with
    its forces in every state:

        - along radial - drag speed2 + (rate of storage) + dissipation - supply = 0.

    A law checks this when it is built. Engines add the power of forces that are not equal and opposite to the supply.
    """

    over: Graph | None = None
    """Graph of this term; None for the graph of the law."""

    def along(self, x: PairSymbols) -> sympy.Expr:
        """Coefficient of n_ij = (q_j - q_i)/r."""
        import sympy

        return sympy.Integer(0)

    def drag(self, x: PairSymbols) -> sympy.Expr:
        """Coefficient of p_j - p_i."""
        import sympy

        return sympy.Integer(0)

    def storage(self, x: PairSymbols) -> sympy.Expr:
        """Energy stored in an undirected link (each ordered pair counts half of it)."""
        import sympy

        return sympy.Integer(0)

    def dissipation(self, x: PairSymbols) -> sympy.Expr:
        """Power dissipated by an undirected link (each ordered pair counts half of it)."""
        import sympy

        return sympy.Integer(0)

    def supply(self, x: PairSymbols) -> sympy.Expr:
        """Power supplied to an undirected link (each ordered pair counts half of it).

        By default all power of a term without storage and dissipation, else none.
        """
        import sympy

        if self.storage(x) == 0 and self.dissipation(x) == 0:
            return -self.along(x) * x.radial - self.drag(x) * x.speed2
        return sympy.Integer(0)

    def fall(self, graph: Graph) -> Fall | None:
        """The integral over the fall of a graph's weight that `storage` needs as ``x.fade``; None for none.

        Parameters
        ----------
        graph
            The graph.
        """
        return None

    def kinks(self) -> tuple[float, ...]:
        """Distances at which the formulas have a kink."""
        return ()


add_group(Group("term", Term))


def check_graph(owner: str, over: Graph | None) -> None:
    """Check the graph of a term.

    Parameters
    ----------
    owner
        Name of the term.
    over
        The graph, or None.

    Raises
    ------
    InvalidInput
        If it is anything else.
    """
    if over is not None and not isinstance(over, Graph):
        raise InvalidInput(owner, "over", "must be a graph", over, "Use Fixed, Proximity or Hysteresis.")


@register_part("gradient")
@dataclass(frozen=True)
class Gradient(PairTerm):
    """Descent of a pair potential: psi'(r) n_ij summed over neighbours (Tanner (5), Zhou (8), Olfati-Saber (34)-(36)).

    Parameters
    ----------
    potential
        The potential psi(r).
    weighting
        Use of the weight a(r) of a smooth graph. ``"energy"``: the force is the gradient of a psi
        (Olfati-Saber (35)). ``"force"``: the force is a psi' (Olfati-Saber (36)). The two agree where a = 1.
    over
        Graph of this term; the graph of the law by default.
    stored
        The energy of a weighted force. ``"integral"``: the integral of a psi', zero at the radius, of which the
        force is the gradient; where the weight decreases to 12 digits of its largest value there, 10 of steep ones, and
        9 of the largest one farther out. ``"potential"``: a psi, the energy of (35); power due to changes of the weight
        counts as supplied. This also applies to graphs whose weight is not that of `Smooth`, and to potentials with a
        kink, a narrow feature or too steep a slope where the weight decreases; see `fall`.

    Raises
    ------
    InvalidInput
        If ``weighting`` or ``stored`` is unknown or ``potential`` is not a Potential.
    """

    potential: Annotated[Potential, Nested("potential", inline=True)]
    weighting: Annotated[str, values.choice(*WEIGHTINGS)] = "energy"
    over: Graph | None = None
    stored: Annotated[str, values.choice(*STORED)] = "integral"

    def __post_init__(self) -> None:
        if not isinstance(self.potential, Potential):
            raise InvalidInput(
                "Gradient",
                "potential",
                "must be a Potential",
                self.potential,
                "Write Gradient(Potential('1/r + 1/(R - r)', R=4)).",
            )
        check_graph("Gradient", self.over)
        one_of("Gradient", "weighting", self.weighting, WEIGHTINGS, "must be 'energy' or 'force'")
        one_of("Gradient", "stored", self.stored, STORED, "must be 'integral' or 'potential'")

    @property
    def parameters(self) -> dict[str, Value]:
        """Parameters of the potential."""
        return dict(self.potential.parameters)

    @property
    def structure(self) -> tuple[object, ...]:
        """The formula, the weighting and the kind of storage."""
        return ("Gradient", self.potential.formula.structure, self.weighting, self.stored)

    def fall(self, graph: Graph) -> Fall | None:
        """The integral of a psi' minus a psi, if the integral is stored; see `stored`."""
        if self.weighting != "force" or self.stored != "integral":
            return None
        from flocking.model.graphs.smooth_graphs import Smooth
        from flocking.model.terms.fading_potentials import fall_of

        return fall_of(self.potential, graph) if isinstance(graph, Smooth) and graph.has_own_bump else None

    def _psi(self, x: PairSymbols) -> sympy.Expr:
        return self.potential.expression(x.r, {name: x.parameter(name) for name in self.potential.parameters})

    def along(self, x: PairSymbols) -> sympy.Expr:
        """The slope of a psi, or a times the slope of psi."""
        if self.weighting == "force":
            return x.weight * derivative(self._psi(x), x.r)
        return derivative(x.weight * self._psi(x), x.r)

    def storage(self, x: PairSymbols) -> sympy.Expr:
        """A psi, or the integral of a psi'."""
        if x.fade is None:
            return x.weight * self._psi(x)
        return x.weight * self._psi(x) + x.fade.integral(x.r)

    def supply(self, x: PairSymbols) -> sympy.Expr:
        """Power due to changes of the weight, if the integral is not stored; else zero."""
        import sympy

        if self.weighting == "force" and x.fade is None:
            return derivative(x.weight, x.r) * self._psi(x) * x.radial
        return sympy.Integer(0)

    def kinks(self) -> tuple[float, ...]:
        """Kinks of the potential."""
        return self.potential.kinks()


@register_part("consensus")
@dataclass(frozen=True)
class Consensus(PairTerm):
    """Velocity consensus: w_ij (p_j - p_i) summed over neighbours (Tanner (5), Zhou (8), Shi (4)).

    Parameters
    ----------
    gain
        Common factor c, or one per agent; not negative.
    weights
        Pair weights: an (N, N) matrix, `HashedWeights`, or None for 1.
    weighted
        Whether to multiply by the weight a(r) of a smooth graph; not so in Olfati-Saber (34)-(36) as printed.
    functional
        Whether to multiply by the graph functional s_i of the sensing agent (Shi, Remark 3).
    over
        Graph of this term; the graph of the law by default.

    Raises
    ------
    InvalidInput
        If a gain or weight is negative or not finite.
    """

    gain: float | Array = 1.0
    weights: PairWeights | None = field(default=None, kw_only=True)
    weighted: bool = field(default=False, kw_only=True)
    functional: bool = field(default=False, kw_only=True)
    over: Graph | None = field(default=None, kw_only=True)

    if TYPE_CHECKING:  # A matrix is accepted.

        def __init__(
            self,
            gain: float | ArrayLike = 1.0,
            *,
            weights: PairWeights | ArrayLike | None = None,
            weighted: bool = False,
            functional: bool = False,
            over: Graph | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        check_graph("Consensus", self.over)
        if self.weights is not None and not isinstance(self.weights, PairWeights):
            object.__setattr__(self, "weights", MatrixWeights(self.weights))
        object.__setattr__(self, "gain", scalar_or_each("Consensus", "gain", self.gain, least=0.0))
        for name in ("weighted", "functional"):
            object.__setattr__(self, name, truth("Consensus", name, getattr(self, name)))

    @property
    def parameters(self) -> dict[str, Value]:
        """The gain, and the pair weights if there are any."""
        found: dict[str, Value] = {"gain": self.gain}
        return found | ({"weights": self.weights} if self.weights is not None else {})

    @property
    def structure(self) -> tuple[object, ...]:
        """The factors of the coefficient."""
        return ("Consensus", self.weights is not None, self.weighted, self.functional)

    @property
    def symmetries(self) -> frozenset[str]:
        """All; momentum only if the coefficient is the same for (i, j) and (j, i)."""
        each = isinstance(self.gain, np.ndarray)
        uneven = each or self.functional or not (self.weights is None or self.weights.symmetric)
        fixed = each or self.weights is not None
        return SYMMETRIES - ({"momentum"} if uneven else set()) - ({"relabelling"} if fixed else set())

    def drag(self, x: PairSymbols) -> sympy.Expr:
        """The product of gain, pair weight, graph weight and graph functional."""
        value = x.parameter("gain")
        if self.weights is not None:
            value = value * x.parameter("weights")
        if self.weighted:
            value = value * x.weight
        if self.functional:
            value = value * x.functional
        return value

    def dissipation(self, x: PairSymbols) -> sympy.Expr:
        """w_ij |p_j - p_i|^2: with equal weights both ways, the sum over links is p^T L p (Tanner (9), Zhou (14))."""
        return self.drag(x) * x.speed2

    def supply(self, x: PairSymbols) -> sympy.Expr:
        """Zero: all power is dissipated."""
        import sympy

        return sympy.Integer(0)


__all__ = ["Consensus", "Gradient", "HashedWeights", "MatrixWeights", "PairTerm", "Term", "Value"]
