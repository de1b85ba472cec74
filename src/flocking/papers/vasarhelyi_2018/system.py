"""The flock of Vasarhelyi et al., in the imperfect world of its released program (SI units).

Two sets of flock parameters: those of the file that comes with the program, and those that the authors' optimisation
found, as commonly cited.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from flocking.errors import InvalidInput
from flocking.model import starts
from flocking.model.bodies.velocity_units import VelocityUnit
from flocking.model.checks import integer, number
from flocking.model.graphs.distance_graphs import Proximity
from flocking.model.law import Law, Scenario
from flocking.model.parts.seeds import seeded
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
from flocking.model.world.satellite_fixes import Fixes
from flocking.papers.named_scenarios import scenario_by_name

KEY = "vasarhelyi-2018"
PROGRAM, OPTIMIZED, OBSTACLES = (f"{KEY}-{name}" for name in ("program", "optimized", "obstacles"))
QUIET, ALONE = f"{KEY}-quiet", f"{KEY}-alone"

FIGURES = {1: KEY, 2: KEY, 3: KEY}
"""Scenario of each figure; the first of those that it shows."""

AGENTS = 100
"""N (released)."""
DURATION = 600.0
"""Length of a run in seconds (released)."""
SHORT = 120.0
"""Length of the runs beside the main one: chosen here."""
QUIET_AGENTS, QUIET_DURATION = 30, 20.0
"""Agents, and length in seconds, of the run without noise of which every tick is a frame: chosen here."""
FLOCK_SPEED, LARGEST_SPEED = 4.0, 8.0
"""v_flock and v_max in m/s (released)."""


@dataclass(frozen=True)
class FlockParameters:
    """Numbers of repulsion, alignment and walls, in SI units.

    Parameters
    ----------
    repulsion_radius, repulsion_slope, repulsion_speed
        r0_rep, p_rep and v_rep.
    friction_radius, friction_gain, friction_slack
        Distance up to which no more than the slack is allowed, C_fr and v_fr.
    friction_acceleration, friction_slope
        a_fr and p_fr.
    shill_speed, shill_acceleration, shill_slope, shill_offset
        v_shill, a_shill, p_shill and r0_shill.
    """

    repulsion_radius: float
    repulsion_slope: float
    repulsion_speed: float
    friction_radius: float
    friction_gain: float
    friction_slack: float
    friction_acceleration: float
    friction_slope: float
    shill_speed: float
    shill_acceleration: float
    shill_slope: float
    shill_offset: float


FILE = FlockParameters(
    repulsion_radius=25.6668, repulsion_slope=0.4, repulsion_speed=6.19664,
    friction_radius=25.6668 + 10.0, friction_gain=0.023802, friction_slack=0.5,
    friction_acceleration=2.5, friction_slope=0.4,
    shill_speed=6.52174, shill_acceleration=2.5, shill_slope=0.4, shill_offset=0.0,
)  # fmt: skip
"""Parameters of the released file; the program states the friction radius as 10 m beyond r0_rep."""

FOUND = FlockParameters(
    repulsion_radius=25.6, repulsion_slope=0.13, repulsion_speed=25.6 * 0.13,
    friction_radius=85.3, friction_gain=0.05, friction_slack=0.63,
    friction_acceleration=4.16, friction_slope=3.2,
    shill_speed=13.6, shill_acceleration=3.02, shill_slope=3.55, shill_offset=0.3,
)  # fmt: skip
"""What the optimisation found for v_flock = 4 m/s, as commonly cited: public ports of the model state these numbers.
They state no v_rep; here it is the repulsion at no distance, which limits nothing."""

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
"""Width of the square in which agents start, in m (released; the program draws their places anew, from the arena)."""
NARROW = 0.5 * START_WIDTH
"""Half the width of the arena of the optimised flock, in m: the square in which agents start, chosen here."""
START_DISTANCE = 8.0
"""Least distance of two agents when the program starts, in m: two seconds of v_flock (program)."""
CIRCLES = ((-55.0, -50.0, 15.0), (55.0, 30.0, 20.0), (-25.0, 70.0, 12.0))
"""Centres and radii in m of the obstacles of the scenario with obstacles: chosen here."""


def law(
    parameters: FlockParameters = FILE, *, half_width: float | None = HALF_WIDTH,
    circles: tuple[tuple[float, float, float], ...] = (),
) -> Law:  # fmt: skip
    """The desired velocity: self-propulsion, repulsion, alignment, walls and obstacles.

    Links, which nothing uses, are those of clusters: agents close enough to have to brake for each other.

    Parameters
    ----------
    parameters
        Numbers of the terms.
    half_width
        Half the width of the arena; None for none.
    circles
        Centres and radii of obstacles.
    """
    x = parameters
    curve = x.friction_acceleration, x.friction_slope
    terms: list[Steering] = [
        SelfPropulsion(FLOCK_SPEED),
        LinearRepulsion(x.repulsion_slope, x.repulsion_radius, x.repulsion_speed),
        BrakingAlignment(x.friction_gain, x.friction_slack, x.friction_radius, *curve, RANGE),
    ]
    shill = x.shill_speed, x.shill_acceleration, x.shill_slope
    if half_width is not None:
        terms.append(ShillWalls(half_width, *shill, x.shill_offset))
    # A disc has no offset of its own: its radius is that much larger.
    terms += [ShillDisc((a, b), radius + x.shill_offset, *shill) for a, b, radius in circles]
    return Law(Proximity(cluster_radius(parameters)), tuple(terms))


def cluster_radius(parameters: FlockParameters = FILE) -> float:
    """Distance below which agents belong to one cluster: the friction radius and the distance to brake from v_flock.

    Parameters
    ----------
    parameters
        Numbers of the flock.
    """
    stop = braking_distance(FLOCK_SPEED, parameters.friction_acceleration, parameters.friction_slope)
    return parameters.friction_radius + float(stop)


@seeded
def unit(*, scaled: bool = False, noise: float = PROCESS_NOISE, seed: int = 0) -> VelocityUnit:
    """A vehicle: lag, largest acceleration, process noise, and what becomes of the desired velocity.

    Parameters
    ----------
    scaled
        Whether every desired velocity is scaled to v_flock, as in the released program; else it is cut at v_max.
    noise
        sigma_outer.
    seed
        Seed of the noise.
    """
    speed = FLOCK_SPEED if scaled else LARGEST_SPEED
    return VelocityUnit(
        TIME_CONSTANT, acceleration=ACCELERATION, speed=speed, fixed=scaled, diffusion=noise,
        substeps=round(REFRESH / STEP), seed=seed,
    )  # fmt: skip


@seeded
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


@seeded
def flock(
    agents: int = AGENTS, *, seed: int = 0, duration: float = DURATION, parameters: FlockParameters = FILE,
    half_width: float = HALF_WIDTH, circles: tuple[tuple[float, float, float], ...] = (), name: str = "",
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
    parameters, half_width, circles
        As for `law`.
    name
        Name of the scenario.
    """
    corner = -0.5 * START_WIDTH
    begin = starts.box(
        integer("flock", "agents", agents, least=2), side=START_WIDTH, corner=[corner, corner], speed=FLOCK_SPEED,
        velocities="sphere", seed=seed,
    )  # fmt: skip
    return _of(begin, law(parameters, half_width=half_width, circles=circles), duration, False, seed, name)


