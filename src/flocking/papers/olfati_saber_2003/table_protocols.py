"""Rows of sections 4 to 10 and of the appendix: structural energy, protocols, votes, dissipation, separation."""

from __future__ import annotations

from flocking.papers.olfati_saber_2003 import counterexamples as wrong
from flocking.papers.olfati_saber_2003 import examples_energy as energies
from flocking.papers.olfati_saber_2003 import examples_protocols as protocols
from flocking.papers.olfati_saber_2003 import examples_runs as runs
from flocking.papers.olfati_saber_2003.table_nets import HERE, MODEL, STUDY, row
from flocking.study.equations import Fault, Row

SETTLED = "The paper's own limits have V > 0: quasi-realizations. Condition i) holds."
TWICE = "d/dt |q_j - q_i|^2 is twice the product; the conclusions need only where it vanishes."
UNWEIGHTED = (
    "Damping without a_ij, as printed: the law jumps at r, where pairs may slide. Weighted damping is an option."
)
NONSMOOTH = "V is the nonsmooth one of (28), without a_ij; with the V of (30) the bound fails just within r."
LOCAL = (
    "LaSalle's principle gives stationary points of V. Three agents in a line, all linked, rest in balance for ever at"
    " a saddle."
)
REPELLED = "|phi_alpha(-d_alpha)| < b pushes agents apart that meet; phi_alpha(d_alpha) < a."
CLOSE = "A negative vote says too close, not far."
ORDERED = "E lists ordered pairs here, every link twice; |E| in (47) counts links once."
RISES = "Between switches H_s never rises; a new link adds h_0, and the sequence may rise."
SMALL_W = "No w is given. At rest at a sink grad V_i = -q_i, so that w must be small: 0.01."
TILDE = "H_s is a function of q and p~; sec. 10 prints p-bar."
STRONG = "With a = 1, b = 5 a sink crushes a hundred agents; Fig. 9 needs a = 50, b = 250, which leave c as it is."


def energy_rows() -> tuple[Row, ...]:
    """Sections 4 and 5."""
    energy, potential = f"{STUDY}.structure.structural_energy", f"{MODEL}.structural.structural_potential"
    mean, claims, figures = f"{MODEL}.observables.mean_position", f"{HERE}.theorems.claims", f"{HERE}.pictures.figures"
    return (
        row("(21)", "equation", "double integrators", f"{MODEL}.state.Agents", runs.newton),
        row("(22)", "equation", "position and velocity of the net", mean, energies.means),
        row("(23)", "equation", "translational dynamics", mean, runs.mean_motion),
        row("(24)", "equation", "relative positions, velocities and controls", mean, energies.relative),
        row("(25)", "equation", "the same, stacked with Kronecker products", mean, energies.stacked),
        row("(26)", "equation", "relative dynamics", "flocking.engine.reference.control", energies.relative),
        row("(27)", "equation", "structural energy H_s", energy, energies.energy),
        row("(28)", "equation", "V, V_i and K_r", energy, energies.energy_pieces),
        row("(29)", "equation", "potential and action function", potential, energies.potential_values),
        row("bounds of (29)", "remark", "phi_alpha is bounded, between -b and a", potential, energies.bounds_of_action),
        row("Fig. 4", "figure", "potential and action function for a = 1, b = 5", figures, runs.picture("4")),
        row("Proposition 2 i)", "proposition", "V = 0 exactly for realizations", energy, energies.zero_energy),
        row("Proposition 2 ii)", "proposition", "K_r = 0 keeps all distances", energy, energies.moving_together),
        row(
            "converse of Proposition 2 ii)",
            "proposition",
            "where all distances keep and a) to c) hold, K_r = 0",
            f"{STUDY}.rigid_motion.converse_conditions",
            energies.converse,
            note="Condition c) excludes rotations, which keep all distances; a) and b) are not needed.",
        ),
        row("Proposition 2 iii)", "proposition", "K_r = 0 keeps the topology", energy, energies.moving_together),
        row(
            "A.1",
            "proposition",
            "proof of Proposition 2: rate of a distance",
            "flocking.study.evidence.Evidence.distance_rate",
            runs.distance_rates,
            reading=TWICE,
            fault=Fault.MISPRINT,
            demonstration=wrong.distance_rate,
        ),
        row("Proposition 3", "proposition", "H_s = 0: a realization at one velocity", energy, energies.no_energy),
        row(
            "Definition 2",
            "definition",
            "flocking: H_s bounded and H_s -> 0",
            claims,
            runs.smooth,
            reading=SETTLED,
            fault=Fault.READING,
            demonstration=wrong.settled_with_energy,
        ),
        row("(30)", "equation", "H_s over pairs i < j with weights a_ij", energy, energies.smooth_energy),
        row("(31)", "equation", "jump h_0 where a link appears", energy, energies.jump),
        row("Example 2", "example", "potential of two agents, nonsmooth", energy, energies.pair_potentials),
        row("(32)", "equation", "potential of two agents", energy, energies.pair_potentials),
        row("(33)", "equation", "edge deviation", f"{STUDY}.structure.deviation", energies.edge_deviation),
        row("Fig. 5", "figure", "nonsmooth and smooth pair potential", figures, runs.picture("5")),
    )


