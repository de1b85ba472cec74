"""Computed counter-examples to statements of Olfati-Saber: the value by the printed form, and the true value."""

from __future__ import annotations

import numpy as np

from flocking.engine.driver.simulate import simulate
from flocking.engine.reference.control import control
from flocking.model.checks import Array
from flocking.model.graphs.distance_graphs import Graph, Proximity, pair_distances
from flocking.model.graphs.smooth_cones import SmoothCone
from flocking.model.graphs.smooth_graphs import Smooth
from flocking.model.graphs.views import Cone, FieldOfView
from flocking.model.law import Law
from flocking.model.potentials.bumps import BUMPS
from flocking.model.potentials.structural_potential import structural_potential
from flocking.model.state import State
from flocking.model.terms.pair_terms import Gradient
from flocking.papers.equation_table import Demonstration
from flocking.papers.olfati_saber_2003 import examples_energy as energies
from flocking.papers.olfati_saber_2003 import examples_nets as examples
from flocking.papers.olfati_saber_2003 import examples_obstacles as obstacles
from flocking.papers.olfati_saber_2003 import examples_protocols as protocols
from flocking.papers.olfati_saber_2003 import structural_nets as structure
from flocking.papers.olfati_saber_2003 import system
from flocking.papers.olfati_saber_2003.conformations import conformations, count
from flocking.study.nets import matrices as nets

# -- nets -----------------------------------------------------------------------------------------------


def one_way_links(net: Array) -> float:
    """Number of links without the reverse link.

    Parameters
    ----------
    net
        Adjacency matrix, shape (N, N).
    """
    return float(((net > 0) & (net.T == 0)).sum())


def directed_nets(graph: Graph) -> float:
    """Number of random clusters of six agents, of a hundred, whose net has a link without the reverse link.

    Parameters
    ----------
    graph
        The graph.
    """
    rng = np.random.default_rng(18)
    drawn = [(10 * rng.random((6, 2)), 2 * np.pi * rng.random(6)) for _ in range(100)]
    return float(sum(one_way_links(nets.adjacency(graph, q, headings)) > 0 for q, headings in drawn))


def undirected_cone() -> Demonstration:
    """After (6): the condition of (5) on headings is symmetric, so a uniform net of this kind is not directed."""
    assert directed_nets(FieldOfView(system.RADIUS, np.pi / 3)) == 100
    return Demonstration(
        100.0, directed_nets(Cone(system.RADIUS, 1.0)), 0.5,
        "directed nets among those of (5) for a hundred clusters: all in general position, and counted",
    )  # fmt: skip


def undirected_smooth_cone() -> Demonstration:
    """(18): likewise."""
    return Demonstration(
        100.0, directed_nets(SmoothCone(system.RADIUS, system.ONSET, 1.0)), 0.5,
        "directed nets among those of (18) for a hundred clusters: all in general position, and counted",
    )  # fmt: skip


def in_degree() -> Demonstration:
    """(9): the sum over N_i omits agents that sense i without being sensed by it."""
    net = examples.directed_net(1.0)
    printed = np.where(net > 0, net.T, 0.0).sum(axis=1)
    return Demonstration(
        float(printed.sum()),
        float(nets.in_degree(net).sum()),
        1e-12,
        "in-degrees of six agents added up: over N_i, and over all j; there are as many links",
    )


def unbalanced_view() -> Demonstration:
    """Proposition 1 i): a uniform net of fields of view is not balanced."""
    net = examples.field_of_view()
    gap = float(np.abs(nets.in_degree(net) - nets.out_degree(net)).max())
    return Demonstration(0.0, gap, 1e-12, "largest |in-degree - out-degree| of six agents with the same field of view")


def column_sum() -> Demonstration:
    """Proof of Proposition 1: the column sums of L are out-degree minus in-degree."""
    net = examples.directed_net(1.0)
    i = int(np.argmax(np.abs(nets.in_degree(net) - nets.out_degree(net))))
    printed = float(nets.in_degree(net)[i] - nets.out_degree(net)[i])
    return Demonstration(printed, float(nets.laplacian(net)[:, i].sum()), 1e-12, "a column sum of L of six agents")


def unweighted_agreement() -> Demonstration:
    """(13) with a smooth adjacency matrix lacks its weights."""
    q = np.array([[0.0, 0.0], [7.8, 0.0]])
    net, theta = nets.adjacency(Smooth(system.RADIUS, system.ONSET), q), np.array([0.0, 1.0])
    printed = float(sum(theta[j] - theta[0] for j in np.flatnonzero(net[0])))
    return Demonstration(
        printed,
        float(-(nets.laplacian(net) @ theta)[0]),
        1e-12,
        "omega of one of two agents 7.8 apart: as printed, and -L theta",
    )


