"""Rows of sections 2 and 3: nets, flocks, agreement, bumps, structural nets."""

from __future__ import annotations

from typing import Any

from flocking.papers.olfati_saber_2003 import counterexamples as wrong
from flocking.papers.olfati_saber_2003 import examples_nets as examples
from flocking.papers.olfati_saber_2003 import examples_runs as runs
from flocking.papers.olfati_saber_2003.system import KEY
from flocking.study.equations import Fault, Row

MODEL, STUDY, HERE = "flocking.model", "flocking.study", "flocking.papers.olfati_saber_2003"
CLOSED = "Up to and including r; the support of the smooth adjacency (17) is r open."
SYMMETRIC = (
    "|theta_j - theta_i| is the same seen from either agent: with one radius and one opening for all, the net is"
    " undirected. The directed one is the field of view of Fig. 1(b): the bearing of x_j - x_i against i's heading."
)
COLUMN = "In-degree is the column sum, over all j; N_i holds who is seen by i."
VIEWS = (
    "True of the nets of (5) and (8). Not of fields of view as in Fig. 1(b), which the text calls uniform and directed;"
    " the example is one."
)
PROOF_COLUMN = "The column sums of L are out-degree minus in-degree, not the reverse; the conclusion stands."
WEIGHTED = "With smooth a_ij: omega_i = sum_j a_ij (theta_j - theta_i), so that omega = -L theta."
DIAGONAL = "a_ii = 0 here too; a_ij > 0 only for distances below r."
REGULAR = "Convex with corners apart: regular for n >= 4 and k below the shortest diagonal; equal sides do not suffice."
TEN = "f(4, k) = 10: of eleven graphs on four nodes only the complete one is impossible. 9 for sqrt 2 <= k < sqrt 3."


def row(number: str, kind: str, title: str, home: str, build: Any, **more: Any) -> Row:
    """A row of this paper; ``number``, ``kind``, ``title``, ``home``, ``build`` and ``more`` are fields of `Row`."""
    return Row(KEY, number, kind, title, home, build, **more)


def net_rows() -> tuple[Row, ...]:
    """Section 2."""
    adjacency, graphs, views = f"{STUDY}.nets.adjacency", f"{MODEL}.smooth_graphs", f"{MODEL}.views"
    return (
        row("(1)", "equation", "spherical neighbourhood", f"{graphs}.PerAgentRadii", examples.ball),
        row("(2)", "equation", "spatial adjacency matrix", adjacency, examples.directed_net, note=CLOSED),
        row("(3)", "equation", "neighbours of a node", adjacency, examples.neighbours),
        row(
            "after (3)",
            "remark",
            "a net is undirected where all radii agree",
            f"{graphs}.PerAgentRadii",
            examples.radius_agreement,
        ),
        row("Fig. 1", "figure", "spherical and conic neighbourhood", f"{HERE}.pictures.figures", runs.picture("1")),
        row(
            "(4)",
            "equation",
            "conic neighbourhood",
            f"{views}.Cone",
            examples.cones_of_their_own,
            note="Angles are real numbers as printed; wrapped ones are an option.",
        ),
        row(
            "(5)",
            "equation",
            "adjacency of a uniform conic net",
            f"{views}.Cone",
            examples.cone,
        ),
        row(
            "Remark 1",
            "remark",
            "conic regions for attitudes in SE(d)",
            f"{views}.heading_gaps",
            examples.attitude_cone,
        ),
        row(
            "(6)",
            "equation",
            "distance of rotations, trace(I - R^T R_i)/2",
            f"{views}.heading_gaps",
            examples.attitude_cone,
        ),
        row(
            "after (6)",
            "remark",
            "a uniform net of conic shells is in general directed",
            f"{views}.Cone",
            examples.cone,
            reading=SYMMETRIC,
            fault=Fault.FALSE,
            demonstration=wrong.undirected_cone,
        ),
        row(
            "Definition 1", "definition", "flock: weakly connected net", f"{STUDY}.nets.flock_members", examples.flocks
        ),
        row("(7)", "equation", "density of a net", f"{MODEL}.observables.density", examples.density),
        row(
            "quasi-flock",
            "definition",
            "net of density just below 1",
            f"{STUDY}.nets.is_quasi_flock",
            examples.quasi_flock,
            reading="Density at least 0.9.",
        ),
        row(
            "(8)",
            "equation",
            "adjacency of a uniform net",
            f"{MODEL}.graphs.Proximity",
            examples.uniform_net,
            note=CLOSED,
        ),
        row(
            "(9)",
            "equation",
            "in- and out-degree",
            f"{STUDY}.nets.in_degree",
            examples.degrees,
            reading=COLUMN,
            fault=Fault.MISPRINT,
            demonstration=wrong.in_degree,
        ),
        row(
            "(10)",
            "equation",
            "degree matrix",
            f"{STUDY}.nets.degree_matrix",
            examples.degree_matrix,
            reading="deg_out(v_i), a number per node.",
            fault=Fault.MISPRINT,
        ),
        row("(11)", "equation", "Laplacian", f"{STUDY}.nets.laplacian", examples.laplacian),
        row(
            "Proposition 1 i)",
            "proposition",
            "uniform nets are balanced",
            f"{STUDY}.nets.is_balanced",
            examples.uniform_balance,
            reading=VIEWS,
            fault=Fault.READING,
            demonstration=wrong.unbalanced_view,
        ),
        row(
            "Proposition 1 ii)",
            "proposition",
            "balanced exactly where 1^T L = 0",
            f"{STUDY}.nets.laplacian",
            examples.column_sums,
        ),
        row(
            "proof of Proposition 1 ii)",
            "equation",
            "the column sums of L are deg_in - deg_out",
            f"{STUDY}.nets.laplacian",
            examples.column_sums,
            reading=PROOF_COLUMN,
            fault=Fault.MISPRINT,
            demonstration=wrong.column_sum,
        ),
        row("(12)", "equation", "first-order dynamics", f"{STUDY}.agreement.agree", examples.agreement_motion),
        row(
            "(13)",
            "protocol",
            "agreement protocol",
            f"{STUDY}.agreement.agreement_law",
            examples.agreement,
            reading=WEIGHTED,
            fault=Fault.MISPRINT,
            demonstration=wrong.unweighted_agreement,
        ),
        row("(14)", "equation", "adjacency of two nodes apart and together", adjacency, examples.apart_and_together),
        row("(15)", "equation", "their Laplacians: L jumps at r", f"{STUDY}.nets.laplacian", examples.two_laplacians),
        row(
            "(16)",
            "equation",
            "bump function",
            f"{MODEL}.bumps.Bump",
            examples.bumps,
            reading="rho is not given: cosine by default, quintic and infinitely smooth on request.",
        ),
        row("L_rho", "assumption", "bumps have bounded slopes", f"{MODEL}.bumps.Bump.steepest", examples.steepest),
        row("Fig. 2", "figure", "a bump function and its slope", f"{HERE}.pictures.figures", runs.picture("2")),
        row(
            "(17)",
            "equation",
            "smooth adjacency",
            f"{graphs}.Smooth",
            examples.smooth_net,
            reading=DIAGONAL,
            fault=Fault.MISPRINT,
            demonstration=wrong.own_weight,
        ),
        row(
            "(18)",
            "equation",
            "smooth adjacency of the directed net of conic shells",
            f"{views}.SmoothCone",
            examples.smooth_cone,
            reading=SYMMETRIC,
            fault=Fault.FALSE,
            demonstration=wrong.undirected_smooth_cone,
        ),
        row("(19)", "equation", "smooth Laplacian of two nodes", f"{STUDY}.nets.laplacian", examples.smooth_laplacian),
        row("Lemma 1", "lemma", "weight and slope vanish beyond r", f"{graphs}.Smooth", examples.beyond_reach),
    )