def protocol_rows() -> tuple[Row, ...]:
    """Sections 6 and 7."""
    gradient, vote = f"{MODEL}.terms.Gradient", f"{STUDY}.structure.vote"
    return (
        row(
            "(34)",
            "protocol",
            "(alpha, alpha) protocol, nonsmooth",
            f"{HERE}.system.alpha_terms",
            protocols.protocol_34,
        ),
        row(
            "Remark 4",
            "remark",
            "(34) asks all links for one length",
            f"{HERE}.system.alpha_terms",
            protocols.common_length,
            note="The protocol it is compared with is not printed: checked is the length that (34) asks for.",
        ),
        row("n_ij", "definition", "unit vector from i to j", gradient, protocols.unit_vectors),
        row(
            "(35)",
            "protocol",
            "(alpha, alpha) protocol, smooth",
            f"{HERE}.system.alpha_terms",
            protocols.protocol_35,
            reading=UNWEIGHTED,
        ),
        row(
            "(36)",
            "protocol",
            "its approximation",
            f"{HERE}.system.alpha_terms",
            protocols.protocol_36,
            reading=UNWEIGHTED,
        ),
        row(
            "(37)",
            "equation",
            "bound of the approximation error",
            f"{MODEL}.bumps.Bump.steepest",
            protocols.approximation_error,
            reading=NONSMOOTH,
            fault=Fault.READING,
            demonstration=wrong.smooth_bound,
        ),
        row("(38)", "equation", "weights w_ij", f"{STUDY}.structure.vote_weights", protocols.weights),
        row(
            "after (38)",
            "remark",
            "repulsion of agents that meet",
            f"{MODEL}.structural.structural_potential",
            energies.bounds_of_action,
            reading=REPELLED,
            fault=Fault.MISPRINT,
            demonstration=wrong.weak_repulsion,
        ),
        row("(39)", "equation", "undamped control by weights", f"{STUDY}.structure.vote_weights", protocols.undamped),
        row("(40)", "equation", "weighted average of the neighbours", vote, protocols.average),
        row("(41)", "equation", "case i: towards the average", vote, protocols.positive_vote),
        row(
            "(42)",
            "equation",
            "case ii: away from the average",
            vote,
            protocols.negative_vote,
            reading=CLOSE,
            fault=Fault.MISPRINT,
            demonstration=wrong.too_close,
        ),
        row("case iii", "definition", "votes S+, S- and S0 that cancel", vote, protocols.zero_vote),
        row("(43)", "equation", "averages of either side", vote, protocols.zero_vote),
        row("(44)", "equation", "control where votes cancel", vote, protocols.zero_vote),
        row("(45)", "equation", "its direction", vote, protocols.zero_vote),
        row(
            "third rule",
            "remark",
            "Reynolds's alignment is the agreement protocol",
            f"{MODEL}.terms.Consensus",
            protocols.alignment,
        ),
    )


