"""Nonsmooth analysis of potentials with kinks: generalized derivatives, Filippov sets, set-valued rates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from flocking.engine.reference.control import evaluate
from flocking.errors import InvalidInput
from flocking.model.checks import Array
from flocking.model.graphs.connectivity import Links
from flocking.model.graphs.distance_graphs import Graph, pair_distances
from flocking.model.law import Law
from flocking.model.potentials.potential import Potential
from flocking.model.state import State
from flocking.model.terms.pair_terms import Gradient

NEAR = 1e-9
"""Two slopes closer than this fraction of their size, or of curvature times distance, count as one; so do two distances
closer than this fraction of theirs."""

MOST_PAIRS = 12
"""Most pairs at their switching distance at once, a bound on time: the Filippov set has 2^12 = 4096 corners then."""

STEPS = 2.0 ** -np.arange(20, 32)
"""Relative steps at which one-sided slopes are taken: the last leaves half of the digits."""


def one_sided_slopes(potential: Potential, r: float) -> tuple[float, float]:
    """Slopes of the potential just below and just above ``r``, each a limit of derivatives at nearby points.

    Parameters
    ----------
    potential
        The potential.
    r
        A positive distance at which it is finite.
    """
    steps = r * STEPS
    left, right = potential.slope(r - steps), potential.slope(r + steps)
    # Richardson's extrapolation to a step of zero.
    return float(2 * left[-1] - left[-2]), float(2 * right[-1] - right[-2])


def generalized_gradient(potential: Potential, r: float) -> tuple[float, float]:
    """Clarke's generalized gradient at ``r`` as an interval (Tanner II, Definition V.3).

    It is the convex hull of the limits of the slopes around ``r`` (Theorem V.4): one number where the potential
    is smooth, an interval at a kink, and never empty for a locally Lipschitz function.
    """
    left, right = one_sided_slopes(potential, r)
    return min(left, right), max(left, right)


def directional_derivative(potential: Potential, r: float, w: float) -> float:
    """The usual one-sided derivative f'(r; w) in the direction ``w``."""
    left, right = one_sided_slopes(potential, r)
    return w * (right if w > 0 else left)


def generalized_derivative(potential: Potential, r: float, w: float) -> float:
    """Clarke's generalized derivative at ``r`` along ``w``: the largest zeta w, zeta in the generalized gradient.

    It is the limit superior of difference quotients (Tanner II, Definition V.2).
    """
    return max(w * zeta for zeta in generalized_gradient(potential, r))


def is_regular(potential: Potential, r: float) -> bool:
    """Whether the two derivatives agree in every direction (Tanner II, Definition V.5).

    They agree where the slope rises at a kink, and do not where it falls.
    """
    left, right = one_sided_slopes(potential, r)
    # Where both slopes vanish the terms that cancel in them are of the size of curvature times distance.
    bent = r * np.abs(potential.curvature(r * np.array([1.0 - STEPS[-1], 1.0 + STEPS[-1]])))
    return bool(right >= left - NEAR * max(abs(left), abs(right), *bent))


def pairs_at_switch(law: Law, state: State) -> list[tuple[int, int]]:
    """Pairs at the distance at which their link appears or breaks: i < j, or of directed graphs i that senses j.

    With the links of the state, those that there are may break and others appear, each at its own radius; without them
    the initial rule of the graph decides, whose radius is that at which links break.

    Raises
    ------
    InvalidInput
        When links depend on headings too, or pairs are at the radius of a further graph of the law.
    """
    graph = law.graph
    if any(g.sees_headings for g in law.graphs):
        raise InvalidInput(
            "pairs_at_switch", "law", "must have graphs of distances alone", graph,
            "Views and cones switch at directions too.",
        )  # fmt: skip
    for other in law.graphs[1:]:
        if _at_radius(other, state.q, None).any():
            raise InvalidInput(
                "pairs_at_switch", "state", "must have no pairs at the radius of a further graph of the law", other
            )
    found = _at_radius(graph, state.q, state.links)
    i, j = np.nonzero(found if graph.directed else np.triu(found))
    return [(int(a), int(b)) for a, b in zip(i, j, strict=True)]


def _at_radius(graph: Graph, q: Array, links: Links | None) -> Links:
    """Which links of a graph are at a distance at which they switch, shape (N, N)."""
    distance = pair_distances(q)
    leaves, enters = (
        np.broadcast_to(np.reshape(np.asarray(r, dtype=np.float64), (-1, 1)), distance.shape)
        for r in (graph.break_radius, graph.appear_radius)
    )
    radius = leaves if links is None else np.where(links, leaves, enters)
    known = np.isfinite(radius) & np.isfinite(distance) & (radius > 0)
    near = np.zeros(distance.shape, dtype=bool)
    near[known] = np.abs(distance[known] - radius[known]) <= NEAR * radius[known]
    return near & graph.moves


def filippov_corners(law: Law, state: State) -> Array:
    """Corners of Filippov's set K[u] at a state (Tanner II, Definition V.1), shape (K, N, m).

    The limits of the control from all sides of the switching surface are the controls under each choice of the links
    of the pairs on it.

    Raises
    ------
    InvalidInput
        When more than 12 pairs are at their switching distance, linked agents are at a distance at which the force of a
        potential jumps, or for graphs as in `pairs_at_switch`.
    """
    for term in law.pair_terms:
        if isinstance(term, Gradient):
            _check_no_kink(law, term, state)
    return np.array([evaluate(law, choice).u for choice in _sides(law, state)])