def own_weight() -> Demonstration:
    """(17) gives a_ii = rho(0) = 1."""
    printed = float(BUMPS["cosine"](0.0, system.ONSET))
    return Demonstration(printed, float(examples.smooth_net(1.0)[0, 0]), 1e-12, "a_ii as printed, and as below (8)")


def thin_rhombus() -> Demonstration:
    """An equilateral polygon need not realize a cycle: corners may come within r across it."""
    angle = 2 * np.arcsin(1.1 / 2)
    q = system.DISTANCE * np.array(
        [[0.0, 0.0], [1.0, 0.0], [1 + np.cos(angle), np.sin(angle)], [np.cos(angle), np.sin(angle)]]
    )
    links = Proximity(system.RADIUS).initial(q)
    return Demonstration(4.0, float(np.triu(links).sum()), 0.5, "links of a rhombus with a diagonal of 1.1 sides")


def ten_conformations() -> Demonstration:
    """Remark 3: f(4, k) is 10 for 1 < k < sqrt 2; every one is placed and checked."""
    found = 0
    for shape in conformations(4, 1.2):
        q = shape.placed(1.0, 1.2)
        linked = pair_distances(q) <= 1.2
        found += bool((linked == shape.links).all() and structure.is_realization(q, 1.0, 1.2))
    assert found == count(4, 1.2)
    return Demonstration(9.0, float(found), 0.5, "realizations of different conformations of four agents for k = 1.2")


# -- energy and protocols -------------------------------------------------------------------------------


def distance_rate() -> Demonstration:
    """A.1, A.2: d/dt |q_j - q_i|^2 is twice the printed product."""
    q, p, step = np.array([3.0, 1.0]), np.array([0.5, -1.0]), 1e-6
    true = (((q + step * p) ** 2).sum() - ((q - step * p) ** 2).sum()) / (2 * step)
    return Demonstration(
        float(p @ q), float(true), 1e-6, "d/dt |q_j - q_i|^2 for a relative position (3, 1), velocity (1/2, -1)"
    )


def settled_with_energy() -> Demonstration:
    """Definition 2 ii): an agent inside a ring of five others is at rest with V > 0, so H_s does not tend to 0."""
    state = energies.wheel()
    assert np.abs(control(Law(system.hard_net(), system.alpha_terms()), state)).max() < 1e-9
    found = structure.structural_energy(system.hard_net(), energies.potential(), state).total
    return Demonstration(0.0, found, 1e-9, "H_s of a wheel of six agents at rest in balance under (34), for ever")


def smooth_bound() -> Demonstration:
    """(37) with the smooth V: close to r the weight vanishes faster than its slope."""
    q = np.array([[0.0, 0.0], [0.99 * system.RADIUS, 0.0]])
    net, psi = system.smooth_net(), energies.potential()
    exact, rough = (control(Law(net, (Gradient(psi, weighting=w),)), State(q)) for w in ("energy", "force"))
    smooth = structure.structural_energy(net, psi, State(q)).potential
    bound = 2 * net.shape.steepest(system.ONSET) / system.RADIUS * smooth
    error = float(np.linalg.norm(exact - rough, axis=1).sum())
    # The statement is an inequality, which an error above the bound refutes.
    return Demonstration(
        max(bound, error) if error <= bound else bound,
        error,
        1e-9,
        "two agents 0.99 r apart: the bound with the smooth V, and the error it should bound",
    )


def weak_repulsion() -> Demonstration:
    """After (38): phi(d_alpha) is below a = 1; the repulsion of agents at the same point is |phi(-d_alpha)| < b."""
    psi = structural_potential(system.DISTANCE)
    return Demonstration(
        float(psi.slope(2 * system.DISTANCE)),
        abs(float(psi.slope(0.0))),
        1e-9,
        "repulsion of two agents at the same point: phi(d_alpha) as printed, and the true value",
    )


def too_close() -> Demonstration:
    """Case ii): a negative vote is due to neighbours closer than d_alpha."""
    state, vote = protocols.negative_vote(1.0)
    assert vote.total < 0
    farthest = float(np.linalg.norm(state.q[1:] - state.q[0], axis=1).max())
    return Demonstration(
        1.0,
        float(farthest > system.DISTANCE),
        0.5,
        "whether a neighbour is farther than d_alpha from an agent whose vote is negative",
    )


