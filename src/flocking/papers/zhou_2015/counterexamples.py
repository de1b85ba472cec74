"""Computed counter-examples to statements of Zhou, Zhou and Zeng."""

from __future__ import annotations

import numpy as np

from flocking.engine.driver.simulate import simulate
from flocking.engine.reference.control import evaluate
from flocking.model.checks import Array
from flocking.model.graphs.connectivity import is_connected
from flocking.model.graphs.distance_graphs import pair_distances
from flocking.model.law import Law, Scenario
from flocking.model.leaders_and_obstacles.leaders import Velocity
from flocking.model.state import State
from flocking.model.terms.body_terms import Track
from flocking.model.terms.pair_terms import Consensus, Gradient
from flocking.papers.equation_table import Demonstration
from flocking.papers.zhou_2015 import examples, system
from flocking.study.evidence import Evidence
from flocking.study.potentials.state_energy import total_energy


def printed_indicator(linked: bool, distance: float) -> set[int]:
    """Values of sigma that the printed (1) allows for a pair at ``distance``.

    Parameters
    ----------
    linked
        Whether the pair was linked before.
    """
    band = not linked and system.RADIUS - system.GAP <= distance < system.RADIUS
    values = set()
    if band or distance >= system.RADIUS:
        values.add(0)
    if band or distance < system.RADIUS - system.GAP:
        values.add(1)
    return values


def indicator() -> Demonstration:
    """(1): in the band r - eps <= d < r an unlinked pair gets both values as printed, a linked pair none."""
    unlinked, linked = printed_indicator(False, 3.95), printed_indicator(True, 3.95)
    net, q = system.graph(), np.array([[0.0, 0.0], [3.95, 0.0]])
    unchanged = [int(net.update(q, np.array([[False, memory], [memory, False]]))[0, 1]) for memory in (False, True)]
    right = sum(values == {value} for values, value in zip((unlinked, linked), unchanged, strict=True))
    return Demonstration(
        float(right),
        2.0,
        0.5,
        "cases of a pair at 3.95, unlinked and linked, that the printed (1) decides as (i)-(iii) do",
    )


def initial_distances() -> Demonstration:
    """Rules (ii), (iii): with ||s_i(0) - s_j(0)||, as printed, every pair that they link is linked from the start."""
    run = simulate(system.scenario(seed=0), progress=False)
    net = system.graph()
    printed = np.triu(pair_distances(run.q[0]) < net.appear_radius) & ~run.links_at(0)
    created = Evidence(run).links_created
    return Demonstration(
        float(printed.sum()), float(created), 0.5, "links created under the printed (iii), and in a run"
    )


def coinciding_goal() -> Demonstration:
    """Sec. 2.2: s_1 = ... = s_N does not hold for agents at rest in balance."""
    state, _ = examples.balance_of(1.0)
    return Demonstration(
        0.0, float(pair_distances(state.q).min()), 1e-3, "smallest distance of four agents at rest in balance"
    )


def not_invariant() -> Demonstration:
    """(19): agents with one velocity are in S, and leave it where their forces do not balance."""
    start = examples.example_state()
    state = State(start.q, np.tile(start.p.mean(axis=0), (start.n, 1)))
    law = Law(system.graph(), (Gradient(system.potential()), Consensus(1.0)))
    assert evaluate(law, state).dissipation == 0.0
    run = simulate(Scenario(law, state, t_end=0.01, frames=2), progress=False)
    return Demonstration(
        0.0, -evaluate(law, run.state(-1)).dissipation, 1e-9,
        "dQ/dt of six agents 0.01 s after they had one velocity: within S, and in the run",
    )  # fmt: skip


def energy_sign() -> Demonstration:
    """(10): with the printed minus sign Q is negative at rest, though it is called positive semidefinite."""
    state = State(examples.example_state().q)
    return Demonstration(
        -total_energy(examples.law(), state), total_energy(examples.law(), state), 1e-9, "Q of six agents at rest"
    )