def structure_rows() -> tuple[Row, ...]:
    """Section 3."""
    realization, shapes = f"{STUDY}.structure.is_realization", f"{STUDY}.conformations"
    return (
        row(
            "Remark 2",
            "remark",
            "structural net (n, d_alpha, r), k0 = d_alpha/r",
            f"{HERE}.system.smooth_net",
            examples.structural_net,
            reading="k0 is that of the bump (16).",
        ),
        row(
            "Note 1",
            "remark",
            "a net is a graph and a framework",
            f"{STUDY}.rigidity.rigidity_matrix",
            examples.framework,
        ),
        row("(20)", "equation", "realization: all links have length d_alpha", realization, examples.lattice),
        row(
            "polygons",
            "example",
            "an equilateral polygon realizes a cycle",
            realization,
            examples.polygon,
            reading=REGULAR,
            fault=Fault.FALSE,
            demonstration=wrong.thin_rhombus,
        ),
        row("Lemma 2", "lemma", "permutations of a realization are realizations", realization, examples.permuted),
        row("Note 2", "remark", "alpha-flocks among alpha-nets", f"{MODEL}.observables.flocks", examples.alpha_flocks),
        row("Example 1", "example", "six realizations for n = 4", f"{shapes}.conformations", examples.figure_3),
        row("Fig. 3", "figure", "the six realizations", f"{HERE}.pictures.figures", runs.picture("3")),
        row(
            "Problem 1",
            "problem",
            "number f(n, k) of conformations",
            f"{shapes}.count",
            examples.counts_over_ratio,
            note="An open problem of the paper; solved here for n <= 4, with coordinates.",
        ),
        row("Lemma 3", "lemma", "f(n, k) <= 2^(n (n - 1)/2)", f"{shapes}.upper_bound", examples.upper_bounds),
        row(
            "Remark 3",
            "remark",
            "f(n, k) = 1, 2, 4, 9 for n = 1 to 4, k < sqrt 2",
            f"{shapes}.count",
            examples.counts,
            reading=TEN,
            fault=Fault.FALSE,
            demonstration=wrong.ten_conformations,
        ),
    )
