"""The systems of Olfati-Saber 2006: Algorithms 1, 2 and 3 with the commonly cited settings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from flocking.model import starts
from flocking.model.checks import Array, integer, number
from flocking.model.energy import Energy
from flocking.model.graphs.smooth_graphs import Smooth
from flocking.model.law import Law, Scenario
from flocking.model.leaders_and_obstacles.leaders import Leader, Sink, Velocity
from flocking.model.leaders_and_obstacles.obstacles import Ball, Obstacle
from flocking.model.parts.seeds import seeded
from flocking.model.potentials.potential import Potential
from flocking.model.potentials.sigma_norm import SigmaNorm
from flocking.model.state import State
from flocking.model.terms.avoidance import Avoid
from flocking.model.terms.body_terms import Track
from flocking.model.terms.pair_terms import Consensus, Gradient, Term
from flocking.model.world.control import Held
from flocking.papers.named_scenarios import scenario_by_name

KEY = "olfati-saber-2006"
FRAGMENTS, SPACE, GENTLE, PRESSED = (f"{KEY}-{name}" for name in ("fragments", "space", "gentle", "pressed"))
SPLIT, SQUEEZE, FIRM, AGAINST = f"{KEY}-split", f"{KEY}-squeeze", f"{KEY}-firm", f"{KEY}-against"
NETWORK, HELD = f"{KEY}-network", f"{KEY}-network-held"

DISTANCE = 7.0
"""d, the distance of neighbours in a lattice."""
RADIUS = 1.2 * DISTANCE
"""r, the range of interaction."""
OBSTACLE_DISTANCE = 0.6 * DISTANCE
"""d', from which on an obstacle repels."""
OBSTACLE_RADIUS = 1.2 * OBSTACLE_DISTANCE
"""r', within which an agent has a beta-agent at an obstacle; its force and damping end at d' already, with rho_h."""
EPSILON = 0.1
"""eps of the sigma-norm."""
ATTRACTION = REPULSION = 5.0
"""a and b of the action function."""
ALPHA_ONSET, BETA_ONSET = 0.2, 0.9
"""h of the bump for pairs of agents and for obstacles."""

GAINS = (1.0, 4.5, 1.2)
"""c1 for alpha-, beta- and gamma-agents: of a public simulator, since the collected settings have none."""
FIRM_GAINS = (1.0, 300.0, 1.2)
"""The same with the gain for beta-agents of another public program, with which agents stay out of obstacles."""
GROUP_GAIN = 0.05
"""c1 of Algorithm 2 for 150 agents: the pull at the edge of their lattice stays below the largest repulsion of two
agents, 5/sqrt(eps)."""
AGENTS, FRAGMENT_AGENTS, SPACE_AGENTS, NETWORK_AGENTS, GENTLE_AGENTS = 150, 40, 50, 50, 10
"""Numbers of agents."""
START_DEVIATION = 50.0
"""Standard deviation of the coordinates of the start: variance 2500."""
START_VELOCITIES = (-2.0, -1.0)
"""Range of the components of the first velocities."""
GOAL_VELOCITY = 5.0
"""Speed of the gamma-agent along the first axis; not among the collected settings."""
DURATION = 30.0
"""Duration of the simulations; not among the collected settings."""

AGAINST_PLACES = ((80.0, 20.5), (74.0, 24.0), (74.0, 16.0))
"""Where three agents start that the gamma-agent leads straight at the first obstacle of the split; chosen here."""
AGAINST_DURATION = 6.0
"""Duration of their run: they reach the obstacle after two."""
AGAINST_DRIFT = 0.3
"""Largest distance by which their places differ between seeds."""

PASSAGE_DURATION = 150.0
"""Duration of the passage of obstacles: long after the last of them."""

SPLIT_OBSTACLES = ((100.0, 20.0, 10.0), (110.0, 60.0, 4.0), (120.0, 40.0, 2.0), (130.0, -20.0, 5.0),
                   (150.0, 40.0, 5.0), (160.0, 0.0, 3.0))  # fmt: skip
