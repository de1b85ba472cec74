"""Structural nets: realizations, energy, defect factor and the neighbours' vote (Olfati-Saber, sections 3-9)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import Array, array, integer, number
from flocking.model.graphs.connectivity import Links
from flocking.model.graphs.distance_graphs import Graph, pair_distances
from flocking.model.potentials.potential import Potential
from flocking.model.state import State
from flocking.study.nets.matrices import adjacency


def deviation(q: Array, links: Links, distance: float) -> float:
    """Largest | |q_j - q_i| - d | over the links, d the ``distance``; 0 for a net without links."""
    i, j = np.nonzero(links)
    if not len(i):
        return 0.0
    return float(np.abs(np.linalg.norm(np.asarray(q)[j] - np.asarray(q)[i], axis=1) - distance).max())


def is_realization(q: Array, distance: float, radius: float, tolerance: float = 1e-9) -> bool:
    """Whether q realizes the structural net (d, r): every pair within r has distance d (Olfati-Saber (20)).

    Parameters
    ----------
    q
        Positions, shape (N, m).
    distance, radius
        d_alpha and r.
    tolerance
        Accepted deviation, as a fraction of ``distance``.

    Raises
    ------
    InvalidInput
        If a position is not finite.
    """
    q = array("is_realization", "q", q, ndim=2)
    links = pair_distances(q) <= radius * (1.0 + 1e-12)
    return deviation(q, links, distance) <= tolerance * distance


@dataclass(frozen=True, eq=False)
class StructuralEnergy:
    """The terms of H_s(q, p~) = V(q) + K_r(p~) (Olfati-Saber (27), (28), (30)).

    Parameters
    ----------
    each
        V_i: potentials of agent i with its neighbours, shape (N,).
    potential
        V, half the sum of the V_i.
    relative_kinetic
        K_r, half the sum of |p_i - mean p|^2.
    """

    each: Array
    potential: float
    relative_kinetic: float

    @property
    def total(self) -> float:
        """H_s."""
        return self.potential + self.relative_kinetic


def _weights(graph: Graph, state: State, headings: Array | None) -> Array:
    return adjacency(graph, state.q, headings, state.links)


def structural_energy(
    graph: Graph, potential: Potential, state: State, headings: Array | None = None
) -> StructuralEnergy:
    """Structural energy of a net, with the weights a_ij of its graph."""
    weights = _weights(graph, state, headings)
    i, j = np.nonzero(weights)
    each = np.zeros(state.n)
    np.add.at(each, i, weights[i, j] * potential(np.linalg.norm(state.q[j] - state.q[i], axis=1)))
    relative = state.p - state.p.mean(axis=0)
    return StructuralEnergy(each, 0.5 * float(each.sum()), 0.5 * float((relative**2).sum()))


def vote_weights(graph: Graph, potential: Potential, state: State, headings: Array | None = None) -> Array:
    """Weights phi(r_ij)/r_ij of the links, phi the slope of the potential, shape (N, N) (Olfati-Saber (38)).

    Raises
    ------
    InvalidInput
        If linked agents are at one place, where they have no weight.
    """
    linked = _weights(graph, state, headings) > 0
    i, j = np.nonzero(linked)
    length = np.linalg.norm(state.q[j] - state.q[i], axis=1)
    if not (length > 0).all():
        together = int(np.argmin(length))
        raise InvalidInput(
            "vote_weights", "state", "must have linked agents at different places",
            f"agents {i[together]} and {j[together]} at one place",
        )  # fmt: skip
    result = np.zeros((state.n, state.n))
    result[i, j] = potential.slope(length) / length
    return result


@dataclass(frozen=True, eq=False)
class Vote:
    """Effect of the neighbours on one agent (Olfati-Saber (39)-(45)).

    Parameters
    ----------
    total
        S_i, the sum of the weights.
    positive, negative
        S_i^+ and S_i^-.
    case
        1 if S_i > 0: the agent moves towards ``average``. 2 if S_i < 0: it moves away from it. 3 if S_i = 0: it moves
        along the difference of ``average_positive`` and ``average_negative``.
    average
        Weighted average of the neighbours (40), shape (m,); NaN in case 3.
    average_positive, average_negative
        (43), shape (m,) each; NaN if there are no such weights.
    control
        The undamped control (39), computed from the averages by (41), (42) or (44), shape (m,).
    """

    total: float
    positive: float
    negative: float
    case: int
    average: Array
    average_positive: Array
    average_negative: Array
    control: Array


def vote(weights: Array, q: Array, agent: int, tolerance: float = 1e-12) -> Vote:
    """The vote of the neighbours on one agent.

    Parameters
    ----------
    weights
        w_ij, shape (N, N); see `vote_weights`.
    q
        Positions, shape (N, m).
    agent
        Number of the agent.
    tolerance
        A vote smaller than this fraction of the sum of |w_ij| counts as zero.

    Raises
    ------
    InvalidInput
        If a weight or a position is not finite, or there is no such agent.
    """
    q = array("vote", "q", q, ndim=2)
    if integer("vote", "agent", agent, least=0) >= len(q):
        raise InvalidInput("vote", "agent", f"must be below {len(q)}, the number of agents", agent)
    row = array("vote", "weights", weights, ndim=2)[agent]
    up, down = np.maximum(row, 0.0), np.minimum(row, 0.0)
    positive, negative = float(up.sum()), float(down.sum())
    total = positive + negative
    nowhere = np.full(q.shape[1], np.nan)
    plus = up @ q / positive if positive > 0 else nowhere
    minus = down @ q / negative if negative < 0 else nowhere
    if abs(total) > tolerance * (positive - negative):
        average = row @ q / total
        case = 1 if total > 0 else 2
        return Vote(total, positive, negative, case, average, plus, minus, total * (average - q[agent]))
    control = positive * (plus - minus) if positive > 0 else np.zeros(q.shape[1])
    return Vote(total, positive, negative, 3, nowhere, plus, minus, control)


@dataclass(frozen=True)
class Defect:
    """Deviation of a net from a realization (Olfati-Saber (46), (47)).

    Parameters
    ----------
    potential
        V(q).
    gradient_square
        |grad V(q)|^2 over all coordinates; of a directed net V has half of either link of a pair.
    links
        Number of links, each counted once.
    link_energy
        h_0 = psi(r), the potential of a link at the break radius (31); mu_n is defined where it is positive and finite.
    weight
        w.
    """

    potential: float
    gradient_square: float
    links: int
    link_energy: float
    weight: float

    @property
    def factor(self) -> float:
        """The factor mu = V + w |grad V|^2."""
        return self.potential + self.weight * self.gradient_square

    @property
    def normalized(self) -> float:
        """Normalized: mu_n = mu/(|E| h_0); 0 for a net without links, NaN where h_0 is not positive and finite."""
        if not self.links:
            return 0.0
        usable = np.isfinite(self.link_energy) and self.link_energy > 0.0
        return self.factor / (self.links * self.link_energy) if usable else float("nan")


def defect(
    graph: Graph, potential: Potential, state: State, *, weight: float = 0.01, headings: Array | None = None
) -> Defect:
    """Defect factor of a net: 0 exactly for realizations with zero potential (Olfati-Saber, Definition 3).

    Parameters
    ----------
    graph
        The graph; its `break_radius` is the r of h_0, its weights those of V.
    potential
        psi_alpha as a function of the distance.
    state
        Positions, and links for graphs with memory.
    weight
        w > 0. The paper gives no value; at an equilibrium under a sink grad V_i = -q_i, so it must be small.
    headings
        Headings, for graphs that depend on them.

    Raises
    ------
    InvalidInput
        If the weight is not positive or the graph has no finite radius.
    """
    w = number("defect", "weight", weight, above=0.0)
    radius = float(np.max(np.asarray(graph.break_radius)))
    if not np.isfinite(radius):
        raise InvalidInput("defect", "graph", "must have a radius at which links break", graph)
    still = State(state.q, None, state.t, state.links)
    forces = _descent(graph, potential, still, headings)
    matrix = _weights(graph, state, headings) > 0
    count = int(np.count_nonzero(np.triu(matrix | matrix.T)))
    energy = structural_energy(graph, potential, still, headings)
    return Defect(energy.potential, float((forces**2).sum()), count, float(potential(radius)), w)


def _descent(graph: Graph, potential: Potential, state: State, headings: Array | None) -> Array:
    """Forces -grad V, shape (N, m): the mean of the forces that the agents of a pair exert by either link."""
    from flocking.engine.reference.control import evaluate
    from flocking.model.law import Law
    from flocking.model.state import Agents
    from flocking.model.terms.pair_terms import Gradient

    law, agents = Law(graph, (Gradient(potential),)), Agents(headings=headings)
    if not graph.directed:
        return evaluate(law, state, agents=agents).u
    links = graph.start_links(state.q, headings) if state.links is None else np.asarray(state.links)
    # Neighbour by neighbour: what i gets by its link to j pushes j the other way in the gradient of V.
    found = np.zeros_like(state.q)
    for j in range(state.n):
        one = np.zeros_like(links)
        one[:, j] = links[:, j]
        forces = evaluate(law, replace(state, links=one), agents=agents).u
        found += 0.5 * forces
        found[j] -= 0.5 * forces.sum(axis=0)
    return found


def is_quasi_realization(defects: Sequence[Defect], *, most: float = 0.2, drift: float = 1e-3) -> bool:
    """Whether a net settled near a realization: mu_n at most ``most``, and constant over the samples (Definition 3).

    Parameters
    ----------
    defects
        Defects at successive times, in the limit.
    most
        Largest mu_n that counts as near.
    drift
        Largest spread of mu_n over the samples.

    Raises
    ------
    InvalidInput
        If there are no samples.
    """
    if not len(defects):
        raise InvalidInput("is_quasi_realization", "defects", "must be one defect or more", "none")
    values = np.array([d.normalized for d in defects])
    return bool(values.max() <= most and np.ptp(values) <= drift)
