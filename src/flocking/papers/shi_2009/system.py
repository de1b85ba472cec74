"""The simulated systems of Shi, Wang, Chu, sec. 4, with two starts."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from flocking.errors import InvalidInput
from flocking.model import starts
from flocking.model.checks import Array, integer, number, one_of
from flocking.model.energy import Energy
from flocking.model.graphs.distance_graphs import Proximity
from flocking.model.law import Law, Scenario
from flocking.model.leaders_and_obstacles.leaders import Path
from flocking.model.parts.seeds import seeded
from flocking.model.potentials.potential import Potential
from flocking.model.state import Agents, State
from flocking.model.terms.body_terms import Compensate, Track
from flocking.model.terms.pair_terms import Consensus, Gradient, Term
from flocking.papers.examples import check_figure

KEY = "shi-2009"
AGENTS = 10
"""Number of agents of the simulations."""
LAST_FIGURE = 12
"""Number of the last figure of the paper."""
SENSING_RADIUS = 4.0
"""R in (3)."""
STRENGTH = 0.05
"""a = b in (3)."""
START_RADIUS = 10.0
"""Radius of the start ball."""
LARGEST_SPEED = 4.0
"""Largest initial speed."""
COMPACT_RADIUS = 3.0
"""Radius of the second start; from the paper's start the graph often becomes disconnected."""
COMPACT_SPEED = 1.0
"""Largest initial speed of the second start."""
SMALLEST_MASS = 0.05
"""Smallest mass. The paper draws masses from (0, 1]; very small ones would make the system unnecessarily stiff."""
INFORMED = 5
"""Number of agents informed of the velocity (Fig. 4) or the acceleration (Fig. 10, 11); "some" in the paper."""
VELOCITY_GAIN = 1.0
"""h_0 in (8), (12), (15)."""
POSITION_GAIN = 1.0
"""r_0 in (15)."""
DURATION = 100.0
"""Duration of the simulations."""
LEADER_VELOCITY = ("sin(t)", "cos(t)")


def potential(a: float = STRENGTH, b: float = STRENGTH, R: float = SENSING_RADIUS) -> Potential:
    """Potential (3): singular at 0, smallest at sqrt(b/a), a cosine well out to R, constant beyond.

    Parameters
    ----------
    a, b
        Coefficients; for b > a/e the smallest value a (1 + ln(b/a)) is positive, as Definition 2 requires.
    R
        Sensing radius, above sqrt(b/a).

    Raises
    ------
    InvalidInput
        If a condition is not met, or a value is not a finite number.
    """
    a, b, R = (number("potential", name, value) for name, value in (("a", a), ("b", b), ("R", R)))
    if not (a > 0 and b > a / math.e):
        raise InvalidInput("potential", "b", f"must be above a/e = {a / math.e:.6g}, and a above 0", b)
    if not math.sqrt(b / a) < R:
        raise InvalidInput("potential", "R", f"must be above sqrt(b/a) = {math.sqrt(b / a):.6g}", R)
    inner = "a*log(r**2) + b/r**2"
    well = "a*(1 + log(b/a)) + cos((1 + (r**2 - b/a)/(R**2 - b/a))*pi) + 1"
    return Potential(f"where(r <= sqrt(b/a), {inner}, where(r <= R, {well}, a*(1 + log(b/a)) + 2))", a=a, b=b, R=R)


@dataclass(frozen=True)
class Setting:
    """One row of Table 1.

    Parameters
    ----------
    figure
        Number of its figure.
    law
        Equation number of the control law: 4, 8, 12 or 15.
    velocity
        Agents informed of the desired velocity: ``"all"`` or ``"some"``.
    acceleration
        Agents informed of its acceleration: ``"all"``, ``"some"`` or ``"none"``.
    connected
        Whether the row is for graphs that stay connected.
    """

    figure: str
    law: int
    velocity: str = "all"
    acceleration: str = "all"
    connected: bool = True


SETTINGS: dict[str, Setting] = {
    KEY: Setting("4", 4, velocity="some"),
    f"{KEY}-all-informed": Setting("5", 4),
    f"{KEY}-disconnected": Setting("6", 4, connected=False),
    f"{KEY}-uniform": Setting("", 8),
    f"{KEY}-velocity-only": Setting("7", 12, acceleration="none"),
    f"{KEY}-position": Setting("8", 15, acceleration="none"),
    f"{KEY}-partial": Setting("10", 4, acceleration="some"),
    f"{KEY}-partial-disconnected": Setting("11", 4, acceleration="some", connected=False),
}
"""Scenarios by name; ``-uniform`` is law (8) of Theorem 3, which the paper does not simulate."""