"""Centres and radii of the obstacles of split and rejoin."""
SQUEEZE_OBSTACLES = ((150.0, 30.0, 25.0), (150.0, 100.0, 25.0))
"""Those of the squeeze; their vertical places differ between transcriptions."""
NETWORK_OBSTACLES = ((75.0, 10.0, 10.0), (75.0, 50.0, 10.0))
"""Those of the published network simulator."""
NETWORK_STEP = 0.2
"""Time for which the simulator holds the control of its agents."""
NETWORK_DURATION = 50.0
"""Duration of its runs."""
NETWORK_GOAL, NETWORK_VELOCITY = (60.0, 25.0), (4.0, 0.0)
"""Place and velocity of its gamma-agent, which does not advance."""

POTENTIAL = "((a + b)*sqrt(1 + (z + c)**2) + (a - b)*z)/2"
"""The integral of phi; z stands for |r|_sigma - d_alpha."""
SIGMA_DIFFERENCE = "(r**2/(1 + sqrt(1 + eps*r**2)) - d)"
"""|r|_sigma - d."""


@dataclass(frozen=True)
class Algorithm:
    """One of the three algorithms.

    Parameters
    ----------
    number
        1 without, 2 with navigational feedback, 3 with obstacles too.
    gains
        c1 for alpha-, beta- and gamma-agents; c2 is 2 sqrt(c1). Algorithms 1 and 2 have no gain for alpha-agents.
    obstacles
        Obstacles of Algorithm 3.
    goal
        The gamma-agent, a leader.
    velocity
        Velocity of the gamma-agent where it is not that with which it moves.
    """

    number: int
    gains: tuple[float, float, float] = GAINS
    obstacles: tuple[Obstacle, ...] = ()
    goal: Leader | None = None
    velocity: Leader | None = None


def sigma_norm(epsilon: float = EPSILON) -> SigmaNorm:
    """|z|_sigma = (sqrt(1 + eps |z|^2) - 1)/eps for an ``epsilon``."""
    return SigmaNorm(epsilon)


def potential(
    distance: float = DISTANCE, attraction: float = ATTRACTION, repulsion: float = REPULSION, gain: float = 1.0
) -> Potential:
    """A potential of r whose slope is phi(|r|_sigma - d_alpha) r/sqrt(1 + eps r^2), the force before the bump.

    Parameters
    ----------
    distance
        d, where the force is zero.
    attraction, repulsion
        a and b, 0 < a <= b; c = |a - b|/sqrt(4 a b).
    gain
        Factor on all forces.
    """
    a = number("potential", "attraction", attraction, above=0.0)
    b = number("potential", "repulsion", repulsion, least=a)
    offset = abs(a - b) / np.sqrt(4.0 * a * b)
    text = f"k*{POTENTIAL.replace('z', SIGMA_DIFFERENCE)}"
    reach = float(sigma_norm()(number("potential", "distance", distance, above=0.0)))
    return Potential(text, k=gain, eps=EPSILON, d=reach, a=a, b=b, c=float(offset))


def repulsion(distance: float = OBSTACLE_DISTANCE) -> Potential:
    """A potential whose slope is (s1(|r|_sigma - d_beta) - 1) r/sqrt(1 + eps r^2), the force of a beta-agent.

    Parameters
    ----------
    distance
        d'.
    """
    return Potential(
        f"sqrt(1 + {SIGMA_DIFFERENCE}**2) - {SIGMA_DIFFERENCE}", eps=EPSILON, d=float(sigma_norm()(distance))
    )


def net() -> Smooth:
    """The proximity net with a_ij = rho_h(|q_j - q_i|_sigma/r_alpha)."""
    return Smooth(RADIUS, ALPHA_ONSET, sigma_norm=EPSILON)