@seeded
def program(
    agents: int = AGENTS, *, seed: int = 0, duration: float = DURATION, parameters: FlockParameters = FILE,
    name: str = "",
) -> Scenario:  # fmt: skip
    """A flock as the released program runs it: from rest, all over the arena, desired velocities scaled to v_flock.

    Parameters
    ----------
    agents, seed, duration, parameters, name
        As for `flock`.

    Raises
    ------
    InvalidInput
        If the agents do not find room.
    """
    count = integer("program", "agents", agents, least=2)
    rng = np.random.default_rng(seed)
    places, found = np.empty((count, 2)), 0
    for _ in range(MOST_TRIES * count):
        place = rng.uniform(-HALF_WIDTH, HALF_WIDTH, 2)
        if (((places[:found] - place) ** 2).sum(axis=1) > START_DISTANCE**2).all():
            places[found] = place
            found += 1
        if found == count:
            return _of(State(places, np.zeros((count, 2))), law(parameters), duration, True, seed, name)
    raise InvalidInput(
        "program", "agents", f"must find room {START_DISTANCE:g} m apart in the arena", agents, "Take fewer."
    )


MOST_TRIES = 100
"""Places drawn for each agent before the program gives up (program)."""


def _of(begin: State, made: Law, duration: float, scaled: bool, seed: int, name: str) -> Scenario:
    end = number("flock", "duration", duration, least=1.0)
    return Scenario(
        made, begin, t_end=end, agents=unit(scaled=scaled, seed=seed), frames=round(end) + 1, name=name, seed=seed,
        information=knowledge(seed=seed), control=Held(REFRESH),
    )  # fmt: skip


@seeded
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
        law(half_width=None), begin, t_end=duration, agents=unit(noise=0.0), frames=round(duration / REFRESH) + 1,
        name=name, seed=seed, information=knowledge(noise=0.0), control=Held(REFRESH),
    )  # fmt: skip


@seeded
def quiet(agents: int = QUIET_AGENTS, *, seed: int = 0, duration: float = QUIET_DURATION, name: str = "") -> Scenario:
    """A flock without noise between near walls and obstacles, with a frame at every tick: its motion can be judged.

    Parameters
    ----------
    agents, seed, duration, name
        As for `flock`.
    """
    made = flock(agents, seed=seed, duration=duration, half_width=NARROW, circles=CIRCLES, name=name)
    return made.with_(agents=unit(noise=0.0), information=knowledge(noise=0.0), frames=round(made.t_end / REFRESH) + 1)


def scenarios() -> dict[str, Callable[[int], Scenario]]:
    """Scenarios by name, each a function of the seed."""
    return {
        KEY: lambda seed: flock(seed=seed, name=KEY),
        PROGRAM: lambda seed: program(seed=seed, duration=SHORT, name=PROGRAM),
        OPTIMIZED: lambda seed: flock(seed=seed, duration=SHORT, parameters=FOUND, half_width=NARROW, name=OPTIMIZED),
        OBSTACLES: lambda seed: flock(
            seed=seed, duration=SHORT, parameters=FOUND, half_width=NARROW, circles=CIRCLES, name=OBSTACLES
        ),
        QUIET: lambda seed: quiet(seed=seed, name=QUIET),
        ALONE: lambda seed: alone(seed=seed, name=ALONE),
    }


scenario = scenario_by_name(scenarios, FIGURES)
"""A scenario by its name, or that of a figure, see `scenario_by_name`."""
