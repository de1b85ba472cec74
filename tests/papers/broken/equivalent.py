"""Faults that change nothing: each with the rule that says why."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tests.papers.broken.homes import Mutant

SYMMETRIC_GAP = "the difference of two headings is the same seen from either agent"
ANY_LENGTH = "numpy reads every negative length as the one that fits"
NO_HEADINGS = "the count serves only where there are no headings, which is refused"
GRID = "a wider bracket holds the maximum too, and the largest slope of the grid is taken besides"
EQUAL_MASSES = "equal masses give the same mean, whatever they are"
DEEPER = "a block may be indented by more, and what the last turn of a loop assigns stands after it as well"
TWO_WAYS = "both ways of computing it give the same"
FINER = "another number of terms, or of squares, gives the same digits"
CHECK = "a check of arguments"
UNUSED = "a value that no formula reads is assigned too"
RULES: tuple[tuple[str, str, str], ...] = (
    ("matrices.adjacency", "index: [(i, j)] turned round", SYMMETRIC_GAP),
    ("matrices._matrix", "sign: minus matrix", "algebraic_connectivity passes its matrix through _matrix twice"),
    ("structural_nets._weights", "times adjacency", "a vote asks only whether a weight is positive"),
    ("views.Cone.allowed", "in -1", ANY_LENGTH),
    ("views.Cone.start_links", "in -1", ANY_LENGTH),
    ("Cone.allowed", "in max(n, 1)", NO_HEADINGS),
    ("Cone.allowed", "in 0 if headings is None", NO_HEADINGS),
    ("observables.mean_", "constant: 3 for 1 in ", EQUAL_MASSES),
    ("observables.mean_", "constant: 1.05 for 1 in ", EQUAL_MASSES),
    ("diagrams.pair_potentials", "[(0, 1)] turned round", "the adjacency matrix of two agents is symmetric"),
    ("Bump.steepest", "best", GRID),
    ("Bump.steepest", "GRID = ", "a finer grid brackets the same maximum, which is refined in both"),
    ("Bump.steepest", "len(grid) - 1", GRID),
    ("Bump.steepest", "without method = 'bounded'", "the method that scipy takes where bounds are given"),
    ("translational_energy", "leader.at(0.0)", "sinks and constant velocities are the same at all times"),
    ("Track.storage", "swap: arguments of zip(", "squares of differences"),
    ("Track.balance", "swap: arguments of zip(", "the factors of a scalar product may change places"),
    ("diagrams.beta_agent", "other sign in places['alpha'] +", "a circle about a point is its own mirror image"),
    *(
        ("system.obstacle_scenario", f"without {name} = ", "the paper's number is the default of the term")
        for name in ("damping_gain", "offset", "repulsion_gain", "attraction", "onset")
    ),
    ("cucker_smale_2007.closed_forms.discrete_step", "index: 0 for 1 in axis", "the matrix of weights is symmetric"),
    ("cucker_smale_2007.closed_forms.sufficient_condition", "1.05 times np.inf", "infinity times a number is infinite"),
    ("vicsek_1995.closed_forms.deviations", "other sign in turned + np.pi", "both angles differ by a full turn"),
    ("vicsek_1995.system._of", "Div in duration * STEP", "the unit of time is one update"),
    ("order_curves.order_series", "Div in (k + 1) * system.STEP", "the unit of time is one update"),
    *(
        ("order_curves.order_series", text, "the motion does not depend on how many frames are kept")
        for text in ("frames", "frames = 1")
    ),
    *(
        ("olfati_saber_2006.closed_forms.pair_potential", text, "the integral has ten digits whatever the rule is told")
        for text in ("points = kink", "ALPHA_ONSET", "epsabs", "epsrel", "limit")
    ),
    ("structural_energy", "index: [(i, j)] turned round", "the matrix of distances is symmetric"),
    ("Ball.signed_distance", "swap: arguments of zip(q", "squares of differences"),
    ("Wall.__post_init__", " in length - 1.0", "scaling a unit vector changes its last bits alone"),
    ("Wall.__post_init__", "other sign in length - 1.0", "scaling a unit vector changes its last bits alone"),
    ("passage.gap_width", "OBSTACLES = with 105 at 0", "the gap lies between the last two obstacles"),
    ("pictures.passage", "in o.outline(8)", "the mean of the corners of a regular polygon is its centre"),
    ("Fixed.random_connected", "in range(100000)", "the number of draws before it is refused"),
    ("Fixed.random_connected", "in upper[0]", "both arrays of the indices of pairs have the same length"),
    (
        "tanner_2003_dynamic.system.scenario",
        "without frames = frame_times()",
        "the times of the snapshots are among the even times that a scenario has by itself",
    ),
    ("tanner_2003_dynamic.pictures.times", "SNAPSHOT_TIMES = with 0.05 at 0", "the first time is left out"),
    ("heading_gaps", "swap: arguments of np.clip(gap", "the larger one of two numbers may be named in either order"),
    ("final_distance", "1.05 times np.inf", "infinity times a number is infinite"),
    *(
        ("nonsmooth.is_regular", text, "the curvature beside a kink is a bound of rounding, and need not be exact")
        for text in ("STEPS", "in -1", "r * np.abs(potential.curvature(")
    ),
    *(
        ("structural_nets._descent", f"sign: minus {text}", "only squares of the gradient are read")
        for text in ("evaluate(", "found")
    ),
    (
        "structural_nets._descent",
        "without agents = agents",
        "links are given, no directed graph weighs by headings",
    ),
    *(
        ("rigid_motion.converse_conditions", text, "a bound of rounding need not be exact")
        for text in ("1.05 times ROUNDING", "without axis", "in axis")
    ),
    (
        "Equilibrium._set_pairs",
        "in np.where(self.r > 0",
        "the direction of a pair at one place is 0, whatever divides it",
    ),
    ("diagrams.neighbourhoods", "other sign in headings[0] +", "the first agent heads along x, at an angle of 0"),
    ("diagrams._neighbours", "without arrows = False", "the agents of Fig. 1 are at rest and have no arrows"),
    ("diagrams._neighbours", "True for False in a keyword", "the agents of Fig. 1 are at rest and have no arrows"),
    ("control._pair_values", "in np.where(r > 0", "the direction of a pair at one place is 0, whatever divides it"),
    ("Obstacle.geometry", "swap: arguments of zip(normals, p", "the factors of a scalar product may change places"),
    *(
        ("motion_source", f"for {words}", DEEPER)
        for words in ("1 in unpack(", "1 in indented([f'out", "2 in indented(")
    ),
    ("motion_source", "without if f'", UNUSED),
    ("nonsmooth.energy_rates", "in -1.0", "where a multiple of a quantity is least, the quantity is least too"),
    ("Heading.desired", "1.05 times np.asarray(found)", "the new heading is the direction alone of what is desired"),
    ("Heading.updated", "in np.where(still, 1.0", "where nothing is desired the heading is kept, whatever divides it"),
    ("order_curves.order_series", "without engine = 'discrete'", "agents in discrete time have this engine alone"),
    ("zhou_2015.system.scenario", "without velocity_gain = ", "the paper's number is the default of the term"),
    ("obstacles._first_that_holds", "in (last[0], True)", "the last piece is taken wherever no earlier one holds"),
    ("obstacles._by_feature", "swap: arguments of sympy.Eq(", "an equation may be read from either side"),
    ("density_waves.waves_of", "best) / side % 1.0", "strips are counted modulo their number besides"),
    ("sees_places", "return True at once", "it is true of all such terms"),
    ("ShillWalls.steer", "Div in -self.speed * np.sign(", "the sign is 1 or -1 wherever a force is taken"),
    ("TurnBack.steer", "other sign in desired - seen.p", "what lies along the velocity is taken off"),
    ("rules.next_state", "[(:, None)] turned round", "one agent acts: its number is one row and one column"),
    ("observations.measured", "in -1", ANY_LENGTH),
    ("vasarhelyi_2018.system.unit", "without substeps = ", "the paper's number is the default of the body"),
    ("vasarhelyi_2018.system._of", "without scaled = ", "a flock's vehicles are those that are not scaled"),
    ("vasarhelyi_2018.parameters.at", "without minlength = ", "there is an agent of the last label"),
    *(
        ("vasarhelyi_2018.parameters.at", text, "the squares of all entries are added")
        for text in ("in axis", "without axis")
    ),
    ("vasarhelyi_2018.parameters.at", "in np.where(speeds > 0.0", "the direction at rest is 0, whatever divides it"),
    ("vasarhelyi_2018.parameters.at", "in max(len(q) * (len(q) - 1), 1)", "of no pairs none is near"),
    *(
        ("agreement._propagator", words, TWO_WAYS)
        for words in (
            "without np.fill_diagonal(weights",
            "for 0 in np.fill_diagonal(weights",
            "weights < 0.0",
            "matrix.copy()",
        )
    ),
    *(
        ("agreement._propagator", words, FINER)
        for words in (
            "in max(0, int(",
            "TERMS",
            "fastest * length",
            "SHORT = ",
        )
    ),
    ("agreement._propagator", "initial", "there are agents, so that some rate is the largest"),
    *(
        ("agreement._propagator", words, "rows sum to 1 but for rounding")
        for words in (
            "keepdims",
            "Mult in found / found.sum(",
        )
    ),
    (
        "agreement._propagator",
        "1.05 for 1 in 1.0 - matrix.diagonal()",
        "what is added to the diagonal is a factor of all numbers, and rows are made to sum to 1",
    ),
    ("connectivity.is_connected", "for 0 in _reached(either, 0)", "whoever is asked, all are reached or not"),
    ("nets.agreement.agree", "index: 0 for 1 in -1", "what all have in common may be any of their values"),
    *(
        ("connectivity.is_connected", words, TWO_WAYS)
        for words in (
            "for 0 in 0 < len(either) <= WORD",
            "0 < len(either) <= WORD for not",
            "not (not 0 < len(either) <= WORD)",
            "not 0 < len(either) <= WORD",
        )
    ),
    ("State.check_extent", ": ", CHECK),
    ("State.__post_init__", "And in links.shape != (", CHECK),
    ("zhou_2015.system.scenario", "constant: LONGEST = ", CHECK),
    ("closed_forms._outside", "constant: ROUNDING = ", CHECK),
    *(("sigma_norm.SigmaNorm", f"without {word} = 'ignore'", "a warning is silenced") for word in ("over", "invalid")),
    ("Potential._evaluate", "BitOr in np.isnan(found)", "the plain potential has the same values wherever it is asked"),
    (
        "check_potential",
        "without potential = potential",
        "bounds between the places looked at decide on no case",
    ),
    *(("agent_energies", words, "the links of the case are the same from both sides") for words in ("in axis",)),
    (
        "agent_energies",
        "without agents = agents",
        "agents decide on links by their headings alone",
    ),
    ("reference.control._evaluated", "other branch of 0.0 if (own == u)", "the rest is zero but for rounding"),
    ("observables.headings", "other sign in state.p[:, 1] + 0.0", "an angle of minus zero is zero"),
    ("closed_forms.lone_speeds", "Mult in system.STEP / system.TIME_CONSTANT", "the time constant is one second"),
)
"""Function, words of the fault, and why it changes nothing."""


def reason(mutant: Mutant) -> str:
    """Why a mutant behaves as the sound home does; empty where nothing says so."""
    for place, words, why in RULES:
        if place in mutant.where and words in f"{mutant.kind}: {mutant.what}":
            return why
    return ""
