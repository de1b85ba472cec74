"""Random states for the check of terms: symbols of the quantities of a term, and draws of their values."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from flocking.formula.stated_symbols import StatedSymbols
from flocking.model.checks import Array
from flocking.model.graphs.weights import PairWeights
from flocking.model.terms.schedules import Schedule
from flocking.model.terms.symbols import BodySymbols, ObstacleSymbols, PairSymbols

if TYPE_CHECKING:
    import sympy

    from flocking.model.graphs.distance_graphs import Graph
    from flocking.model.leaders_and_obstacles.leaders import Leader
    from flocking.model.terms.body_terms import BodyTerm
    from flocking.model.terms.pair_terms import PairTerm

COUNT = 2000
"""Number of random states in which a term is checked."""


LEAST_DISTANCE = 1e-12
"""Added to random distances, since formulas may be undefined at zero."""
MOST_VALUES = 64
"""Largest number of values of one parameter for draws, since there may be one per agent."""


def _symbol(name: str) -> sympy.Symbol:
    import sympy

    return sympy.Symbol(name, real=True)


class States:
    """Symbols of states and draws of their values.

    Parameters
    ----------
    lengths
        Distances at which formulas may change, and the scale of positions.
    """

    def __init__(self, lengths: Sequence[float]) -> None:
        self.lengths = tuple(sorted({float(x) for x in lengths if np.isfinite(x) and x > 0})) or (1.0,)
        self.constants: dict[sympy.Symbol, tuple[float, ...]] = {}
        """Values each parameter may have."""

    def parameter(self, owner: str, part: object, values: Mapping[str, object]) -> Callable[[str], sympy.Expr]:
        """Symbols of the parameters of a part, by name.

        Parameters
        ----------
        part, values
            The part and its parameters.
        """

        def named(name: str) -> sympy.Symbol:
            symbol = _symbol(f"{owner}_{name}")
            self.constants[symbol] = _values(values[name])
            return symbol

        return StatedSymbols(part).asked("x.parameter", named, lambda: values)


def draw(
    symbols: Sequence[sympy.Symbol], known: Mapping[sympy.Symbol, Sequence[float]], lengths: Sequence[float]
) -> Array:
    """Values of ``symbols`` in `COUNT` random states, shape (symbols, states).

    Parameters
    ----------
    known
        Values that parameters may have.
    lengths
        Distances at which formulas may change, in ascending order.
    """
    rng = np.random.default_rng(0)
    drawn = np.empty((len(symbols), COUNT))
    names = [str(s) for s in symbols]
    for row, symbol in zip(drawn, symbols, strict=True):
        row[:] = rng.choice(known[symbol], COUNT) if symbol in known else _drawn(str(symbol), lengths, rng)
    if normal := [k for k, name in enumerate(names) if name.startswith("normal")]:
        drawn[normal] /= np.sqrt((drawn[normal] ** 2).sum(axis=0))
    if "radial" in names and "speed2" in names:
        # No pair separates faster than its relative speed.
        row = drawn[names.index("radial")]
        row[:] = np.sqrt(drawn[names.index("speed2")]) * np.tanh(row)
    return drawn


def _drawn(name: str, lengths: Sequence[float], rng: np.random.Generator) -> Array:
    if name == "r":
        return _distances(lengths, rng)
    if name == "distance":
        return np.asarray(_distances(lengths, rng) * rng.choice([-1.0, 1.0], COUNT))
    if name in ("speed2", "mass", "functional"):
        return np.asarray(np.exp(rng.normal(size=COUNT)))
    if name == "damping":
        return np.asarray(rng.choice([0.0, 1.0], COUNT) * rng.exponential(size=COUNT))
    size = np.exp(rng.normal(size=COUNT)) * (lengths[-1] if name.startswith("q") else 1.0)
    return np.asarray(rng.normal(size=COUNT) * size)


def _distances(lengths: Sequence[float], rng: np.random.Generator) -> Array:
    """Distances of all magnitudes, and close to those at which formulas change."""
    places = rng.choice(lengths, COUNT)
    near = places * (1 + rng.choice([-1.0, 1.0], COUNT) * 10.0 ** rng.uniform(-6, 0, COUNT))
    within = places * rng.random(COUNT)
    wide = places * 10.0 ** rng.uniform(-3, 3, COUNT)
    chosen = np.choose(rng.integers(3, size=COUNT), [near, within, wide])
    return np.asarray(np.abs(chosen) + LEAST_DISTANCE)


class PairStates(States):
    """States of an ordered pair of a term over a graph.

    Parameters
    ----------
    term
        The term.
    """

    def __init__(self, term: PairTerm, graph: Graph) -> None:
        import sympy

        radii = [float(np.max(x)) for x in (graph.appear_radius, graph.break_radius)]
        super().__init__([*radii, *term.kinks(), *graph.kinks()])
        r = sympy.Symbol("r", positive=True)
        weight = graph.weight(r, self.parameter("graph", graph, graph.parameters))
        self.symbols = PairSymbols(
            r, weight, _symbol("speed2"), _symbol("radial"), _symbol("functional"),
            self.parameter("term", term, term.parameters),
        )  # fmt: skip


class BodyStates(States):
    """States of one agent under a body term.

    Parameters
    ----------
    term
        The term.
    moving
        Whether the frame of the energy moves; the lab frame otherwise.
    """

    def __init__(self, term: BodyTerm, dimension: int, moving: bool) -> None:
        import sympy

        super().__init__([getattr(term, "range", 1.0)])
        self.dimension = dimension
        t = _symbol("t")
        q, p, mean_q, mean_p = (self.vector(name) for name in ("q", "p", "mean_q", "mean_p"))
        frame_q = self.vector("q_frame") if moving else None
        frame_p: Sequence[sympy.Expr] = self.vector("frame_p") if moving else [sympy.Integer(0)] * dimension
        place, velocity, acceleration = self._motion(term.leader, t)
        self.symbols = BodySymbols(
            q, p, t, _symbol("mass"), _symbol("damping"), mean_q, mean_p, frame_q, frame_p,
            place, velocity, acceleration, self.parameter("term", term, term.parameters),
        )  # fmt: skip
        self.rates: dict[sympy.Expr, sympy.Expr] = {t: sympy.Integer(1)}
        """Rate of change of every symbol that changes with time."""
        moved: list[tuple[Sequence[sympy.Expr], Sequence[sympy.Expr]]] = [(q, p), (mean_q, mean_p)]
        moved += [(frame_q, frame_p)] if frame_q is not None else []
        if term.leader is not None and not term.leader.closed_form:
            moved.append((place, velocity))
        for places, velocities in moved:
            self.rates |= dict(zip(places, velocities, strict=True))

    def vector(self, name: str) -> list[sympy.Symbol]:
        """Symbols of a vector."""
        return [_symbol(f"{name}{k}") for k in range(self.dimension)]

    def _motion(
        self, leader: Leader | None, t: sympy.Symbol
    ) -> tuple[Sequence[sympy.Expr], Sequence[sympy.Expr], Sequence[sympy.Expr]]:
        import sympy

        if leader is None:
            zero = [sympy.Integer(0)] * self.dimension
            return zero, zero, zero
        parameter = self.parameter("leader", leader, leader.parameters)
        place = leader.position(t, parameter) if leader.closed_form else None
        return (
            place if place is not None else self.vector("q_leader"),
            leader.velocity(t, parameter),
            leader.acceleration(t, parameter),
        )

    def near_obstacle(self, anchored: bool) -> ObstacleSymbols:
        """Symbols of an agent near an obstacle.

        Parameters
        ----------
        anchored
            Whether the obstacle has a centre.
        """
        x = self.symbols
        return ObstacleSymbols(
            x.q, x.p, x.t, x.mass, _symbol("distance"), self.vector("normal"), self.vector("boundary"),
            self.vector("q_anchor") if anchored else None, x.frame_p, x.leader_q, x.leader_p, x.leader_a, x.parameter,
        )  # fmt: skip


def _values(value: object) -> tuple[float, ...]:
    """Possible values of a parameter."""
    if isinstance(value, PairWeights):
        return (0.25, 0.5, 1.0, 2.0)
    if isinstance(value, Schedule):
        return tuple(float(x) for x in np.unique(np.array(value)))[:MOST_VALUES]
    return tuple(float(x) for x in np.unique(np.asarray(value, dtype=np.float64)))[:MOST_VALUES]
