"""Distances of pairs that the exact engine watches: where links appear and break, and where formulas have a kink."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from flocking.model.checks import Array
from flocking.model.law import Law
from flocking.model.terms.pair_terms import Consensus, Gradient, PairTerm

BESIDE, EQUAL_VALUES = 1e-12, 1e-9
"""Relative distance from a kink at which values of a potential are compared, and their largest difference that is no
jump, relative to the values about the kink."""

NEARBY = np.array([0.9, 0.99, 1.01, 1.1])
"""Distances over that of a kink at which these values are: those at it may be zero, or nearly cancel."""

BESIDE_SLOPE, EQUAL_SLOPES = 1e-9, 1e-6
"""The same for slopes, which change faster and round more."""


@dataclass(frozen=True)
class Watch:
    """One set of distances to watch: the links of a graph, or a kink of its formulas.

    Parameters
    ----------
    kind
        ``"link"`` or ``"kink"``; ``"obstacle"`` or ``"rim"`` for pairs (agent, obstacle), see `Level`. Groups of
        obstacles are numbered after the graphs.
    enter, leave
        Distances per sensing agent, shape (N,).
    rise
        Jump of the stored energy of a pair as it leaves: not zero if pieces of a formula do not meet.
    smooth
        Whether the force is continuous there: then nothing can slide, and a crossing by less than `GRAZE` of the
        distance changes the force by less than the tolerance.
    """

    graph: int
    kind: str
    enter: Array
    leave: Array
    rise: float = 0.0
    smooth: bool = False

    @cached_property
    def farthest(self) -> float:
        """The largest distance at which a pair leaves."""
        return float(self.leave.max())

    @property
    def inner(self) -> bool:
        """Whether pieces of a formula meet there, inside the reach of the link or the obstacle."""
        return self.kind in ("kink", "rim")

    def switch_kind(self, outward: bool) -> str:
        """Kind of a switch there, as in `SWITCH_FIELDS`; ``outward``: what was nearer goes further away."""
        if self.kind == "link":
            return "break" if outward else "appear"
        return "kink" if self.inner else self.kind

    def level(self, i: int, near: bool) -> float:
        """The distance that agent ``i`` and another one cross: outwards if they are ``near``, within it."""
        return float((self.leave if near else self.enter)[i])

    def is_where(self, other: Watch) -> bool:
        """Whether it watches the same distances of the same pairs as an ``other`` watch."""
        alike = (self.graph, self.kind) == (other.graph, other.kind)
        return alike and bool((self.enter == other.enter).all() and (self.leave == other.leave).all())


def watches_of(law: Law, n: int) -> list[Watch]:
    """Every distance to watch for pairs of ``n`` agents under a law."""
    found = []
    for number, graph in enumerate(law.graphs):
        enter, leave = (np.full(n, radius, dtype=np.float64) for radius in (graph.appear_radius, graph.break_radius))
        if graph.moves:
            found.append(Watch(number, "link", enter, leave))
        kinks = set(graph.kinks())
        for term in law.pair_terms:
            if law.graph_number(term) == number:
                kinks |= set(term.kinks())
        for distance in sorted(k for k in kinks if k < float(leave.max())):
            terms = [t for t in law.pair_terms if law.graph_number(t) == number]
            rise = sum(_rise(t, distance) for t in terms)
            smooth = not rise and all(_meets(t, distance) for t in terms)
            found.append(Watch(number, "kink", np.full(n, distance), np.full(n, distance), rise, smooth))
    return found


def _rise(term: PairTerm, distance: float) -> float:
    if not isinstance(term, Gradient):
        return 0.0
    inside, outside = term.potential(distance * (1 + np.array([-BESIDE, BESIDE])))
    rise = float(outside - inside)
    return rise if abs(rise) > EQUAL_VALUES * _size(term.potential(distance * NEARBY), inside, outside) else 0.0


def _meets(term: PairTerm, distance: float) -> bool:
    """Whether the force of a term is continuous at a kink of its own formulas; graph weights always are."""
    if not isinstance(term, Gradient) or distance not in term.kinks():
        return isinstance(term, Gradient | Consensus)
    inside, outside = term.potential.slope(distance * (1 + np.array([-BESIDE_SLOPE, BESIDE_SLOPE])))
    return bool(abs(outside - inside) <= EQUAL_SLOPES * _size(term.potential.slope(distance * NEARBY), inside, outside))


def _size(values: Array, inside: float, outside: float) -> float:
    """Largest absolute value of those that are finite."""
    found = np.abs([*values, inside, outside])
    return float(found[np.isfinite(found)].max(initial=0.0))
