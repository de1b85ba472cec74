"""Equation table of Tanner II: where each numbered statement lives and how it is read."""

from __future__ import annotations

from typing import Any

from flocking.papers.tanner_2003_dynamic import counterexamples as wrong
from flocking.papers.tanner_2003_dynamic import examples, system
from flocking.study.equations import Erratum, Fault, Row, errata_of

MODEL, STUDY, HERE = "flocking.model", "flocking.study", "flocking.papers.tanner_2003_dynamic"
NOT_REGULAR = ("At R the slope falls from 2/R - 2/R^3 to 0: a concave kink. U'(R; 1) = 0, but the generalized"
               " derivative is 2/R - 2/R^3. The energy argument survives: where a pair crosses R at nonzero"
               " speed the rate of Q is the Laplacian form of one side or the other.")  # fmt: skip
NOT_EMPTY = "The generalized gradient of a locally Lipschitz function is never empty; here it is [0, 2/R - 2/R^3]."
COUNT = "An agent is not its own neighbour: N-1-|N_i| others are out of reach."
SPEED = "From Q <= c follows v^T v <= 2 c; the printed bound sqrt(c) forgets the factor 1/2 of Q."
DISTANCE = "U_ij is constant beyond R and has no inverse there; a connected graph bounds distances by (N-1) R."
STATIONARY = "The argument shows that the forces balance: the limit is stationary, U_i need not be at its minimum."
UNIQUE = "A measurable right-hand side gives existence; uniqueness needs more, here crossings at nonzero speed."
ASSUMED = "An assumption about the whole motion; a connected start does not ensure it, and some of the runs fall apart."


def row(number: str, kind: str, title: str, home: str, build: Any, **more: Any) -> Row:
    """A row of this paper; ``number``, ``kind``, ``title``, ``home``, ``build`` and ``more`` are fields of `Row`."""
    return Row(system.KEY, number, kind, title, home, build, **more)


