"""Equation table of Shi, Wang, Chu: where each numbered statement lives and how it is read."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from flocking.papers.shi_2009 import counterexamples, examples
from flocking.papers.shi_2009.system import KEY, SETTINGS
from flocking.study.equations import Erratum, Fault, Row, errata_of

PAPER = "flocking.papers.shi_2009"


def equations() -> Sequence[Row]:
    """Every numbered statement of the paper, its examples, the rows of its table and its figures."""

    def row(number: str, kind: str, title: str, home: str, build: Any, **more: Any) -> Row:
        return Row(KEY, number, kind, title, home, build, **more)

    law, energy = "flocking.model.law.Law", "flocking.model.energy.Energy"
    forms = f"{PAPER}.closed_forms"
    claims, figures = f"{PAPER}.theorems.claims", f"{PAPER}.pictures.figures"
    stationary = "The argument shows that the forces balance: the limit is stationary, V^i need not be at its minimum."
    constant = "The time constant is 1/h_0."
    beta = "The alignment term is -sum w_ij (v^i - v^j); the printed sign drives velocities apart."
    table = [
        row(
            f"Table 1 Fig. {setting.figure}",
            "table",
            f"law ({setting.law}), velocity known to {setting.velocity}, acceleration "
            f"to {setting.acceleration}, {'connected' if setting.connected else 'disconnected'}",
            claims,
            examples.table_row(name),
        )
        for name, setting in SETTINGS.items()
        if setting.figure
    ]
    return (
        row("(1)", "equation", "m_i dv_i/dt = u_i - k_i v_i", "flocking.model.state.Agents", examples.acceleration),
        row("(2)", "equation", "u = alpha + beta + gamma + delta", law, examples.parts),
        row(
            "Definition 1",
            "definition",
            "neighbouring graph, within R",
            "flocking.model.graphs.Proximity",
            examples.links,
        ),
        row(
            "Definition 2",
            "definition",
            "potential function",
            "flocking.study.potential_check.check_potential",
            examples.definition,
        ),
        row(
            "(3)",
            "equation",
            "the potential",
            f"{PAPER}.system.potential",
            examples.potential,
            note="Differentiable once: the curvature jumps at sqrt(b/a) and at R.",
        ),
        row(
            "b > a/e",
            "assumption",
            "it keeps (3) positive",
            f"{PAPER}.system.potential",
            examples.least_value,
        ),
        row(
            "depth of (3)",
            "consequence",
            "the well of (3) is 2 deep, whatever a is",
            f"{PAPER}.system.potential",
            examples.well_depth,
        ),
        row(
            "V^i",
            "equation",
            "total potential of agent i, with V(R) for every stranger",
            energy,
            examples.total_potential,
        ),
        row("(4)", "equation", "law with weights, informed agents and compensation", law, examples.law_4),
        row(
            "(5)",
            "equation",
            "closed loop as a differential inclusion",
            f"{PAPER}.system.scenario",
            examples.closed_loop,
        ),
        row(
            "Theorem 1",
            "theorem",
            "velocities approach v0, no collisions, all V^i minimal",
            claims,
            examples.theorem(KEY),
            reading=stationary,
            fault=Fault.FALSE,
            demonstration=counterexamples.not_minimal(KEY),
        ),
        row("(6)", "equation", "error dynamics in the leader's frame", energy, examples.leader_frame_kinetic),
        row("(7)", "equation", "the law in the leader's frame", law, examples.law_in_leader_frame),
        row(
            "Theorem 2",
            "theorem",
            "errors approach zero, all V^i minimal",
            claims,
            examples.theorem(KEY),
            reading=stationary,
            fault=Fault.FALSE,
            demonstration=counterexamples.not_minimal(KEY),
        ),
        row("J", "equation", "J in the leader's frame", energy, examples.energy_leader),
        row(
            "(N-1)R",
            "equation",
            "on a level set of J no distance exceeds (N-1) R",
            f"{PAPER}.bounds.distance_bound",
            examples.bounded_distances,
        ),
        row(
            "sqrt(2c/m_i)",
            "equation",
            "on a level set of J no velocity error exceeds sqrt(2 c/m_i)",
            f"{PAPER}.bounds.speed_bounds",
            examples.bounded_speeds,
        ),
        row(
            "e^i e^j",
            "equation",
            "e_v^i e_v^j is at most 2 c/m_i",
            f"{PAPER}.bounds.speed_bounds",
            examples.bounded_speeds,
            reading="The product is e_v^iT e_v^i, of one agent with itself.",
            fault=Fault.MISPRINT,
            demonstration=counterexamples.product_of_errors,
        ),
        row(
            "dJ",
            "equation",
            "dJ/dt = -e^T (L + H) e",
            "flocking.engine.reference.evaluate",
            examples.dissipation_leader,
        ),
        row(
            "Remark 1",
            "remark",
            "with every h_i > 0 no connectivity is needed",
            claims,
            examples.theorem(f"{KEY}-disconnected"),
            note="No proof is given. Barbalat's lemma is one: J falls at rate e^T H e at least.",
        ),
        row(
            "Remark 2", "remark", "alignment may be left out when all are informed", claims, examples.without_alignment
        ),
        row(
            "Remark 3",
            "remark",
            "asymmetric weights with a left eigenvector",
            "flocking.model.terms.Consensus",
            examples.remark_3,
            reading="The coefficient is xi_i w_ij, not xi_j; the sign as in (4).",
            fault=Fault.MISPRINT,
            demonstration=counterexamples.wrong_index,
        ),
        row(
            "(8)",
            "equation",
            "law with a common gain h_0",
            law,
            examples.law_8,
            reading=beta,
            fault=Fault.MISPRINT,
            demonstration=counterexamples.wrong_sign,
        ),
        row(
            "x*, v*",
            "equation",
            "centre of mass and its velocity",
            "flocking.model.observables.mean_position",
            examples.centre,
        ),
        row("(9)", "equation", "centre of mass under (8)", f"{forms}.centre_motion", counterexamples.centre_under(8)),
        row(
            "after (9)",
            "equation",
            "v* approaches v0 as exp(-h_0 t), with a time constant of h_0",
            f"{forms}.free_motion",
            counterexamples.decay,
            reading=constant,
            fault=Fault.MISPRINT,
            demonstration=counterexamples.time_constant,
        ),
        row(
            "before Theorem 3",
            "equation",
            "the position difference tends to x* + (v* - v0) h_0",
            f"{forms}.free_motion",
            counterexamples.limit_difference,
            reading="The offset is (v* - v0)/h_0, as the line before it and Theorem 3 have it.",
            fault=Fault.MISPRINT,
            demonstration=counterexamples.offset_divided,
        ),
        row(
            "Theorem 3",
            "theorem",
            "v* tends to v0 with a time constant of h_0, the position difference to x* + (v* - v0)/h_0",
            f"{forms}.centre_motion",
            counterexamples.theorem_3,
            reading=constant,
            fault=Fault.MISPRINT,
            demonstration=counterexamples.time_constant,
        ),
        row("(10)", "equation", "error dynamics in the centre-of-mass frame", energy, examples.centre_frame_kinetic),
        row("(11)", "equation", "J in the centre-of-mass frame", energy, examples.energy_centre),
        row(
            "Remark 4",
            "remark",
            "unequal gains disturb the centre of mass",
            "flocking.model.tracking.Track",
            counterexamples.unequal_gains,
        ),
        row("(12)", "equation", "law without the acceleration", law, examples.law_12),
        row(
            "Theorem 4",
            "theorem",
            "velocities become the same, all V^i minimal",
            claims,
            examples.theorem(f"{KEY}-velocity-only"),
            reading=stationary,
            fault=Fault.FALSE,
            demonstration=counterexamples.not_minimal(f"{KEY}-velocity-only"),
        ),
        row(
            "(13)", "equation", "centre of mass under (12)", f"{forms}.centre_motion", counterexamples.centre_under(12)
        ),
        row(
            "after Theorem 5",
            "equation",
            "solutions of (13); here with those of (9) and (16) for v0 = (sin t, cos t) and any gains",
            f"{forms}.centre_motion",
            counterexamples.centre_for_gains,
        ),
        row("(14)", "equation", "(12) in the centre-of-mass frame", law, examples.law_in_centre_frame),
        row(
            "Theorem 5",
            "theorem",
            "errors approach zero, all V^i minimal",
            claims,
            examples.theorem(f"{KEY}-velocity-only"),
            reading=stationary,
            fault=Fault.FALSE,
            demonstration=counterexamples.not_minimal(f"{KEY}-velocity-only"),
        ),
        row(
            "Example 1",
            "example",
            "a constant leader is tracked under (12), with a time constant of h_0",
            f"{forms}.free_motion",
            counterexamples.example_1,
            reading=constant,
            fault=Fault.MISPRINT,
            demonstration=counterexamples.time_constant,
        ),
        row(
            "Example 2",
            "example",
            "v0 = alpha t is not tracked under (12)",
            f"{forms}.ramp_motion",
            counterexamples.example_2,
            reading="The limit -alpha/h_0 is that of e_v*; the text prints e_p*.",
            fault=Fault.MISPRINT,
            demonstration=counterexamples.position_left_behind,
        ),
        row("(15)", "equation", "law with the leader's position", law, examples.law_15),
        row("J of (15)", "equation", "J with r_0 m |e_p|^2", energy, examples.energy_position),
        row(
            "(16)", "equation", "centre of mass under (15)", f"{forms}.centre_motion", counterexamples.centre_under(15)
        ),
        row(
            "Example 3",
            "example",
            "motion after an exponential leader",
            f"{forms}.exponential_motion",
            counterexamples.example_3(distinct=True),
        ),
        row(
            "Example 3 (i)",
            "example",
            "distinct eigenvalues: A = P diag(l1, l2) P^-1",
            f"{forms}.jordan_form",
            counterexamples.decomposed(distinct=True),
        ),
        row(
            "Example 3 (ii)",
            "example",
            "equal eigenvalues: eigenvectors (1, l1) and (1, 1 + l1), A = P J_0 P^-1",
            f"{forms}.jordan_form",
            counterexamples.decomposed(distinct=False),
            reading="(1, 1 + l1) is a generalized eigenvector: (A - l1) (1, 1 + l1) = (1, l1). P and J_0 are right.",
            fault=Fault.MISPRINT,
            demonstration=counterexamples.no_eigenvector,
        ),
        row(
            "leading part of Example 3 (i)",
            "equation",
            "x* and v* in the long run; both errors tend to minus infinity",
            f"{forms}.exponential_leading_part",
            counterexamples.leading_part(distinct=True),
        ),
        row(
            "leading part of Example 3 (ii)",
            "equation",
            "the same for equal eigenvalues",
            f"{forms}.exponential_leading_part",
            counterexamples.leading_part(distinct=False),
        ),
        row(
            "steady error (12)",
            "consequence",
            "|v* - v0| -> 1/sqrt(1 + h_0^2)",
            f"{forms}.steady_velocity_error",
            counterexamples.steady(12),
        ),
        row(
            "steady error (15)",
            "consequence",
            "|v* - v0| -> 1/sqrt((r_0 - 1)^2 + h_0^2)",
            f"{forms}.steady_velocity_error",
            counterexamples.steady(15),
        ),
        row(
            "Remark 5",
            "remark",
            "without a0 the leader's frame gives no falling energy",
            "flocking.engine.reference.evaluate",
            examples.supply_without_acceleration,
        ),
        row("Remark 6", "remark", "a0 known to some only: no flocking", claims, examples.theorem(f"{KEY}-partial")),
        row(
            "sec. 4",
            "example",
            "numbers of the simulations",
            f"{PAPER}.scenario",
            examples.numbers,
            reading="Not given: the damping k_i, here from [0, 1); how masses are drawn from (0, 1], here evenly from"
            " [0.05, 1]; how many agents are informed, here five.",
        ),
        *table,
        row("Fig. 1", "figure", "the potential for a = b = 1, R = 2", figures, examples.picture(1)),
        row("Fig. 2", "figure", "desired velocity", figures, examples.picture(2, KEY)),
        row("Fig. 3", "figure", "initial state", figures, examples.picture(3, KEY)),
        *(
            row(
                f"Fig. {k}",
                "figure",
                f"errors and final state, law ({SETTINGS[n].law})",
                figures,
                examples.picture(int(k), n),
            )
            for n, s in SETTINGS.items()
            if (k := s.figure) in {"4", "5", "6", "7", "8"}
        ),
        row(
            "Fig. 9",
            "figure",
            "velocity errors about the centre of mass",
            figures,
            examples.picture(9, f"{KEY}-velocity-only", f"{KEY}-position"),
        ),
        *(
            row(f"Fig. {k}", "figure", "errors when some know a0", figures, examples.picture(int(k), n))
            for n, s in SETTINGS.items()
            if (k := s.figure) in {"10", "11"}
        ),
        row(
            "Fig. 12",
            "figure",
            "velocity errors about the centre of mass",
            figures,
            examples.picture(12, f"{KEY}-partial", f"{KEY}-partial-disconnected"),
        ),
    )


def errata() -> list[Erratum]:
    """False statements and misprints of the paper."""
    return errata_of(equations())