def law(algorithm: Algorithm) -> Law:
    """The control law of an algorithm.

    Parameters
    ----------
    algorithm
        Its number and what it needs.
    """
    integer("law", "algorithm", algorithm.number, least=1)
    alpha, beta, gamma = algorithm.gains
    if algorithm.number < 3:
        terms: list[Term] = [Gradient(potential(), weighting="force"), Consensus(1.0, weighted=True)]
        if algorithm.number == 2:
            assert algorithm.goal is not None
            terms.append(Track(algorithm.goal, position_gain=gamma, velocity_gain=2.0 * float(np.sqrt(gamma))))
        return Law(net(), tuple(terms))
    assert algorithm.goal is not None
    avoid = Avoid(
        algorithm.obstacles, range=OBSTACLE_DISTANCE, repulsion_gain=beta, damping_gain=2.0 * float(np.sqrt(beta)),
        repulsion=repulsion(), onset=BETA_ONSET, gamma_agents=False, sigma_norm=EPSILON, fading_damping=True,
    )  # fmt: skip
    return Law(
        net(),
        (
            Gradient(potential(gain=alpha), weighting="force"),
            Consensus(2.0 * float(np.sqrt(alpha)), weighted=True),
            Track(algorithm.goal, position_gain=gamma, velocity_gain=0.0, saturated=True),
            Track(algorithm.velocity or algorithm.goal, velocity_gain=2.0 * float(np.sqrt(gamma))),
            avoid,
        ),
    )


def balls(rows: Sequence[Sequence[float]]) -> tuple[Ball, ...]:
    """Discs from rows of centre and radius.

    Parameters
    ----------
    rows
        One row (x, y, radius) for each.
    """
    return tuple(Ball(Sink([x, y]), radius) for x, y, radius in rows)


@seeded
def gaussian(agents: int, dimension: int, seed: int) -> State:
    """The start of the simulations: positions of variance 2500, velocity components in [-2, -1].

    Parameters
    ----------
    agents, dimension
        Number of agents and of dimensions.
    seed
        Seed of the draw.
    """
    rng = np.random.default_rng(seed)
    q = START_DEVIATION * rng.normal(size=(agents, dimension))
    return State(q, rng.uniform(*START_VELOCITIES, size=(agents, dimension)))


def lattice(agents: int) -> Array:
    """The ``agents`` points of a hexagonal lattice of spacing d that are nearest to its centre, shape (agents, 2)."""
    index = np.arange(-agents, agents + 1)
    i, j = (x.ravel() for x in np.meshgrid(index, index))
    points = DISTANCE * np.stack([i + 0.5 * j, np.sqrt(0.75) * j], axis=1)
    order = np.lexsort((points[:, 1].round(9), points[:, 0].round(9), (points**2).sum(axis=1).round(9)))
    return np.asarray(points[order[:agents]])


def goal(dimension: int = 2, place: Sequence[float] | None = None) -> Velocity:
    """A gamma-agent that moves along the first axis.

    Parameters
    ----------
    dimension
        Number of dimensions.
    place
        Where it starts; the origin by default.
    """
    return Velocity([GOAL_VELOCITY, *[0.0] * (dimension - 1)], start=place or [0.0] * dimension)


def _scenario(name: str, algorithm: Algorithm, start: State, seed: int, duration: float = DURATION) -> Scenario:
    return Scenario(
        law(algorithm), start, t_end=duration, frames=601, name=name, seed=seed, tolerance=1e-6,
        energy=Energy(frame="centre of mass") if algorithm.number == 1 else Energy(),
    )  # fmt: skip


@seeded
def group(
    seed: int = 0, *, dimension: int = 2, agents: int = AGENTS, gain: float = GROUP_GAIN, name: str = KEY
) -> Scenario:
    """A group under Algorithm 2.

    Parameters
    ----------
    seed
        Seed of the start.
    dimension, agents
        Number of dimensions and of agents.
    gain
        c1 of the navigational feedback; c2 is 2 sqrt(c1).
    name
        Name of the scenario.
    """
    algorithm = Algorithm(2, (1.0, 1.0, gain), goal=goal(dimension))
    return _scenario(name, algorithm, gaussian(agents, dimension, seed), seed, 4.0 * DURATION)


@seeded
def fragments(seed: int = 0) -> Scenario:
    """A group under Algorithm 1, which holds only neighbours together."""
    return _scenario(FRAGMENTS, Algorithm(1), gaussian(FRAGMENT_AGENTS, 2, seed), seed, 2.0 * DURATION)


@seeded
def gentle(seed: int = 0) -> Scenario:
    """Ten agents near a lattice under Algorithm 1, with less energy than one collision needs."""
    rng = np.random.default_rng(seed)
    q = lattice(GENTLE_AGENTS) + rng.uniform(-0.3, 0.3, (GENTLE_AGENTS, 2))
    return _scenario(GENTLE, Algorithm(1), State(q, rng.uniform(-0.5, 0.5, q.shape)), seed, 2.0 * DURATION)