@seeded
def scenario(
    figure: int | None = None, seed: int = 0, *, name: str = KEY, compact: bool = False, informed: int = INFORMED
) -> Scenario:
    """One of the paper's simulations.

    Parameters
    ----------
    figure
        Number of a figure; from 4 on it selects the scenario of the figure.
    seed
        Seed of the start, the masses, the gains and the informed agents.
    name
        Name of the scenario, if no figure is given.
    compact
        Whether to start within radius 3 at speeds up to 1, where the graph seldom becomes disconnected, instead of the
        paper's radius 10 and speeds up to 4.
    informed
        Number of agents informed of the velocity or the acceleration, in scenarios with some informed agents.

    Raises
    ------
    InvalidInput
        If the paper has no such figure, there is no such scenario, or ``informed`` is no number of agents.
    """
    check_figure(figure, LAST_FIGURE)
    one_of("scenario", "name", name, SETTINGS)
    if integer("shi-2009", "informed", informed, least=0) > AGENTS:
        raise InvalidInput("shi-2009", "informed", f"must be at most {AGENTS}, the number of agents", informed)
    if figure is not None:
        shown = {9: "7", 12: "10"}.get(figure, str(figure))
        name = next((n for n, s in SETTINGS.items() if s.figure == shown), KEY)
    setting = SETTINGS[name]
    graph = Proximity(SENSING_RADIUS, closed=True)
    begin = start(seed, compact=compact)
    rng = np.random.default_rng([seed, 2009])
    masses = rng.uniform(SMALLEST_MASS, 1.0, AGENTS)
    damping = rng.uniform(0.0, 1.0, AGENTS)
    gains = rng.uniform(0.0, 1.0, AGENTS)
    weights = np.triu(rng.uniform(0.0, 1.0, (AGENTS, AGENTS)), 1)
    chosen = rng.permutation(AGENTS)[:informed]
    leader = Path(LEADER_VELOCITY)
    follow = _track(setting, leader, gains, chosen)
    terms: tuple[Term, ...] = (Gradient(potential()), Consensus(weights=weights + weights.T), follow, Compensate())
    shares_frame = setting.law in (4, 8) and setting.acceleration == "all"
    plateau = float(potential()(SENSING_RADIUS))
    frame = "leader" if shares_frame else "centre of mass"
    energy = Energy(frame, leader=leader if shares_frame else None, unlinked=plateau, name="J")
    return Scenario(
        Law(graph, terms),
        begin,
        t_end=DURATION,
        agents=Agents(masses, damping),
        frames=401,
        energy=energy,
        name=name,
        seed=seed,
    )


def _track(setting: Setting, leader: Path, gains: Array, chosen: NDArray[np.int64]) -> Track:
    informed = np.isin(np.arange(AGENTS), chosen).astype(float)
    known: dict[str, float | Array] = {"all": 1.0, "some": informed, "none": 0.0}
    acceleration = known[setting.acceleration]
    if setting.law == 4:
        velocity = gains * informed if setting.velocity == "some" else gains
        return Track(leader, velocity_gain=velocity, acceleration_gain=acceleration, per_mass=True)
    position = POSITION_GAIN if setting.law == 15 else 0.0
    return Track(leader, position, VELOCITY_GAIN, acceleration, per_mass=True)


@seeded
def start(seed: int, *, compact: bool) -> State:
    """A start: agents in a disc with random velocities, redrawn until connected (Fig. 3, shared by all simulations).

    Parameters
    ----------
    seed
        Seed of the draw.
    compact
        Whether to use the smaller radius and speeds.
    """
    radius, speed = (COMPACT_RADIUS, COMPACT_SPEED) if compact else (START_RADIUS, LARGEST_SPEED)
    graph = Proximity(SENSING_RADIUS, closed=True)
    return starts.ball(AGENTS, radius=radius, speed=speed, seed=seed, connected_under=graph)


def scenarios() -> dict[str, Callable[[int], Scenario]]:
    """Scenarios of this paper by name, each a function of the seed; all use the paper's start."""
    return {name: partial(_seeded, name) for name in SETTINGS}


def _seeded(name: str, seed: int) -> Scenario:
    return scenario(seed=seed, name=name)
