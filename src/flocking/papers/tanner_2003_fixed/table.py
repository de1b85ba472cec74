"""Equation table of Tanner I: where each numbered statement lives and how it is read."""

from __future__ import annotations

from typing import Any

from flocking.papers.tanner_2003_fixed import counterexamples as wrong
from flocking.papers.tanner_2003_fixed import examples, system
from flocking.study.equations import Erratum, Fault, Row, errata_of

MODEL, STUDY, HERE = "flocking.model", "flocking.study", "flocking.papers.tanner_2003_fixed"
SPEED = "From W <= c follows v^T v <= 2 c; the printed bound sqrt(c) forgets the factor 1/2 of W."
DISTANCE = ("Each link is at most V^-1(c) long (the larger branch), so that a path is at most (N-1) V^-1(c); the"
            " printed V^-1(c (N-1)) is too small where V grows faster than linearly.")  # fmt: skip
INVARIANT = ("True of an invariant set, as it is printed: with (11) the forces vanish there. Equal velocities at one"
             " instant do not suffice.")  # fmt: skip
STATIONARY = "The argument shows that the forces balance: the limit is stationary, V_i need not be at its minimum."


def row(number: str, kind: str, title: str, home: str, build: Any, **more: Any) -> Row:
    """A row of this paper; ``number``, ``kind``, ``title``, ``home``, ``build`` and ``more`` are fields of `Row`."""
    return Row(system.KEY, number, kind, title, home, build, **more)


def equations() -> tuple[Row, ...]:
    """Every numbered statement of the paper."""
    pictures = f"{HERE}.pictures.figures"
    return (
        row("(1a)", "equation", "dr_i/dt = v_i", "flocking.engine.codegen._stages_source", examples.displacement_of),
        row("(1b)", "equation", "dv_i/dt = u_i", "flocking.engine.codegen._stages_source",
            examples.velocity_change_of),
        row("(2)", "equation", "heading angle of an agent", f"{MODEL}.observables.headings", examples.headings_of,
            note="arctan of two arguments is the angle of the vector, in (-pi, pi]."),
        row("(3)", "equation", "u_i = a_i + alpha_i", f"{MODEL}.law.Law", examples.forces_of_law),
        row("L(G)", "equation", "Laplacian L = B B^T", f"{STUDY}.nets.laplacian", examples.laplacian_of),
        row("Definition IV.1", "definition", "neighbouring graph", f"{MODEL}.graphs.Fixed", examples.drawn_edges),
        row("Assumption IV.2", "assumption", "the graph is connected", f"{MODEL}.connectivity.is_connected",
            examples.connected_of),
        row("Definition IV.3", "definition", "potential function", f"{STUDY}.potential_check.check_potential",
            examples.definition_of),
        row("(4)", "equation", "V_i, the potential of agent i", f"{STUDY}.state_energy.agent_energies",
            examples.agent_potentials_of),
        row("(5)", "equation", "the control law", f"{MODEL}.law.Law", examples.forces_of_law),
        row("W", "equation", "W = (1/2) sum (V_i + v_i^T v_i)", f"{STUDY}.state_energy.total_energy",
            examples.energy_of),
        row("(6)", "equation", "level sets of W are compact: they bound speeds and distances",
            f"{STUDY}.general_claims.speeds_bounded", examples.level_set_of,
            note="For a connected graph, with the bounds sqrt(2 c) and (N-1) V^-1(c)."),
        row("after (6), distances", "equation", "level sets of W bound the distances by V^-1(c (N-1))",
            f"{HERE}.theorems.longest_path", examples.distance_limit_of, reading=DISTANCE,
            fault=Fault.FALSE, demonstration=wrong.distance_bound),
        row("after (6), speeds", "equation", "level sets of W bound the speeds by sqrt(c)",
            f"{STUDY}.general_claims.speeds_bounded", examples.speed_limit_of, reading=SPEED,
            fault=Fault.FALSE, demonstration=wrong.speed_bound),
        row("(7)", "equation", "gradients of V_ij are opposite", f"{MODEL}.terms.Gradient", examples.pair_forces_of),
        row("Theorem IV.4", "theorem", "flocking in a fixed network, all V_i minimal", f"{HERE}.theorems.claims",
            examples.theorem_of, reading=STATIONARY, fault=Fault.FALSE, demonstration=wrong.minimises),
        row("(8)", "equation", "dW/dt as the sum of the powers", f"{STUDY}.state_energy.total_energy",
            examples.total_power_of),
        row("(9)", "equation", "dW/dt = -v_x^T L v_x - v_y^T L v_y", f"{MODEL}.terms.Consensus.dissipation",
            examples.power_of, reading="Velocities have two components, not three.", fault=Fault.MISPRINT),
        row("(10)", "equation", "forces are -(B x I) times link gradients", f"{STUDY}.equilibrium.Equilibrium",
            examples.potential_forces_of),
        row("(11)", "equation", "forces are orthogonal to span{1}", f"{STUDY}.equilibrium.Equilibrium",
            examples.potential_forces_of),
        row("(12)", "equation", "in an invariant set of equal velocities accelerations are equal",
            f"{MODEL}.law.Law", examples.invariant_set_of, note=INVARIANT),
        row("Remark IV.5", "remark", "a complete graph keeps all agents apart", f"{HERE}.theorems.claims",
            examples.remark_of),
        row("sec. V", "example", "the simulated start", f"{HERE}.system.scenario", examples.start_of,
            reading="The paper gives neither potential nor graph: 1/s^2 + log s^2 without cut-off, and G(10, 0.3)"
                    " redrawn until connected."),
        row("Fig. 1", "figure", "the two control forces of an agent", f"{MODEL}.law.Law", examples.forces_of_law),
        row("Fig. 2", "figure", "an example of a potential", pictures, examples.picture_of(2),
            reading="No formula is given; Part II's is drawn."),
        row("Fig. 3", "figure", "initial configuration", pictures, examples.picture_of(3)),
        *(row(f"Fig. {number}", "figure", title, pictures, examples.picture_of(number))
          for number, title in ((4, "agents come close"), (5, "forces hold the group together"),
                                (6, "velocities converge"), (7, "one direction"), (8, "steady state"))),
    )  # fmt: skip


def errata() -> list[Erratum]:
    """False statements and misprints of the paper."""
    return errata_of(equations())