def equations() -> tuple[Row, ...]:
    """Every numbered statement of the paper."""
    pictures, smooth = f"{HERE}.pictures.figures", f"{STUDY}.nonsmooth"
    return (
        row("(1a)", "equation", "dr_i/dt = v_i", "flocking.engine.codegen._stages_source", examples.displacement_of),
        row("(1b)", "equation", "dv_i/dt = u_i", "flocking.engine.codegen._stages_source",
            examples.velocity_change_of),
        row("(2)", "equation", "heading angle of an agent", f"{MODEL}.observables.headings", examples.headings_of,
            note="arctan of two arguments is the angle of the vector, in (-pi, pi]."),
        row("(3)", "equation", "u_i = a_i + alpha_i", f"{MODEL}.law.Law", examples.control_of),
        row("L(G)", "equation", "Laplacian L = B B^T", f"{STUDY}.nets.laplacian", examples.laplacian_of),
        row("lambda_2", "equation", "the second largest eigenvalue is the algebraic connectivity",
            f"{STUDY}.nets.algebraic_connectivity", examples.second_eigenvalue_of,
            reading="The second smallest, as in Part I.", fault=Fault.MISPRINT, demonstration=wrong.second_eigenvalue),
        row("Definition IV.1", "definition", "neighbouring graph", f"{MODEL}.graphs.Proximity", examples.links_of,
            reading="N_i leaves out i itself.", fault=Fault.MISPRINT),
        row("Definition IV.2", "definition", "potential function", f"{STUDY}.potential_check.check_potential",
            examples.definition_of),
        row("U_ij", "equation", "a nonsmooth potential", f"{MODEL}.potentials.Potential.capped", examples.potential_of,
            reading="V_R is not given. The potential is called continuous at R: V_R = 1/R^2 + log R^2."),
        row("U_i", "equation", "total potential of agent i", f"{STUDY}.state_energy.agent_energies",
            examples.agent_potentials_of, reading=COUNT, fault=Fault.MISPRINT, demonstration=wrong.unlinked_count),
        row("(4)", "equation", "the control law", f"{MODEL}.law.Law", examples.control_of),
        row("Definition V.1", "definition", "Filippov solution", f"{smooth}.filippov_corners", examples.filippov_of),
        row("(5)", "equation", "differential equation with a discontinuous right-hand side",
            f"{smooth}.filippov_corners", examples.filippov_of),
        row("after Definition V.1", "remark", "for a measurable right-hand side Filippov's solution is unique",
            f"{smooth}.filippov_corners", examples.filippov_of, reading=UNIQUE, fault=Fault.FALSE,
            demonstration=wrong.two_solutions),
        row("Definition V.2", "definition", "generalized directional derivative", f"{smooth}.generalized_derivative",
            examples.generalized_derivatives_of),
        row("Definition V.3", "definition", "generalized gradient", f"{smooth}.generalized_gradient",
            examples.gradient_of),
        row("Theorem V.4", "theorem", "it is the hull of limits of gradients", f"{smooth}.generalized_gradient",
            examples.gradient_of),
        row("Definition V.5", "definition", "regular function", f"{smooth}.is_regular", examples.regularity_of),
        row("Theorem V.6", "theorem", "set-valued rate of a function along solutions", f"{smooth}.energy_rates",
            examples.rates_of,
            note="It asks for a regular function, which Q is not: its set may be empty at a switch."),
        row("Theorem V.7", "theorem", "nonsmooth invariance principle", f"{HERE}.theorems.claims", examples.theorem_of),
        row("Assumption VI.1", "assumption", "the graph remains connected",
            f"{STUDY}.evidence.Evidence.first_disconnected", examples.first_loss_of, note=ASSUMED),
        row("Theorem VI.2", "theorem", "flocking in switching networks, all U_i minimal", f"{HERE}.theorems.claims",
            examples.theorem_of, reading=STATIONARY, fault=Fault.FALSE, demonstration=wrong.minimises),
        row("(6)", "equation", "Q = (1/2) sum (sum U_ij + v_i^T v_i)", f"{STUDY}.state_energy.total_energy",
            examples.energy_of, reading="The inner sum runs over j different from i.", fault=Fault.MISPRINT),
        row("after (6), distances", "equation", "level sets of Q bound the distances by U^-1(c (N-1))",
            f"{HERE}.theorems.distances_bounded", examples.distance_margin_of, reading=DISTANCE,
            fault=Fault.FALSE, demonstration=wrong.distance_bound),
        row("after (6), speeds", "equation", "level sets of Q bound the speeds by sqrt(c)",
            f"{STUDY}.general_claims.speeds_bounded", examples.speed_margin_of, reading=SPEED,
            fault=Fault.FALSE, demonstration=wrong.speed_bound),
        row("(7)", "equation", "level sets of Q are compact where the graph is connected",
            f"{HERE}.theorems.distances_bounded", examples.level_set_of,
            note="With the bounds sqrt(2 c) and (N-1) R."),
        row("Lemma VI.3", "lemma", "U_ij is regular everywhere", f"{smooth}.is_regular", examples.regularity_of,
            reading=NOT_REGULAR, fault=Fault.FALSE, demonstration=wrong.regularity),
        row("Corollary VI.4", "corollary", "(8): the generalized gradient at R is empty",
            f"{smooth}.generalized_gradient", examples.gradient_of, reading=NOT_EMPTY, fault=Fault.FALSE,
            demonstration=wrong.empty_gradient, also=("(8)",)),
        row("Lemma VI.5", "lemma", "(9): the partial generalized gradient at R is empty",
            f"{smooth}.generalized_gradient", examples.partial_gradient_of, reading=NOT_EMPTY, fault=Fault.FALSE,
            demonstration=wrong.empty_gradient, also=("(9)",)),
        row("(10)", "equation", "dQ/dt lies in -co{v_x^T L_t v_x + v_y^T L_t v_y}", f"{smooth}.energy_rates",
            examples.both_rates_of, note="It holds with the gradient of (8) as it is: where a pair leaves the set is"
            " part of the hull, where one enters it is empty."),
        row("before (11)", "equation", "forces are in the range of B_t, orthogonal to span{1}",
            f"{STUDY}.equilibrium.Equilibrium", examples.potential_forces_of),
        row("(11)", "equation", "in the limit set accelerations are in span{1} and orthogonal to it: they vanish",
            f"{MODEL}.law.Law", examples.invariant_set_of),
        row("sec. VII", "example", "the simulated start", f"{HERE}.system.scenario", examples.start_of,
            reading="The graph follows from the radius; the start is redrawn until it is connected."),
        row("Fig. 1", "figure", "the two control forces of an agent", f"{MODEL}.law.Law", examples.control_of),
        row("Fig. 2", "figure", "the nonsmooth potential", pictures, examples.picture_of(2)),
        row("Fig. 3", "figure", "initial configuration", pictures, examples.picture_of(3)),
        *(row(f"Fig. {number}", "figure", title, pictures, examples.picture_of(number),
              note="The printed time is in the picture alone; this one shows the same stage.")
          for number, title in ((4, "forces make links"), (5, "a tight formation"), (6, "one direction"),
                                (7, "steady state"))),
    )  # fmt: skip


def errata() -> list[Erratum]:
    """False statements and misprints of the paper."""
    return errata_of(equations())