def dissipation_rows() -> tuple[Row, ...]:
    """Sections 8 and 9, and A.2."""
    claims, dissipation = f"{HERE}.theorems.claims", f"{MODEL}.terms.Consensus.dissipation"
    return (
        row("Proposition 4", "proposition", "(34): H_s falls between switches, velocities agree", claims, runs.free),
        row(
            "Remark 5",
            "remark",
            "H_s at the switching times decreases",
            claims,
            runs.free,
            reading=RISES,
            fault=Fault.FALSE,
            demonstration=wrong.rising_sequence,
        ),
        row("Proposition 5", "proposition", "(35): H_s falls, velocities agree", claims, runs.smooth),
        row(
            "dH_s of Proposition 5",
            "equation",
            "rate of H_s under (35)",
            dissipation,
            energies.smooth_dissipation,
            reading=ORDERED,
        ),
        row("(46)", "equation", "defect factor mu", f"{STUDY}.structure.defect", energies.defect_of, reading=SMALL_W),
        row(
            "(47)",
            "equation",
            "normalized defect factor mu_n",
            f"{STUDY}.structure.Defect.normalized",
            energies.defect_of,
            reading="|E| counts every link once. " + SMALL_W,
        ),
        row(
            "Definition 3",
            "definition",
            "quasi-realization",
            f"{STUDY}.structure.is_quasi_realization",
            energies.wheel_defect,
            reading="Any constant mu > 0. Near a realization: mu_n <= 0.2 unless told.",
        ),
        row("(60)", "equation", "H_s of the k-th net", f"{STUDY}.structure.structural_energy", energies.energy),
        row(
            "(61)",
            "equation",
            "rate of H_s under (34)",
            dissipation,
            energies.dissipation,
            reading=ORDERED,
        ),
        row(
            "A.2",
            "proposition",
            "distances keep in the limit",
            claims,
            runs.free,
            reading=TWICE,
            fault=Fault.MISPRINT,
            demonstration=wrong.distance_rate,
        ),
        row(
            "A.2, limit",
            "proposition",
            "the limit is a local minimum of V",
            "flocking.study.equilibrium.Equilibrium",
            energies.line_in_balance,
            reading=LOCAL,
            fault=Fault.FALSE,
            demonstration=wrong.saddle,
        ),
    )


def separation_rows() -> tuple[Row, ...]:
    """Section 10 and A.3."""
    track, law = f"{MODEL}.tracking.Track", f"{MODEL}.law.Law"
    forms, engine = f"{HERE}.closed_forms", "flocking.engine.reference"
    return (
        row("sum of u", "equation", "the controls (34), (35) add up to zero", law, energies.invariance),
        row("(48)", "equation", "interaction plus a shared control", law, protocols.separated),
        row(
            "(49)", "equation", "translational energy H_tr", f"{forms}.translational_energy", protocols.tracking_energy
        ),
        row(
            "Proposition 6 i)",
            "proposition",
            "dH_s/dt does not depend on u-bar",
            f"{engine}.control",
            protocols.structural_rates,
        ),
        row("Proposition 6 ii)", "proposition", "dH_tr/dt does not depend on u_alpha", track, protocols.sink_rate),
        row(
            "Proposition 6",
            "proposition",
            "H_s + H_tr never rises",
            track,
            protocols.total_rates,
            reading=TILDE,
            fault=Fault.MISPRINT,
        ),
        row(
            "Remark 6",
            "remark",
            "the proof of Proposition 6 holds the tracking controllers",
            track,
            protocols.both_controllers,
        ),
        row(
            "(50)",
            "protocol",
            "pursuit of a sink by every agent",
            track,
            protocols.pursuit,
            reading=STRONG,
            fault=Fault.READING,
            demonstration=wrong.crushed,
        ),
        row("(51)", "equation", "(50) in relative variables", track, protocols.pursuit),
        row("u-bar of (51)", "equation", "the centre of mass obeys a PD controller", track, protocols.mean_control),
        row("(52)", "equation", "energy H_a without interaction", f"{forms}.gathering_energy", protocols.gathering),
        row(
            "after (52)",
            "remark",
            "agents within r/2 of a point form a complete net",
            f"{MODEL}.graphs.Proximity",
            protocols.all_together,
        ),
        row(
            "coincidence",
            "remark",
            "V is largest where all agents coincide",
            f"{STUDY}.structure.structural_energy",
            energies.largest_potential,
            reading="Where psi(-d_alpha) is at least psi(r - d_alpha), as for r = 1.2 d_alpha.",
        ),
        row(
            "(62)",
            "equation",
            "dH_s/dt under (48)",
            f"{engine}.evaluate",
            protocols.ledger_rates,
            reading=TILDE,
            fault=Fault.MISPRINT,
            demonstration=wrong.mean_for_relative,
        ),
        row("(63)", "equation", "dH_tr/dt towards a sink", track, protocols.sink_rate),
        row("(64)", "equation", "bounded feedback towards a sink", track, protocols.sink_controller),
        row(
            "(65)",
            "equation",
            "dH_tr/dt towards a velocity",
            track,
            protocols.velocity_rate,
            reading="H_tr is half of |p-bar - p_d|^2; printed without the bar.",
            fault=Fault.MISPRINT,
            demonstration=wrong.velocity_without_bar,
        ),
        row("(66)", "equation", "bounded feedback towards a velocity", track, protocols.velocity_controller),
        row("after (66)", "equation", "the feedbacks are at most 1 + c2 and c2", track, protocols.largest_feedback),
    )
