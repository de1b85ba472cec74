"""The system of Vicsek et al.: headings that follow the neighbours' with noise, on a torus, in discrete time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flocking.model import starts
from flocking.model.bodies.discrete_bodies import Heading
from flocking.model.checks import integer, number
from flocking.model.graphs.distance_graphs import Proximity
from flocking.model.law import Law, Scenario
from flocking.model.parts.seeds import seeded
from flocking.model.space import Periodic
from flocking.model.state import State
from flocking.model.terms.alignment import VelocityAverage
from flocking.model.world.control import Held
from flocking.papers.named_scenarios import scenario_by_name

KEY = "vicsek-1995"
GATHERING, ORDERED, SMALL = f"{KEY}-gathering", f"{KEY}-ordered", f"{KEY}-small"
NOISELESS, RANDOM, VECTORIAL = f"{KEY}-noiseless", f"{KEY}-random", f"{KEY}-vectorial"
MIDDLE, PHASES, BANDS, FLUCTUATIONS = (f"{KEY}-{name}" for name in ("middle", "phases", "bands", "fluctuations"))

FIGURES = {1: KEY, 2: SMALL, 3: VECTORIAL}
"""Scenario of each figure; the first of those that it shows."""

RADIUS = 1.0
"""Distance up to which others are neighbours: the unit of length."""
STEP = 1.0
"""Time between two updates: the unit of time."""
SPEED = 0.03
"""Distance an agent moves between two updates (as commonly cited)."""

AGENTS = 300
"""Agents of Fig. 1 (as commonly cited)."""
FIGURE_1: dict[str, tuple[float, float]] = {KEY: (7.0, 2.0), GATHERING: (25.0, 0.1), ORDERED: (5.0, 0.1)}
"""Side L and noise eta of the panels of Fig. 1: (a) and (c), (b), (d) (as commonly cited)."""
DURATION = 400
"""Updates of their runs; the figure shows none of more than a few hundred."""

FIGURE_2 = ((40, 3.1), (100, 5.0), (400, 10.0), (4000, 31.6), (10000, 50.0))
"""Agents and side of the curves of Fig. 2a (as commonly cited): about four agents in a unit of area."""

LATER_SPEED, LATER_DENSITY = 0.5, 2.0
"""Speed and density of later work on the transition (Gregoire, Chate 2004)."""

MIDDLE_NOISE, MIDDLE_DURATION = 3.5, 8000
"""Noise at which order is about half that without noise in the group of 400 of Fig. 2a, and updates of its run."""
PHASES_SIDE, PHASES_NOISE, PHASES_DURATION = 20.0, 0.618, 40000
"""Side, vectorial noise and updates of a run of later work that passes between order and disorder; the noise is that of
the stored study's lowest cumulant."""
LATER_SIDE, BANDS_NOISE, FLUCTUATIONS_NOISE, LATER_DURATION = 32.0, 0.6, 0.4, 3000
"""Side of ordered groups of later work, their vectorial noise beside the transition and far from it, and updates."""
SPARSE = 20
"""Updates from one frame to the next where many are run."""


def law() -> Law:
    """Each agent takes the average velocity of those closer than the radius, itself among them."""
    return Law(Proximity(RADIUS), (VelocityAverage(1.0 / STEP),))


@seeded
def group(
    agents: int, side: float, noise: float, *, seed: int = 0, duration: int = DURATION, speed: float = SPEED,
    noise_kind: str = "angular", update: str = "backward", name: str = "",
) -> Scenario:  # fmt: skip
    """Agents at random places of a torus, with random headings; every update is a frame.

    Parameters
    ----------
    agents, side
        Number N, and the length L after which both axes repeat.
    noise
        eta: width of the interval of random angles, or size of the random vector.
    seed
        Seed of the start and of the noise.
    duration
        Number of updates.
    speed
        v.
    noise_kind, update
        As of `flocking.model.bodies.discrete_bodies.Heading`.
    name
        Name of the scenario.
    """
    side = number("group", "side", side, above=0.0)
    duration = integer("group", "duration", duration, least=1)
    begin = starts.box(agents, side=side, speed=speed, velocities="sphere", seed=seed)
    return _of(begin, side, Heading(speed, noise, noise_kind, update, seed), duration, name, seed)


