"""The simulated systems of Olfati-Saber 2003, sec. 11: six obstacles (Fig. 7, 8) and a sink (Fig. 9)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flocking.errors import InvalidInput
from flocking.model import starts
from flocking.model.checks import one_of
from flocking.model.energy import Energy
from flocking.model.graphs.distance_graphs import Graph, Proximity
from flocking.model.graphs.smooth_graphs import Smooth
from flocking.model.law import Law, Scenario
from flocking.model.leaders_and_obstacles.leaders import Sink, Velocity
from flocking.model.leaders_and_obstacles.obstacles import Ball
from flocking.model.parts.seeds import seeded
from flocking.model.potentials.structural_potential import structural_potential
from flocking.model.terms.avoidance import Avoid
from flocking.model.terms.body_terms import Track
from flocking.model.terms.pair_terms import Consensus, Gradient, Term

KEY = "olfati-saber-2003"
SINK = "olfati-saber-2003-sink"
FREE = "olfati-saber-2003-free"
"""Scenario with protocol (34) alone, for Proposition 4."""
SMOOTH = "olfati-saber-2003-smooth"
"""Scenario with protocol (35) alone, for Proposition 5."""

AGENTS = 100
"""Number of agents of the simulations with obstacles and with a sink."""
DISTANCE = 7.0
"""d_alpha."""
RADIUS = 1.2 * DISTANCE
"""r: the ratio of the two distances is 1.2, so that k0 is 5/6."""
ONSET = DISTANCE / RADIUS
"""k0 of the bump: 5/6."""
ATTRACTION, REPULSION = 1.0, 5.0
"""a and b of (29)."""
DAMPING = 1.0
"""c1."""
OBSTACLES = np.array([[100, 120, 150, 160, 200, 200], [20, 40, 40, 0, -5, 50], [10, 2, 5, 3, 20, 20]], dtype=float)
"""M_obs of (59), whose columns are (b_k, l_k)."""
DESIRED_VELOCITY = (10.0, 0.0)
"""p_d. Printed as (0, 10), but the gap of 15 between the last two obstacles lies along y."""
BETA_RANGE = RADIUS / 2
"""r_0 = d_beta."""
BETA_GAIN, BETA_DAMPING = 100.0, 2.0
"""c3, c4."""
GAMMA_OFFSET, GAMMA_DISTANCE = 1.0, DISTANCE
"""lambda_d, d_gamma."""
TRACKING_GAIN = 10.0
"""c2 of the translational controller, per agent and linear."""
START_BOX = ((-140.0, 12.5), (160.0, 20.0))
"""Corner and sides of the start region: [-140, 20] x [12.5, 32.5]."""
OBSTACLE_DURATION = 50.0
"""Duration of the simulation with obstacles."""

SINK_ATTRACTION, SINK_REPULSION = 50.0, 250.0
"""a, b for Fig. 9: with 1 and 5 the sink compresses a hundred agents. c is the same."""
SINK_DAMPING = 5.0
"""c2 of (50)."""
SINK_BOX = 120.0
"""Side of the start square around the sink."""
SINK_DURATION = 40.0
"""Duration of the simulation with the sink."""
FREE_AGENTS = 30
"""Number of agents of the simulation of a protocol alone; not in the paper."""
FREE_NOISE, FREE_SPEED = 0.7, 0.5
"""Standard deviations of each coordinate about a lattice of spacing d_alpha, and of each velocity component."""
FREE_DURATION = 300.0
"""Duration of the simulation of a protocol alone; not in the paper."""


def alpha_terms(
    a: float = ATTRACTION,
    b: float = REPULSION,
    c1: float = DAMPING,
    *,
    weighting: str = "energy",
    weighted: bool = False,
) -> tuple[Term, ...]:
    """The (alpha, alpha) interaction: (34) on a uniform net, (35) on a smooth one, (36) with ``weighting="force"``.

    Parameters
    ----------
    a, b
        Strengths of attraction and repulsion in (29).
    c1
        Damping gain.
    weighting
        ``"energy"`` for (35), ``"force"`` for (36).
    weighted
        Whether the damping is weighted by a_ij; it is not in the paper.
    """
    gradient = Gradient(structural_potential(DISTANCE, a, b), weighting=weighting)
    return (gradient, Consensus(c1, weighted=weighted))


def hard_net() -> Proximity:
    """The uniform net (8)."""
    return Proximity(RADIUS, closed=True)


def smooth_net(bump: str = "cosine") -> Smooth:
    """The uniform net with smooth adjacency (17) and a ``bump``."""
    return Smooth(RADIUS, ONSET, bump)


def obstacles() -> tuple[Ball, ...]:
    """The six obstacles of (59)."""
    return tuple(Ball(column[:2], column[2]) for column in OBSTACLES.T)


@seeded
def obstacle_scenario(
    seed: int = 0,
    *,
    tracking: str = "agent",
    tracking_gain: float = TRACKING_GAIN,
    gamma_agents: bool = True,
    box: tuple[tuple[float, float], tuple[float, float]] = START_BOX,
    agents: int = AGENTS,
) -> Scenario:
    """Task 1: a hundred agents pass six obstacles at a desired velocity, protocol (58).

    Parameters
    ----------
    seed
        Seed of the start.
    tracking
        ``"agent"``: -c2 (p_i - p_d) for each agent. ``"shared"``: the bounded feedback (66) of the mean.
    tracking_gain
        c2.
    gamma_agents
        Whether obstacles have gamma-agents.
    box
        Corner and sides of the start region; it decides the density after the obstacles.
    agents
        Number of agents.

    Raises
    ------
    InvalidInput
        If the tracking is none of these, or a value is out of range.
    """
    leader = Velocity(DESIRED_VELOCITY)
    one_of("olfati-saber-2003", "tracking", tracking, ("agent", "shared"))
    shared = tracking == "shared"
    follow = Track(leader, velocity_gain=tracking_gain, shared=shared, saturated=shared)
    avoid = Avoid(
        obstacles(), leader, range=BETA_RANGE, repulsion_gain=BETA_GAIN, damping_gain=BETA_DAMPING,
        attraction=structural_potential(GAMMA_DISTANCE, ATTRACTION, REPULSION), offset=GAMMA_OFFSET, onset=ONSET,
        gamma_agents=gamma_agents,
    )  # fmt: skip
    law = Law(smooth_net(), (*alpha_terms(), follow, avoid))
    corner, sides = box
    start = starts.box(agents, side=sides, corner=corner, seed=seed)
    return Scenario(
        law,
        start,
        t_end=OBSTACLE_DURATION,
        energy=Energy("centre of mass", name="H_s"),
        tolerance=1e-8,
        name=KEY,
        seed=seed,
    )


@seeded
def sink_scenario(
    seed: int = 0,
    *,
    a: float = SINK_ATTRACTION,
    b: float = SINK_REPULSION,
    c2: float = SINK_DAMPING,
    agents: int = AGENTS,
) -> Scenario:
    """Task 2: a hundred agents gather at a sink, protocol (50).

    Parameters
    ----------
    seed
        Seed of the start.
    a, b
        Strengths of the (alpha, alpha) interaction.
    c2
        Damping of the pursuit.
    agents
        Number of agents.
    """
    follow = Track(Sink((0.0, 0.0)), position_gain=1.0, velocity_gain=c2)
    law = Law(smooth_net(), (*alpha_terms(a, b), follow))
    start = starts.box(agents, side=SINK_BOX, corner=(-SINK_BOX / 2, -SINK_BOX / 2), seed=seed)
    return Scenario(
        law, start, t_end=SINK_DURATION, energy=Energy("lab", name="H"), tolerance=1e-8, name=SINK, seed=seed
    )


@seeded
def free_scenario(seed: int = 0, *, smooth: bool = False, agents: int = FREE_AGENTS) -> Scenario:
    """Protocol (34) or (35) alone, from a perturbed lattice, as in Propositions 4 and 5.

    They assume a flock at the end. Agents interact only through links, and from wide or fast starts they separate into
    several flocks; from these starts most nets stay connected. The damping of (35) jumps at r as printed: a slow pair
    may slide along r, and the run then ends with an error.

    Parameters
    ----------
    seed
        Seed of the start.
    smooth
        Whether to use protocol (35) on the smooth net instead of (34).
    agents
        Number of agents.
    """
    net: Graph = smooth_net() if smooth else hard_net()
    start = starts.hexagonal(agents, spacing=DISTANCE, noise=FREE_NOISE, speed=FREE_SPEED, seed=seed)
    return Scenario(
        Law(net, alpha_terms()), start, t_end=FREE_DURATION, energy=Energy("centre of mass", name="H_s"),
        tolerance=1e-8, name=SMOOTH if smooth else FREE, seed=seed,
    )  # fmt: skip


@seeded
def scenario(figure: int | None = None, seed: int = 0) -> Scenario:
    """The scenario of a figure: 9 the sink, 7 and 8 the obstacles, as for the diagrams 1 to 6.

    Parameters
    ----------
    figure
        Number of the figure; the obstacles by default.
    seed
        Seed of the start.

    Raises
    ------
    InvalidInput
        If there is no such figure.
    """
    if figure is not None and figure not in range(1, 10):
        raise InvalidInput("olfati-saber-2003", "figure", "must be one of 1 to 9", figure)
    return sink_scenario(seed) if figure == 9 else obstacle_scenario(seed)


def scenarios() -> dict[str, Callable[[int], Scenario]]:
    """Scenarios of this paper by name, each a function of the seed."""
    return {
        KEY: obstacle_scenario,
        SINK: sink_scenario,
        FREE: free_scenario,
        SMOOTH: lambda seed: free_scenario(seed, smooth=True),
    }
