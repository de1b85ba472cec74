"""Rows of section 11: obstacles, beta- and gamma-agents, the two tasks and their pictures."""

from __future__ import annotations

from flocking.papers.olfati_saber_2003 import counterexamples as wrong
from flocking.papers.olfati_saber_2003 import examples_obstacles as examples
from flocking.papers.olfati_saber_2003 import examples_runs as runs
from flocking.papers.olfati_saber_2003.table_nets import HERE, MODEL, STUDY, row
from flocking.study.equations import Fault, Row

BRACKET = "phi_beta(|qhat - q| - d_beta), as in (34): the printed bracket subtracts d_beta from the force."
REPELLING = (
    "phi_beta is called a repelling force and not given: z/sqrt(1 + z^2) - 1, between -2 and 0. Nor is d_beta: r0."
)
FADES = "As printed rho multiplies the beta term alone: the gamma-agent's pull and the damping begin at r0 with a jump."
SHARED_PLACE = "The place of a gamma-agent is x_k = b_k + lambda_d n_d; (54) and the line above it call it x_i."
MATCHING = (
    "K_(n,n) is the usual sign of the complete bipartite graph; meant is the one with n_beta edges, one for each"
    " beta-agent. An agent near two obstacles has two."
)
NECESSARY = (
    "Agents may be held back without it, as the text goes on; not every agent is. The one of the example passes an"
    " obstacle without a gamma-agent."
)
PRIORITY = "How much c3 exceeds 1 is not given: 100."
OUTSIDE = "Outside the obstacle. Inside, where the printed argmin is the agent itself, distances count negative."
COLUMNS = "The columns are (b_k, l_k)."
ALONG_X = "p_d = (10, 0): the gap of 15 between the last two obstacles is along y."
TRACKING = "u_tr is not given: -c2 (p_i - p_d) for every agent, c2 = 10. The shared (66) does not reproduce Fig. 8."
MISSING = "r0 = d_beta = 4.2, c3 = 100, c4 = 2, lambda_d = 1, d_gamma = 7, start box and duration are not given."


def obstacle_rows() -> tuple[Row, ...]:
    """Section 11."""
    obstacle, avoid = f"{MODEL}.obstacles.Obstacle", f"{MODEL}.avoidance.Avoid"
    claims, figures, forms = f"{HERE}.theorems.claims", f"{HERE}.pictures.figures", f"{HERE}.closed_forms"
    return (
        row("d(q, O)", "definition", "distance from an obstacle", f"{obstacle}.distance", examples.distance),
        row(
            "(53)", "equation", "projection on an obstacle", f"{obstacle}.project", examples.projection, reading=OUTSIDE
        ),
        row(
            "beta-agent",
            "definition",
            "active obstacles: within r0",
            avoid,
            examples.active,
        ),
        row(
            "gamma-agent",
            "definition",
            "its place x_k = b_k + lambda_d n_d in the obstacle",
            avoid,
            examples.gamma_pull,
        ),
        row(
            "K_n_beta",
            "definition",
            "bipartite graph of agents and their beta-agents",
            f"{STUDY}.obstacle_links.beta_links",
            examples.two_obstacles,
            reading=MATCHING,
        ),
        row(
            "gamma-agents are necessary",
            "remark",
            "a gamma-agent is necessary to steer an agent around an obstacle",
            avoid,
            examples.passing_alone,
            reading=NECESSARY,
            fault=Fault.READING,
            demonstration=wrong.passes_alone,
        ),
        row("Fig. 6", "figure", "an alpha-, a beta- and a gamma-agent", figures, runs.picture("6")),
        row(
            "(54)",
            "protocol",
            "control near an obstacle",
            avoid,
            examples.protocol_54,
            reading=BRACKET,
            fault=Fault.MISPRINT,
            demonstration=wrong.bracket,
        ),
        row(
            "x_i of (54)",
            "equation",
            "(x_i, 0) are place and velocity of a gamma-agent",
            avoid,
            examples.gamma_pull,
            reading=SHARED_PLACE,
            fault=Fault.MISPRINT,
        ),
        row("phi_beta", "equation", "repulsion by the beta-agent", avoid, examples.beta_push, reading=REPELLING),
        row(
            "rho of (54)", "equation", "what fades at r0: the beta-agent's push", avoid, examples.fading, reading=FADES
        ),
        row("(55)", "equation", "beta-agent by contraction", f"{forms}.contraction", examples.contraction),
        row(
            "(56)",
            "equation",
            "velocity of the beta-agent",
            f"{obstacle}.geometry",
            examples.beta_velocity,
            note="Outside obstacles; inside, the velocity of the boundary takes its place.",
        ),
        row(
            "(57)", "equation", "rate ds/dt of the contraction", f"{forms}.contraction_rate", examples.contraction_rate
        ),
        row("Remark 7", "remark", "moving obstacles", f"{obstacle}.geometry", examples.moving_beta_velocity),
        row(
            "c_3 >> 1",
            "remark",
            "c_3 >> 1 gives avoiding obstacles the highest priority",
            avoid,
            examples.priority,
            reading=PRIORITY,
        ),
        row(
            "(58)",
            "protocol",
            "overall protocol",
            f"{HERE}.system.obstacle_scenario",
            examples.protocol_58,
            reading=TRACKING,
        ),
        row(
            "(59)",
            "equation",
            "six obstacles",
            f"{HERE}.system.obstacles",
            examples.obstacle_matrix,
            reading=COLUMNS,
            fault=Fault.MISPRINT,
            demonstration=wrong.rows_for_columns,
        ),
        row(
            "p_d",
            "equation",
            "desired group velocity",
            f"{HERE}.system.obstacle_scenario",
            examples.desired_velocity,
            reading=ALONG_X,
            fault=Fault.MISPRINT,
            demonstration=wrong.wrong_axis,
        ),
        row(
            "d_56",
            "equation",
            "the gap is too narrow for three agents abreast",
            f"{HERE}.passage.gap_width",
            examples.gap,
        ),
        row("task 1", "example", "split, rejoin and squeeze", claims, runs.passing, reading=MISSING),
        row(
            "Fig. 7",
            "figure",
            "agents among the obstacles",
            figures,
            runs.picture("7", runs.few_for_figures),
            reading=MISSING,
        ),
        row(
            "Fig. 8",
            "figure",
            "the same with links; density 0.97",
            figures,
            runs.picture("8", runs.few_for_figures),
            reading=MISSING,
        ),
        row(
            "task 2", "example", "gathering at a sink", claims, runs.sink, reading="a = 50, b = 250, c2 = 5; see (50)."
        ),
        row(
            "Fig. 9",
            "figure",
            "a flock forms at a sink",
            figures,
            runs.picture("9", runs.few_gathering),
            reading="Start uniform in [-60, 60]^2 at rest, 40 s.",
        ),
    )
