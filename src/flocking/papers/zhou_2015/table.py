"""Equation table of Zhou, Zhou and Zeng: where each numbered statement lives and how it is read."""

from __future__ import annotations

from typing import Any

from flocking.papers.zhou_2015 import counterexamples as wrong
from flocking.papers.zhou_2015 import examples, system
from flocking.papers.zhou_2015 import examples_phases as phases
from flocking.study.equations import Erratum, Fault, Row, errata_of

MODEL, STUDY, HERE = "flocking.model", "flocking.study", "flocking.papers.zhou_2015"
SIGMA = (
    "The second case needs sigma[t-] = 1: a linked pair stays linked up to r, an unlinked one is linked below r - eps."
)
NOW = "(ii) and (iii) speak of s(t), not s(0). eps_0 is never used."
ORDERED = "E lists ordered pairs, every edge twice, as E(t) is defined."
TOGETHER = (
    "psi' has both signs: L-hat is no Laplacian of a graph with positive weights, and its kernel holds the positions"
    " of the formation besides. Agents do not come together: psi is infinite there."
)
SIGN = "Q = (1/2) (sum_i sum_j psi + sum_i v_i^T v_i): no minus, and the velocities inside the sum over i."
CANCEL = "Both gradients are with respect to s_i and cancel; L is the Laplacian of the weights w_ij."
LAPLACIAN = "L is the Laplacian of the weights w_ij; that of (2) serves only where all weights are 1."
LARGEST = "Q_max is not defined: Q_0 + M psi(r - eps), as U_max below (31)."
OFFSETS = (
    "The goals exclude each other: fixed offsets s_i - s_j -> k_ij without collisions, and s_1 = ... = s_N. The first"
    " is taken."
)
INVARIANT = (
    "S itself is not invariant: where velocities are equal for an instant, forces may part them. What is meant, and"
    " gives the conclusion, is the largest invariant set within S."
)
MINUS = "dQ/dt = -(1/2) sum over ordered pairs of w_ij |v_j - v_i|^2."
VELOCITY_ONLY = "(24) feeds back the leader's velocity alone: the group keeps its distance from the leader's position."
NOT_GIVEN = "Not given: w_ij and c_1, here 1; the duration, here 100."
MEAN = "The c_1 term belongs inside the sum, with a minus, and c_1 is the same for all agents."
ALL_INFORMED = "c_1 = 1 for all agents. Where it is 0 for some, as below (24), the mean obeys no such equation."


def row(number: str, kind: str, title: str, home: str, build: Any, **more: Any) -> Row:
    """A row of this paper; ``number``, ``kind``, ``title``, ``home``, ``build`` and ``more`` are fields of `Row`."""
    return Row(system.KEY, number, kind, title, home, build, **more)


def equations() -> tuple[Row, ...]:
    """Every numbered statement of the paper."""
    return (*_problem(), *_without_leader(), *_with_leader(), *_figures())


def _problem() -> tuple[Row, ...]:
    net = f"{MODEL}.graphs.Hysteresis"
    return (
        row("(i)-(iii)", "definition", "when links appear and break", net, examples.links_after, reading=NOW,
            fault=Fault.MISPRINT, demonstration=wrong.initial_distances),
        row("(1)", "equation", "indicator sigma of a link", net, examples.links_after, reading=SIGMA,
            fault=Fault.MISPRINT, demonstration=wrong.indicator),
        row("(2)", "equation", "adjacency matrix and Laplacian", f"{STUDY}.nets.laplacian", examples.laplacian_of,
            reading="(u, v) is (i, j).", fault=Fault.MISPRINT),
        row("(3)", "equation", "z^T L z as a sum of squares", f"{MODEL}.terms.Consensus.dissipation",
            examples.sum_of_squares_of, note=ORDERED),
        row("(4)", "equation", "double integrators", "flocking.engine.codegen._stages_source",
            examples.displacement_of),
        row("(5)", "equation", "stacked positions and velocities", f"{MODEL}.state.State", examples.stacked_of),
        row("sec. 2.2", "problem", "fixed offsets k_ij, and the final formation s_1 = ... = s_N",
            f"{HERE}.theorems.links_have_one_length", examples.coming_together_of, reading=OFFSETS,
            fault=Fault.READING, demonstration=wrong.coinciding_goal),
        row("(6)", "equation", "u_i = f_i + h_i", f"{MODEL}.law.Law", examples.control_of),
        row("(7)", "equation", "u_i = f_i + h_i + gamma_i", f"{MODEL}.law.Law", examples.led_control_of),
    )  # fmt: skip