def rising_sequence() -> Demonstration:
    """Remark 5: from one switch to the next H_s may rise."""
    from flocking.papers.olfati_saber_2003.examples_runs import free

    rise = max(-result.margin for result in free(1.0)["decreasing"].results)
    return Demonstration(
        min(0.0, rise),
        rise,
        1e-6,
        "largest rise of H_s from one switching time to the next in runs of 30 agents under (34)",
    )


def mean_for_relative() -> Demonstration:
    """Section 10 prints H_s(q, p-bar): with the mean velocity for the relative ones its rate depends on u-bar."""
    state, both, alone = protocols.separated(1.0)
    mean = state.p.mean(axis=0)
    # V changes equally under both controls; only the rate of n |p-bar|^2/2 differs.
    return Demonstration(
        0.0,
        float(state.n * mean @ (both - alone).mean(axis=0)),
        1e-9,
        "change of the rate of V + n |p-bar|^2/2 when u-bar is added, for twelve agents",
    )


def velocity_without_bar() -> Demonstration:
    """(65) prints H_tr = |p - p_d|^2/2: for the velocities of all agents its rate is different."""
    state, rate = protocols.velocity_rate(1.0)
    u = control(protocols.with_controller(system.alpha_terms(), False, 1.0), state)
    true = float(((state.p - np.asarray(system.DESIRED_VELOCITY)) * u).sum())
    return Demonstration(rate, true, 1e-6, "the printed rate, and that of |p - p_d|^2/2 over twelve agents")


def crushed() -> Demonstration:
    """(50) with a = 1, b = 5: the sink compresses the group."""
    scenario = system.sink_scenario(0, a=system.ATTRACTION, b=system.REPULSION, agents=30)
    run = simulate(scenario.with_(frames=(0.0, 10.0), t_end=10.0, name=""), progress=False)
    closest = float(pair_distances(run.q[-1]).min())
    return Demonstration(
        system.DISTANCE,
        closest,
        0.5 * system.DISTANCE,
        "closest pair of thirty agents after 10 s at a sink with a = 1, b = 5; d_alpha is 7",
    )


def saddle() -> Demonstration:
    """A.2: three linked agents at rest in a line in balance are their own limit, but V decreases sideways."""
    net, state, forces = energies.line_in_balance(1.0)
    assert np.abs(forces).max() < 1e-12
    aside = np.array(state.q)
    aside[1, 1] = 0.1
    psi = energies.potential()
    here, there = (structure.structural_energy(net, psi, State(q)).potential for q in (state.q, aside))
    return Demonstration(
        0.0, there - here, 1e-9, "change of V when the middle one of three agents in balance moves 0.1 sideways: 0 or"
        " more, and computed",
    )  # fmt: skip


# -- obstacles ------------------------------------------------------------------------------------------


def bracket() -> Demonstration:
    """(54): the bracket must enclose distance minus d_beta, as in (34)."""
    psi = obstacles.avoidance().repulsion
    distance = 2.0
    phi = float(psi.slope(system.BETA_RANGE + distance))  # phi_beta(distance): the potential is shifted by d_beta.
    return Demonstration(
        phi - system.BETA_RANGE,
        float(psi.slope(distance)),
        1e-9,
        "force at distance 2: phi_beta(2) - d_beta as printed, and phi_beta(2 - d_beta)",
    )


def passes_alone() -> Demonstration:
    """Sec. 11: an agent off the axis passes an obstacle without a gamma-agent."""
    without, _ = obstacles.passing_alone(1.0)
    behind = float(without[0] > obstacles.CENTRE[0] + obstacles.SIZE)
    return Demonstration(0.0, behind, 0.5, "number of agents past the obstacle after 4 s, of one without a gamma-agent")


def rows_for_columns() -> Demonstration:
    """(59): a row of the matrix has six entries; obstacles are its columns."""
    return Demonstration(
        float(system.OBSTACLES.shape[0]),
        float(len(system.obstacles())),
        0.5,
        "number of obstacles: rows of the matrix, and m",
    )


def wrong_axis() -> Demonstration:
    """p_d: along y no agent from the start of Fig. 7 would come near an obstacle or the gap."""
    start = system.obstacle_scenario(0).start.q
    direction = np.array([0.0, 1.0])

    def met(way: Array) -> float:
        reach = 0
        for ball in system.obstacles():
            offset = ball.centre.at(0.0)[0] - start
            along = offset @ way
            across = np.abs(offset[:, 0] * way[1] - offset[:, 1] * way[0])
            reach += bool(((along > 0) & (across < ball.radius + system.BETA_RANGE)).any())
        return float(reach)

    return Demonstration(
        met(direction), met(direction[::-1]), 0.5, "obstacles in the way along y as printed, and along x"
    )
