"""Boids: separation, alignment and cohesion in cones of perception, with limits of force and speed, in discrete time.

The paper prints no parameters, as far as is known. Those of the boids are of its author's later open library
(OpenSteer, plug-in Boids, 2002); those of the birds of a public comparison of frameworks for agent-based models
(ABMFrameworksComparison, Flocking). The text of the paper was not at hand; the programs were.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from flocking.model import starts
from flocking.model.bodies.discrete_bodies import Heading, Impulsive
from flocking.model.checks import integer, number
from flocking.model.graphs.distance_graphs import Proximity
from flocking.model.law import Law, Scenario
from flocking.model.parts.seeds import seeded
from flocking.model.space import Periodic
from flocking.model.terms.steering import Alignment, Cohesion, Separation, TurnBack
from flocking.model.world.control import Held
from flocking.papers.named_scenarios import scenario_by_name

KEY = "reynolds-1987"
SEQUENTIAL, SMALL, LARGE = f"{KEY}-sequential", f"{KEY}-comparison-small", f"{KEY}-comparison-large"

FIGURES = {1: KEY, 2: KEY}
"""Scenario of each figure; the first of those that it shows."""

BOIDS = 200
"""Number of boids (library)."""
FORCE, SPEED = 27.0, 9.0
"""Largest force and largest speed (library)."""
START_SPEED = 0.3 * SPEED
"""Speed at the start, 0.3 of the largest one (library)."""
START_RADIUS = 20.0
"""Radius of the ball of the start (library)."""
SEPARATION = (12.0, 5.0, -0.707)
"""Weight, radius and least cosine of separation (library)."""
ALIGNMENT = (8.0, 7.5, 0.7)
"""Weight, radius and least cosine of alignment (library)."""
COHESION = (8.0, 9.0, -0.15)
"""Weight, radius and least cosine of cohesion (library)."""
BODY = 0.5
"""Radius of a boid (library, `SimpleVehicle`); within three of them others are seen in any direction."""
NEAR = 3.0 * BODY
"""Distance below which others are seen in any direction (library)."""
WORLD = 50.0
"""Distance from the origin from which boids turn back (library)."""

STEP = 0.04
"""Time between two updates: chosen here. In the library it is the time that a picture takes."""
DURATION, SEQUENTIAL_DURATION = 40.0, 4.0
"""Durations of the runs: chosen here; agents that act one after another take longer to compute."""
EVERY_UPDATE = 25
"""Updates at the start of a run of boids that are frames each; then one frame a second, and one at the end."""

BIRD_SPEED, COHERE, SEPARATE, MATCH, BIRD_SEPARATION = 1.0, 0.03, 0.015, 0.05, 1.0
"""Speed, factors of cohesion, separation and matching, and distance of separation of the birds (comparison)."""
BIRDS: dict[str, tuple[int, float, float]] = {SMALL: (200, 100.0, 5.0), LARGE: (400, 150.0, 15.0)}
"""Birds, side and vision of the two settings (comparison)."""
UPDATES = 100
"""Updates of a run of birds (comparison)."""


def boid_law() -> Law:
    """Unit vectors of the three sums, weighed, and the turn back. Links, which nothing uses, show who is within 9."""
    terms = (
        Separation(*SEPARATION, near=NEAR), Alignment(*ALIGNMENT, near=NEAR), Cohesion(*COHESION, near=NEAR),
        TurnBack(WORLD, SPEED),
    )  # fmt: skip
    return Law(Proximity(COHESION[1]), terms)


@seeded
def boids(
    *, agents: int = BOIDS, seed: int = 0, duration: float = DURATION, update: str = "forward", step: float = STEP,
    name: str = "",
) -> Scenario:  # fmt: skip
    """Boids in a ball, with random headings.

    Parameters
    ----------
    agents
        Number of boids.
    seed
        Seed of the start, and of the order of a shuffled update.
    duration
        When the run ends.
    update
        As of `flocking.model.bodies.discrete_bodies.DiscreteBody`. All boids act on one state with ``"forward"``; in
        the library each acts on the new states of those before it, which is ``"sequential"``.
    step
        Time between two updates.
    name
        Name of the scenario.
    """
    count = integer("boids", "agents", agents, least=2)
    step = number("boids", "step", step, above=0.0)
    duration = number("boids", "duration", duration, least=(EVERY_UPDATE + 1) * step)
    begin = starts.ball(count, radius=START_RADIUS, speed=START_SPEED, velocities="sphere", dimension=3, seed=seed)
    first = [round(k * step, 9) for k in range(EVERY_UPDATE + 1)]
    later = [float(k) for k in range(1, math.ceil(duration)) if k > first[-1]]
    body = Impulsive(force=FORCE, speed=SPEED, update=update, seed=seed)
    frames = (*first, *later, duration)
    return Scenario(
        boid_law(), begin, t_end=duration, agents=body, frames=frames, name=name, seed=seed, control=Held(step)
    )


def bird_law(vision: float) -> Law:
    """Sums over those seen divided by their number; matching adds their velocities.

    Parameters
    ----------
    vision
        Distance below which others are seen.
    """
    terms = (
        Cohesion(COHERE, vision, total="mean"),
        Separation(SEPARATE, BIRD_SEPARATION, total="mean", exponent=0.0, among=vision),
        Alignment(MATCH, vision, total="mean", compared="velocities", relative=False),
    )
    return Law(Proximity(vision), terms)


@seeded
def birds(
    agents: int, side: float, vision: float, *, seed: int = 0, updates: int = UPDATES, update: str = "shuffled",
    name: str = "",
) -> Scenario:  # fmt: skip
    """Birds of one speed on a torus that act one after another in random order.

    Parameters
    ----------
    agents, side, vision
        Number of birds, length after which both axes repeat, and distance below which others are seen.
    seed
        Seed of the start and of the order.
    updates
        Number of updates of every bird.
    update
        As of `flocking.model.bodies.discrete_bodies.DiscreteBody`.
    name
        Name of the scenario.
    """
    side = number("birds", "side", side, above=0.0)
    count = integer("birds", "updates", updates, least=1)
    begin = starts.box(agents, side=side, speed=BIRD_SPEED, velocities="sphere", seed=seed)
    return Scenario(
        bird_law(vision), begin, t_end=float(count), agents=Heading(BIRD_SPEED, update=update, seed=seed),
        frames=count + 1, name=name, seed=seed, space=Periodic((side, side)), control=Held(1.0),
    )  # fmt: skip


def scenarios() -> dict[str, Callable[[int], Scenario]]:
    """Scenarios by name, each a function of the seed."""

    def compared(name: str) -> Callable[[int], Scenario]:
        return lambda seed: birds(*BIRDS[name], seed=seed, name=name)

    return {
        KEY: lambda seed: boids(seed=seed, name=KEY),
        SEQUENTIAL: lambda seed: boids(seed=seed, duration=SEQUENTIAL_DURATION, update="sequential", name=SEQUENTIAL),
        **{name: compared(name) for name in BIRDS},
    }


scenario = scenario_by_name(scenarios, FIGURES)
"""A scenario by its name, or that of a figure, see `scenario_by_name`."""