def _without_leader() -> tuple[Row, ...]:
    energy, bound = f"{STUDY}.state_energy.total_energy", f"{HERE}.bounds.largest_energy"
    dissipation = f"{MODEL}.terms.Consensus.dissipation"
    return (
        row("(8)", "protocol", "control without a leader", f"{MODEL}.law.Law", examples.control_of),
        row("psi (i), (ii)", "definition", "least at one distance, infinite at 0 and r",
            f"{STUDY}.potential_check.check_potential", examples.definition_of),
        row("(9)", "equation", "potential infinite at 0 and r", f"{MODEL}.potentials.Potential", examples.potential_of),
        row("(10)", "equation", "energy Q", energy, examples.energy_of, reading=SIGN,
            fault=Fault.MISPRINT, demonstration=wrong.energy_sign),
        row("(11)", "equation", "mean velocity and position", f"{MODEL}.observables.mean_velocity", examples.means_of),
        row("Theorem 1", "theorem", "flocking without a leader", f"{HERE}.theorems.claims", examples.theorem_of),
        row("(12)", "equation", "dQ/dt, line by line", energy, examples.rate_of, reading=CANCEL,
            fault=Fault.MISPRINT, demonstration=wrong.gradient_rate),
        row("(13)", "equation", "Q(t) <= Q_0 <= Q_max until the first new link", bound, phases.phases_of,
            reading=LARGEST),
        row("(14)", "equation", "dQ/dt = -v^T (L x I) v", dissipation, examples.dissipation_of, reading=LAPLACIAN,
            fault=Fault.MISPRINT, demonstration=wrong.weighted_rate),
        row("t_k", "equation", "the graph switches at t_k, k = 1, ..., N", f"{HERE}.bounds.most_new_links",
            examples.new_links_of, reading="k = 1, 2, ...: at most M times.", fault=Fault.MISPRINT,
            demonstration=wrong.many_switches),
        row("(15)", "equation", "Q(t) <= Q(t_(k-1)) < Q_max between switches", bound, phases.phases_of,
            note="Q_max as in (13)."),
        row("(16)", "equation", "0 < n_k <= M links are new at t_k", f"{HERE}.bounds.most_new_links",
            phases.phases_of, note="The proof needs that M bounds the sum of all n_k, which holds: no link is lost."),
        row("(17)", "equation", "Q(t_k) <= Q_0 + (n_1 + ... + n_k) psi(r - eps)", bound, phases.phases_of),
        row("(18)", "equation", "the set Q <= Q_max with linked distances in [0, r] is invariant", bound,
            phases.phases_of, note="Q_max as in (13)."),
        row("after (18), distances", "equation", "distances are at most (N-1) r", f"{HERE}.theorems.distances_bounded",
            examples.distance_margin_of),
        row("after (18), speeds", "equation", "speeds are at most sqrt(2 Q_max)", f"{HERE}.theorems.speeds_bounded",
            examples.speed_margin_of),
        row("(19)", "equation", "solutions tend to the invariant set S where dQ/dt = 0", dissipation,
            examples.limit_rate_of, reading=INVARIANT, fault=Fault.MISPRINT, demonstration=wrong.not_invariant),
        row("(20)", "equation", "dQ/dt as a sum of squares", energy, examples.rate_of, reading=MINUS,
            fault=Fault.MISPRINT, demonstration=wrong.rate_sign),
        row("(21)", "equation", "the mean of the controls vanishes", f"{MODEL}.terms.Consensus.symmetries",
            examples.mean_control_of),
        row("(22)", "equation", "control in the steady state", f"{STUDY}.equilibrium.Equilibrium",
            examples.potential_forces_of, reading="Only where all velocities agree."),
        row("(23)", "equation", "L-hat s = 0 in the stable state: forces balance", f"{STUDY}.equilibrium.Equilibrium",
            examples.balance_of),
        row("after (23)", "equation", "from L-hat s = 0 follows s_1 = ... = s_N", f"{STUDY}.equilibrium.Equilibrium",
            examples.balance_of, reading=TOGETHER, fault=Fault.FALSE, demonstration=wrong.kernel_in_balance),
    )  # fmt: skip


