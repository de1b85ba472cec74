"""Computed counter-examples to what Zhou, Zhou and Zeng print."""

from __future__ import annotations

import numpy as np

from flocking.engine.reference import evaluate
from flocking.engine.simulate import simulate
from flocking.model.checks import Array
from flocking.model.connectivity import is_connected
from flocking.model.graphs import pair_distances
from flocking.model.law import Law
from flocking.model.leaders import Velocity
from flocking.model.state import State
from flocking.model.terms import Consensus, Gradient
from flocking.model.tracking import Track
from flocking.papers.zhou_2015 import examples, system
from flocking.study.equations import Demonstration
from flocking.study.evidence import Evidence
from flocking.study.state_energy import total_energy


def printed_indicator(linked: bool, distance: float) -> set[int]:
    """Values (1) as printed allows for sigma after a pair with this memory is seen at ``distance``.

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
    kept = [int(net.update(q, np.array([[False, memory], [memory, False]]))[0, 1]) for memory in (False, True)]
    right = sum(values == {value} for values, value in zip((unlinked, linked), kept, strict=True))
    return Demonstration(
        float(right),
        2.0,
        0.5,
        "cases of a pair at 3.95, unlinked and linked, that the printed (1) decides as (i)-(iii) do",
    )


def initial_distances() -> Demonstration:
    """Rules (ii), (iii): with ||s_i(0) - s_j(0)||, as printed, every pair they could link is linked from the start."""
    run = simulate(system.scenario(seed=0), progress=False)
    net = system.graph()
    printed = np.triu(pair_distances(run.q[0]) < net.appear_radius) & ~run.links_at(0)
    created = Evidence(run).links_created
    return Demonstration(
        float(printed.sum()), float(created), 0.5, "links created under the printed (iii), and in a run"
    )


def coinciding_goal() -> Demonstration:
    """Sec. 2.2, (23): the agents do not come together, s_1 = ... = s_N never holds."""
    run = simulate(system.scenario(seed=1), progress=False)
    return Demonstration(
        0.0, float(pair_distances(run.q[-1]).min()), 1e-3, "smallest distance of two agents in the limit"
    )


def equal_lengths() -> Demonstration:
    """(23) and property (i): not all links end at the distance r/2 where the potential is least."""
    lengths, _ = examples.coming_together_of(1.0)
    off = float(np.abs(lengths - system.RADIUS / 2).max())
    return Demonstration(0.0, off, 1e-3, "largest difference between a link's final length and r/2")


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
    """(12), second line: the gradients with respect to s_i and s_j do not cancel, they are opposite."""
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


def kernel_of_limit() -> Demonstration:
    """(23): for a connected graph L-hat s = 0 would leave s_1 = ... = s_N alone: a kernel of dimension 1."""
    run = simulate(system.scenario(seed=1, duration=1000.0), progress=False)
    state, psi = run.state(-1), system.potential()
    distance = pair_distances(state.q)
    links = run.links_at(-1)
    with np.errstate(all="ignore"):
        entries = np.where(links, psi.slope(np.where(links, distance, 1.0)) / distance, 0.0)
    matrix = entries - np.diag(entries.sum(axis=1))
    size = np.abs(np.linalg.eigvalsh(matrix))
    kernel = int((size < 1e-4 * size.max()).sum())
    kind = "connected" if is_connected(links) else "disconnected"
    example = f"dimension of the kernel of L-hat at the limit, whose graph is {kind}"
    return Demonstration(1.0, float(kernel), 0.5, example)


def no_position() -> Demonstration:
    """(24), abstract: nothing draws the group to the leader's position."""
    run = simulate(system.scenario(seed=0, leader=True), progress=False)
    leader = run.scenario.law.leaders[0]
    away = float(np.linalg.norm(run.q[-1].mean(axis=0) - leader.at(float(run.t[-1]))[0]))
    return Demonstration(0.0, away, 1e-3, "final distance of the mean position from the leader")


def some_informed() -> Demonstration:
    """(33), (34): they need c_1 = 1 for every agent; with some uninformed the mean obeys no such equation."""
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