def _check_no_kink(law: Law, term: Gradient, state: State) -> None:
    """Refuse linked agents where the slope of a potential jumps: no choice of links gives its sides."""
    graph = law.graph if term.over is None else term.over
    given = state.links if graph is law.graph else None
    linked = np.asarray(graph.initial(state.q) if given is None else given)
    r = pair_distances(state.q)[linked]
    for border in term.potential.kinks():
        left, right = one_sided_slopes(term.potential, border)
        if (np.abs(r - border) <= NEAR * border).any() and abs(left - right) > NEAR * max(abs(left), abs(right)):
            raise InvalidInput(
                "filippov_corners", "state", "must have no linked agents at a kink of the potential of the law",
                f"a distance of {border:.9g}", "Give the law the formula without the kink, and the graph its radius.",
            )  # fmt: skip


def _few(pairs: Sequence[object]) -> None:
    if len(pairs) > MOST_PAIRS:
        raise InvalidInput(
            "filippov_corners", "state", f"must have at most {MOST_PAIRS} pairs at the radius", len(pairs)
        )


def _sides(law: Law, state: State) -> list[State]:
    """The state with each choice of links of the pairs on their switching distance."""
    pairs = pairs_at_switch(law, state)
    _few(pairs)
    links = np.array(law.graph.initial(state.q) if state.links is None else state.links)
    found = []
    for choice in product((False, True), repeat=len(pairs)):
        for (i, j), linked in zip(pairs, choice, strict=True):
            links[i, j] = linked
            if not law.graph.directed:
                links[j, i] = linked
        found.append(replace(state, links=links))
    return found


@dataclass(frozen=True)
class Rates:
    """Set-valued rate of an energy at a state: every rate lies in [low, high].

    Parameters
    ----------
    low, high
        Ends of the interval; empty when low > high.
    """

    low: float
    high: float

    @property
    def empty(self) -> bool:
        """Whether there is no such rate, as may be where the energy is not regular."""
        return self.low > self.high


def energy_rates(law: Law, potential: Potential, state: State) -> Rates:
    """Set-valued rate of potential plus kinetic energy along the law (Tanner II, Theorem V.6 and (10)).

    The intersection over all xi of the generalized gradient of the interval xi^T K[f]. It is one number off the
    switching surface, and may be empty on it, since the energy is not regular there. The potential is the one of
    all pairs, constant beyond the radius; the control is that of the law on all sides of the switching surface.

    Parameters
    ----------
    law
        The control law.
    potential
        Potential of every pair, with its kink at the radius.
    state
        The state.

    Raises
    ------
    InvalidInput
        When agents are at one place, more than 12 pairs are at kinks of the potential, or as in `filippov_corners`.
    """
    from scipy.optimize import linprog

    if state.n > 1 and not pair_distances(state.q).min() > 0.0:
        raise InvalidInput("energy_rates", "state", "must have agents at different places", "two at one place")
    flows = np.array([np.sum(state.p * u) for u in filippov_corners(law, state)])
    kinks = _at_kinks(potential, state)
    _few(kinks)
    slopes = np.array([_stored_rate(potential, state, choice) for choice in product((0, 1), repeat=len(kinks))])
    table = slopes[:, None] + flows[None, :]

    # The best xi for the worst flow is the value of a matrix game, whose mixed strategies are the convex hulls.
    def value(game: Array) -> float:
        rows, columns = game.shape
        solved = linprog(
            np.r_[np.zeros(rows), -1.0], A_ub=np.c_[-game.T, np.ones(columns)], b_ub=np.zeros(columns),
            A_eq=[[*np.ones(rows), 0.0]], b_eq=[1.0], bounds=[*[(0, None)] * rows, (None, None)],
        )  # fmt: skip
        return float(np.asarray(solved.x)[-1])

    return Rates(value(table), -value(-table))


def _at_kinks(potential: Potential, state: State) -> list[tuple[int, int]]:
    """Pairs i < j at a distance at which two pieces of the potential meet."""
    distance, found = pair_distances(state.q), np.zeros((state.n, state.n), dtype=bool)
    for border in potential.kinks():
        found |= np.abs(distance - border) <= NEAR * border
    return [(int(i), int(j)) for i, j in np.argwhere(np.triu(found))]


def _stored_rate(potential: Potential, state: State, choice: tuple[int, ...]) -> float:
    """Rate of the stored energy when every pair on a kink takes its left (0) or right (1) slope."""
    sides = dict(zip(_at_kinks(potential, state), choice, strict=True))
    rate = 0.0
    for i in range(state.n):
        for j in range(i + 1, state.n):
            d = state.q[j] - state.q[i]
            r = float(np.linalg.norm(d))
            side = sides.get((i, j))
            slope = float(potential.slope(r)) if side is None else one_sided_slopes(potential, r)[side]
            rate += slope * float(d @ (state.p[j] - state.p[i])) / r
    return rate