def _with_leader() -> tuple[Row, ...]:
    energy, track = f"{STUDY}.state_energy.total_energy", f"{MODEL}.tracking.Track"
    bound = f"{HERE}.bounds.largest_energy"
    return (
        row("(24)", "protocol", "control with a leader", track, examples.led_control_of),
        row("abstract", "remark", "all agents approach the virtual leader", track, examples.moved_control_of,
            reading=VELOCITY_ONLY, fault=Fault.FALSE, demonstration=wrong.no_position),
        row("(25)", "equation", "energy U in the leader's frame", f"{MODEL}.energy.Energy", examples.led_energy_of),
        row("Theorem 2", "theorem", "flocking with a leader", f"{HERE}.theorems.claims", examples.led_theorem_of),
        row("(26)", "equation", "motion relative to the leader", track, examples.relative_control_of,
            reading="The relative position carries a tilde: s_i - v_gamma t.", fault=Fault.MISPRINT),
        row("(27)", "equation", "control in relative variables", track, examples.relative_control_of),
        row("(28)", "equation", "U in relative variables", f"{MODEL}.energy.Energy", examples.led_energy_of,
            reading="The kinetic part belongs inside the sum over i.", fault=Fault.MISPRINT),
        row("(29)", "equation", "dU/dt", f"{MODEL}.tracking.Track.balance", examples.led_dissipation_of,
            reading="L of the weights w_ij; \"U(t) <= 0\" below it means dU/dt.", fault=Fault.MISPRINT),
        row("(30)", "equation", "U(t) <= U(t_(k-1)) < U_max between switches", bound, phases.led_phases_of),
        row("(31)", "equation", "the set U <= U_max is invariant", bound, phases.led_phases_of,
            note="(1/2) N^2 - (3/2) N + 1 is M of (16)."),
        row("(32)", "equation", "limit set dU/dt = 0", energy, examples.led_rate_of,
            reading="(L + c_1 I_N) x I_n: the bracket closes before the product.", fault=Fault.MISPRINT),
        row("(33)", "equation", "the mean acceleration", track, examples.led_mean_control_of, reading=MEAN,
            fault=Fault.MISPRINT, demonstration=wrong.leader_sign),
        row("(34)", "equation", "the mean velocity decays exponentially", f"{HERE}.theorems.mean_velocity_decays",
            examples.mean_velocity_of, reading=ALL_INFORMED, fault=Fault.READING, demonstration=wrong.some_informed),
        row("sec. 4", "example", "numbers of the simulations", f"{HERE}.system.scenario", examples.numbers_of,
            reading=NOT_GIVEN),
    )  # fmt: skip


def _figures() -> tuple[Row, ...]:
    home, words = f"{HERE}.pictures.figures", {1: "", 8: " with a leader"}
    found = [
        row("Fig. 1", "figure", "initial states", home, examples.picture_of(1),
            reading="Velocity components uniform in [0, 4); redrawn until connected."),
        row("Fig. 8", "figure", "initial states with a leader", home, examples.picture_of(8)),
    ]  # fmt: skip
    for first, led in words.items():
        for number, title in ((first + 1, "final states"), (first + 2, "paths and final states")):
            found.append(row(f"Fig. {number}", "figure", f"{title}{led}", home, examples.picture_of(number),
                             reading="The duration is not printed: runs last 100 s, drawn is 12 s."))  # fmt: skip
        for number, title in zip(range(first + 3, first + 7), ("velocities, x", "velocities, y", "positions, x",
                                                               "positions, y"), strict=True):  # fmt: skip
            found.append(row(f"Fig. {number}", "figure", f"{title}{led}", home, examples.picture_of(number)))
    return tuple(sorted(found, key=lambda r: int(r.number.split()[1])))


def errata() -> list[Erratum]:
    """False statements and misprints of the paper."""
    return errata_of(equations())