@seeded
def among_obstacles(
    seed: int = 0, *, rows: Sequence[Sequence[float]] = SPLIT_OBSTACLES, gains: tuple[float, float, float] = GAINS,
    name: str = SPLIT,
) -> Scenario:  # fmt: skip
    """Forty agents under Algorithm 3 that pass obstacles.

    Parameters
    ----------
    seed
        Seed of the start, in a square of side 60 before the obstacles.
    rows
        Centres and radii of the obstacles.
    gains
        c1 for alpha-, beta- and gamma-agents.
    name
        Name of the scenario.
    """
    height = float(np.mean([row[1] for row in rows]))
    begin = starts.box(FRAGMENT_AGENTS, side=(60.0, 60.0), corner=(0.0, height - 30.0), seed=seed)
    algorithm = Algorithm(3, gains, balls(rows), goal(place=[40.0, height]))
    return _scenario(name, algorithm, begin, seed, PASSAGE_DURATION)


@seeded
def against(seed: int = 0) -> Scenario:
    """Three agents under Algorithm 3 that the gamma-agent leads straight at an obstacle.

    Parameters
    ----------
    seed
        Seed of small shifts of the start; 0 for none.
    """
    q, p = np.array(AGAINST_PLACES), np.tile([GOAL_VELOCITY, 0.0], (len(AGAINST_PLACES), 1))
    if seed:
        q = q + np.random.default_rng(seed).uniform(-AGAINST_DRIFT, AGAINST_DRIFT, q.shape)
    x, y, _ = SPLIT_OBSTACLES[0]
    algorithm = Algorithm(3, obstacles=balls(SPLIT_OBSTACLES[:1]), goal=goal(place=[x - 20.0, y]))
    return _scenario(AGAINST, algorithm, State(q, p), seed, AGAINST_DURATION)


@seeded
def network(seed: int = 0) -> Scenario:
    """The setting of a published network simulator, with ideal information and continuous control.

    Parameters
    ----------
    seed
        Seed of the start.
    """
    begin = starts.box(NETWORK_AGENTS, side=(50.0, 50.0), seed=seed)
    algorithm = Algorithm(
        3, obstacles=balls(NETWORK_OBSTACLES), goal=Sink(NETWORK_GOAL), velocity=Velocity(NETWORK_VELOCITY)
    )
    return _scenario(NETWORK, algorithm, begin, seed, NETWORK_DURATION)


@seeded
def held_network(seed: int = 0) -> Scenario:
    """The same with control that is held for 0.2, as the simulator runs it; every update is a frame.

    Parameters
    ----------
    seed
        Seed of the start.
    """
    made = network(seed)
    frames = round(NETWORK_DURATION / NETWORK_STEP) + 1
    return made.with_(control=Held(NETWORK_STEP), frames=frames, name=HELD)


def scenarios() -> dict[str, Callable[[int], Scenario]]:
    """Scenarios by name, each a function of the seed."""
    return {
        KEY: group,
        FRAGMENTS: fragments,
        SPACE: lambda seed: group(seed, dimension=3, agents=SPACE_AGENTS, name=SPACE),
        GENTLE: gentle,
        PRESSED: lambda seed: group(seed, dimension=3, agents=SPACE_AGENTS, gain=GAINS[2], name=PRESSED),
        SPLIT: among_obstacles,
        SQUEEZE: lambda seed: among_obstacles(seed, rows=SQUEEZE_OBSTACLES, name=SQUEEZE),
        FIRM: lambda seed: among_obstacles(seed, rows=SQUEEZE_OBSTACLES, gains=FIRM_GAINS, name=FIRM),
        AGAINST: against,
        NETWORK: network,
        HELD: held_network,
    }


FIGURES = {"A": FRAGMENTS, "B": KEY, "C": SPLIT, "D": SQUEEZE, "E": KEY}
"""Scenario of each figure of this package; those of the printed paper were not at hand."""


scenario = scenario_by_name(scenarios, FIGURES)
"""A scenario by its name, or that of a figure, see `scenario_by_name`."""