def weighted_rate() -> Demonstration:
    """(12), (14): L of (2) has entries 0 and 1; the rate of Q needs the Laplacian of the weights w_ij."""
    state = examples.example_state()
    plain = Law(system.graph(), (Gradient(system.potential()), Consensus(1.0)))
    return Demonstration(
        -evaluate(plain, state).dissipation, examples.rate_of(1.0), 1e-6, "-v^T (L x I) v with the L of (2), and dQ/dt"
    )


def rate_sign() -> Demonstration:
    """(20): as printed dQ/dt is positive."""
    power = examples.dissipation_of(1.0)
    return Demonstration(power, examples.rate_of(1.0), 1e-6, "(1/2) sum w_ij |v_j - v_i|^2, and dQ/dt")


def gradient_rate() -> Demonstration:
    """(12), second line: the gradients with respect to s_i and s_j do not cancel; they are opposite."""
    state = examples.example_state()
    forces = examples.potential_forces_of(1.0)
    printed = float(np.sum(state.p * (-2 * forces))) - examples.dissipation_of(1.0)
    return Demonstration(printed, examples.rate_of(1.0), 1e-6, "second line of (12) as printed, and dQ/dt")


def many_switches() -> Demonstration:
    """Proof of Theorem 1: the graph switches at times t_k, k = 1, ..., N; there may be more."""
    switches = [len(Evidence(simulate(system.scenario(seed=s), progress=False)).link_history) - 1 for s in range(3)]
    return Demonstration(
        float(system.AGENTS), float(max(switches)), 0.5, "switching times counted up to N, and in a run"
    )


def kernel_in_balance() -> Demonstration:
    """After (23): L-hat s = 0 would imply s_1 = ... = s_N, a kernel of dimension 1, for a connected graph."""
    state, _ = examples.balance_of(1.0)
    psi, links = system.potential(), system.graph().initial(state.q)
    assert is_connected(links)
    distance = np.where(links, pair_distances(state.q), 1.0)
    entries = np.where(links, psi.slope(distance) / distance, 0.0)
    size = np.abs(np.linalg.eigvalsh(entries - np.diag(entries.sum(axis=1))))
    kernel = float((size < 1e-9 * size.max()).sum())
    return Demonstration(1.0, kernel, 0.5, "dimension of the kernel of L-hat for four linked agents at rest in balance")


def no_position() -> Demonstration:
    """Abstract: (24) has no feedback of the leader's position."""
    run = simulate(system.scenario(seed=0, leader=True), progress=False)
    leader = run.scenario.law.leaders[0]
    away = float(np.linalg.norm(run.q[-1].mean(axis=0) - leader.at(float(run.t[-1]))[0]))
    return Demonstration(0.0, away, 1e-3, "final distance of the mean position from the leader")


def some_informed() -> Demonstration:
    """(33), (34): they need c_1 = 1 for every agent; if some agents are uninformed, the mean has no such equation."""
    gains = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    law = Law(system.graph(), (*examples.law().terms, Track(Velocity(system.LEADER_VELOCITY), velocity_gain=gains)))
    state = examples.example_state()
    printed = -gains.mean() * (state.p.mean(axis=0) - np.asarray(system.LEADER_VELOCITY))
    found = evaluate(law, state).u.mean(axis=0)
    return Demonstration(
        float(printed[0]),
        float(found[0]),
        1e-9,
        "mean acceleration of (33) with the mean of c_1, when half are informed",
    )


def leader_sign() -> Demonstration:
    """(33), second line: + c_1 (v_i - v_gamma) would drive the group away from the leader's velocity."""
    state = examples.example_state()
    printed: Array = state.p.mean(axis=0) - np.asarray(system.LEADER_VELOCITY)
    return Demonstration(
        float(printed[0]),
        float(examples.led_mean_control_of(1.0)[0]),
        1e-9,
        "leader's part of (33) as printed, and true",
    )
