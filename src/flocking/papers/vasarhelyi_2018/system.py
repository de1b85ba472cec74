"""The flock of Vasarhelyi et al. with its released parameters, in the imperfect world of its program (SI units)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flocking.model import starts
from flocking.model.bodies.velocity_units import VelocityUnit
from flocking.model.checks import integer, number, one_of
from flocking.model.graphs.distance_graphs import Proximity
from flocking.model.law import Law, Scenario
from flocking.model.state import State
from flocking.model.terms.braking import (
    BrakingAlignment,
    LinearRepulsion,
    SelfPropulsion,
    ShillDisc,
    ShillWalls,
    braking_distance,
)
from flocking.model.terms.steering import Steering
from flocking.model.world.control import Held
from flocking.model.world.fixes import Fixes

KEY = "vasarhelyi-2018"
RELEASED, STRONGER, OBSTACLES, ALONE = (f"{KEY}-{name}" for name in ("released", "stronger", "obstacles", "alone"))

FIGURES = {1: KEY, 2: KEY}
"""Scenario of each figure; the first of those that it shows."""

AGENTS = 100
"""N (released)."""
DURATION = 600.0
"""Length of a run in seconds (released)."""
SHORT = 120.0
"""Length of the runs beside the main one: chosen here."""
FLOCK_SPEED, LARGEST_SPEED = 4.0, 8.0
"""v_flock and v_max in m/s (released)."""
REPULSION_RADIUS, REPULSION_SLOPE, REPULSION_SPEED = 25.6668, 0.4, 6.19664
"""r0_rep in m, p_rep in 1/s and v_rep in m/s (released)."""
FRICTION_ACCELERATION, FRICTION_SLOPE, FRICTION_SLACK = 2.5, 0.4, 0.5
"""a_fr in m/s^2, p_fr in 1/s and v_fr in m/s (released)."""
FRICTION_OFFSET, FRICTION_GAIN = 10.0, 0.023802
"""r0_fr beyond r0_rep in m, and C_fr (released)."""
SHILL_SPEED, SHILL_ACCELERATION, SHILL_SLOPE = 6.52174, 2.5, 0.4
"""v_shill in m/s, a_shill in m/s^2 and p_shill in 1/s (released)."""
HALF_WIDTH = 230.0
"""Half the width of the square arena in m (released)."""
TIME_CONSTANT, ACCELERATION = 1.0, 6.0
"""tau in s and a_max in m/s^2 of a unit (released)."""
RANGE, DELAY, REFRESH = 100.0, 1.0, 0.2
"""Range of communication in m, its delay and the time between two position fixes in s (released)."""
POSITION_NOISE, PROCESS_NOISE = 0.005, 0.2
"""sigma_GPS in m^2/s^2 and sigma_outer in m^2/s^3 (released)."""
ERROR_DAMPING = 0.1
"""Damping of the errors of fixes in 1/s (program)."""
ERROR_STIFFNESS = float(np.sqrt(2.0 * ERROR_DAMPING * POSITION_NOISE * 1e4)) / 300.0
"""Stiffness of their spring in 1/s^2: the program computes it from numbers in centimetres."""
STEP = 0.01
"""Step of the Euler method in s (released)."""
COLLISION_RADIUS = 3.0
"""Distance in m below which two agents collide (released)."""
START_WIDTH = 250.0
"""Width of the square in which agents start, in m (released); that they start at v_flock is chosen here."""
STRONG_GAIN, STRONG_RADIUS = 0.1, 85.0
"""C_fr, and r0_rep + r0_fr in m, of the scenario in which alignment is stronger: chosen here, so that order arises."""
CIRCLES = ((-70.0, -60.0, 25.0), (80.0, 40.0, 30.0), (-20.0, 110.0, 20.0))
"""Centres and radii in m of the obstacles of the scenario with obstacles: chosen here."""


def law(
    *, walls: bool = True, circles: tuple[tuple[float, float, float], ...] = (), stronger: bool = False
) -> Law:  # fmt: skip
    """The wanted velocity: self-propulsion, repulsion, alignment, walls and obstacles.

    Links, which nothing uses, are those of clusters: agents close enough to have to brake for each other.

    Parameters
    ----------
    walls
        Whether there is the arena.
    circles
        Centres and radii of obstacles.
    stronger
        Whether alignment has the gain and the radius that are chosen here.
    """
    gain, radius = FRICTION_GAIN, REPULSION_RADIUS + FRICTION_OFFSET
    terms: list[Steering] = [
        SelfPropulsion(FLOCK_SPEED),
        LinearRepulsion(REPULSION_SLOPE, REPULSION_RADIUS, REPULSION_SPEED),
        BrakingAlignment(
            STRONG_GAIN if stronger else gain, FRICTION_SLACK, STRONG_RADIUS if stronger else radius,
            FRICTION_ACCELERATION, FRICTION_SLOPE, RANGE,
        ),
    ]  # fmt: skip
    if walls:
        terms.append(ShillWalls(HALF_WIDTH, SHILL_SPEED, SHILL_ACCELERATION, SHILL_SLOPE))
    terms += [ShillDisc((x, y), r, SHILL_SPEED, SHILL_ACCELERATION, SHILL_SLOPE) for x, y, r in circles]
    reach = radius + float(braking_distance(FLOCK_SPEED, FRICTION_ACCELERATION, FRICTION_SLOPE))
    return Law(Proximity(reach), tuple(terms))


def unit(*, released: bool = False, noise: float = PROCESS_NOISE, seed: int = 0) -> VelocityUnit:
    """A vehicle: lag, largest acceleration, process noise, and what becomes of the wanted velocity.

    Parameters
    ----------
    released
        Whether every wanted velocity is scaled to v_flock, as in the released program; else it is cut at v_max.
    noise
        sigma_outer.
    seed
        Seed of the noise.
    """
    speed = FLOCK_SPEED if released else LARGEST_SPEED
    return VelocityUnit(
        TIME_CONSTANT, acceleration=ACCELERATION, speed=speed, fixed=released, diffusion=noise,
        substeps=round(REFRESH / STEP), seed=seed,
    )  # fmt: skip


def knowledge(*, delay: float = DELAY, noise: float = POSITION_NOISE, seed: int = 0) -> Fixes:
    """What agents know: own fixes with errors, those of others within the range late.

    Parameters
    ----------
    delay
        Age of what is known of others.
    noise
        sigma_GPS.
    seed
        Seed of the errors.
    """
    return Fixes(
        REFRESH, delay=delay, range=RANGE, diffusion=noise, damping=ERROR_DAMPING, stiffness=ERROR_STIFFNESS, seed=seed
    )


def flock(
    agents: int = AGENTS, *, seed: int = 0, duration: float = DURATION, released: bool = False,
    circles: tuple[tuple[float, float, float], ...] = (), stronger: bool = False, name: str = "",
) -> Scenario:  # fmt: skip
    """A flock in the arena, at random places with velocities v_flock in random directions.

    Parameters
    ----------
    agents
        N.
    seed
        Seed of the start and of all noise.
    duration
        When the run ends; frames are a second apart.
    released
        As for `unit`.
    circles, stronger
        As for `law`.
    name
        Name of the scenario.
    """
    count = integer("flock", "agents", agents, least=2)
    end = number("flock", "duration", duration, least=1.0)
    corner = -0.5 * START_WIDTH
    begin = starts.box(
        count, side=START_WIDTH, corner=[corner, corner], speed=FLOCK_SPEED, velocities="sphere", seed=seed
    )
    return Scenario(
        law(circles=circles, stronger=stronger), begin, t_end=end, agents=unit(released=released, seed=seed),
        frames=round(end) + 1, name=name, seed=seed, information=knowledge(seed=seed), control=Held(REFRESH),
    )  # fmt: skip


def alone(*, speed: float = 1.0, duration: float = 8.0, seed: int = 0, name: str = "") -> Scenario:
    """One agent in free space without noise: its speed comes to v_flock by a closed form.

    Parameters
    ----------
    speed
        Its speed at the start.
    duration
        When the run ends; every tick is a frame.
    seed
        Chooses its direction.
    name
        Name of the scenario.
    """
    angle = np.random.default_rng(seed).uniform(-np.pi, np.pi)
    begin = State(np.zeros((1, 2)), speed * np.array([[np.cos(angle), np.sin(angle)]]))
    return Scenario(
        law(walls=False), begin, t_end=duration, agents=unit(noise=0.0), frames=round(duration / REFRESH) + 1,
        name=name, seed=seed, information=knowledge(noise=0.0), control=Held(REFRESH),
    )  # fmt: skip


def scenarios() -> dict[str, Callable[[int], Scenario]]:
    """Scenarios by name, each a function of the seed."""
    return {
        KEY: lambda seed: flock(seed=seed, name=KEY),
        RELEASED: lambda seed: flock(seed=seed, duration=SHORT, released=True, name=RELEASED),
        STRONGER: lambda seed: flock(seed=seed, duration=SHORT, stronger=True, name=STRONGER),
        OBSTACLES: lambda seed: flock(seed=seed, duration=SHORT, circles=CIRCLES, stronger=True, name=OBSTACLES),
        ALONE: lambda seed: alone(seed=seed, name=ALONE),
    }


def scenario(figure: int | None = None, seed: int = 0, *, name: str = KEY) -> Scenario:
    """A scenario by its name, or that of a figure.

    Parameters
    ----------
    figure
        1 or 2.
    seed
        Seed of the start and of all noise.
    name
        Name of the scenario, if no figure is given.

    Raises
    ------
    InvalidInput
        If there is no such figure or scenario.
    """
    if figure is not None:
        one_of("scenario", "figure", figure, FIGURES, "must be 1 or 2")
        name = FIGURES[figure]
    one_of("scenario", "name", name, scenarios(), f"must be one of {', '.join(scenarios())}")
    return scenarios()[name](seed)