def _of(begin: State, side: float, body: Heading, duration: int, name: str, seed: int) -> Scenario:
    return Scenario(
        law(), begin, t_end=duration * STEP, agents=body, frames=duration + 1, name=name, seed=seed,
        space=Periodic((side, side)), control=Held(STEP),
    )  # fmt: skip


@seeded
def later(side: float, noise: float, duration: int, *, seed: int = 0, name: str = "") -> Scenario:
    """A group of later work: vectorial noise, forward update, speed 0.5, density 2; each `SPARSE`-th update is a frame.

    Parameters
    ----------
    side, noise, duration, seed, name
        As for `group`.
    """
    agents = round(LATER_DENSITY * number("later", "side", side, above=0.0) ** 2)
    made = group(
        agents, side, noise, seed=seed, duration=duration, speed=LATER_SPEED, noise_kind="vectorial", update="forward",
        name=name,
    )  # fmt: skip
    return made.with_(frames=duration // SPARSE + 1)


@seeded
def within_half_a_turn(agents: int, side: float, *, seed: int = 0, name: str = "") -> Scenario:
    """A group without noise whose headings lie within less than half a turn at the start.

    Parameters
    ----------
    agents, side, seed, name
        As for `group`.
    """
    rng = np.random.default_rng(seed)
    angles = rng.uniform(-0.49 * np.pi, 0.49 * np.pi, agents)
    begin = starts.box(agents, side=side, seed=seed)
    p = SPEED * np.column_stack([np.cos(angles), np.sin(angles)])
    return _of(State(begin.q, p), side, Heading(SPEED, seed=seed), DURATION, name, seed)


def scenarios() -> dict[str, Callable[[int], Scenario]]:
    """Scenarios by name, each a function of the seed."""

    def panel(name: str) -> Callable[[int], Scenario]:
        side, noise = FIGURE_1[name]
        return lambda seed: group(AGENTS, side, noise, seed=seed, name=name)

    few, narrow = FIGURE_2[0]
    wide = float(np.sqrt(AGENTS / LATER_DENSITY))
    return {
        **{name: panel(name) for name in FIGURE_1},
        SMALL: lambda seed: group(few, narrow, 1.0, seed=seed, duration=1000, name=SMALL),
        NOISELESS: lambda seed: within_half_a_turn(few, narrow, seed=seed, name=NOISELESS),
        RANDOM: lambda seed: group(few, narrow, 2.0 * np.pi, seed=seed, duration=4000, name=RANDOM),
        VECTORIAL: lambda seed: group(
            AGENTS, wide, 0.4, seed=seed, speed=LATER_SPEED, noise_kind="vectorial", update="forward", name=VECTORIAL
        ),
        MIDDLE: lambda seed: group(
            *FIGURE_2[2], MIDDLE_NOISE, seed=seed, duration=MIDDLE_DURATION, name=MIDDLE
        ).with_(frames=MIDDLE_DURATION // SPARSE + 1),
        PHASES: lambda seed: later(PHASES_SIDE, PHASES_NOISE, PHASES_DURATION, seed=seed, name=PHASES),
        BANDS: lambda seed: later(LATER_SIDE, BANDS_NOISE, LATER_DURATION, seed=seed, name=BANDS),
        FLUCTUATIONS: lambda seed: later(LATER_SIDE, FLUCTUATIONS_NOISE, LATER_DURATION, seed=seed, name=FLUCTUATIONS),
    }  # fmt: skip


scenario = scenario_by_name(scenarios, FIGURES)
"""A scenario by its name, or that of a figure, see `scenario_by_name`."""
