"""Objects of the equation table of Vasarhelyi et al.; each depends on a factor that is 1 for the released program."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flocking.engine.driver.simulate import simulate
from flocking.engine.reference.control import control
from flocking.model import starts
from flocking.model.bodies.velocity_units import VelocityUnit
from flocking.model.checks import Array
from flocking.model.graphs.distance_graphs import Proximity, pair_distances
from flocking.model.law import Law, Scenario
from flocking.model.state import State
from flocking.model.terms.braking import (
    BrakingAlignment,
    LinearRepulsion,
    SelfPropulsion,
    ShillDisc,
    ShillWalls,
    braking_distance,
    braking_speed,
)
from flocking.model.terms.steering import Steering
from flocking.model.world.control import Held
from flocking.papers.vasarhelyi_2018 import closed_forms, parameters, system, theorems
from flocking.study.claims.audit import audit
from flocking.study.claims.claim import Verdict

POINTS = (-1.0, 2.0, 15.0, 16.0, 40.0)
"""Distances at which the braking curve is evaluated: outside, on the line, at its end, and on the root."""

SPEEDS = (1.0, 6.0, 6.5, 12.0)
"""Speeds at which its inverse is evaluated."""


def few() -> State:
    """Fifteen agents in a square of 60 m, velocities up to 6 m/s."""
    return starts.box(15, side=60.0, corner=[-30.0, -30.0], speed=6.0, seed=8)


def _desired(term: Steering, state: State | None = None) -> Array:
    return control(Law(Proximity(1.0), (term,)), few() if state is None else state)


def curve_of(scale: float) -> Array:
    """The braking curve at several distances, its acceleration scaled."""
    return braking_speed(np.array(POINTS), scale * system.FILE.friction_acceleration, system.FILE.friction_slope)


def distances_of(scale: float) -> Array:
    """The inverse of the braking curve at several speeds, its acceleration scaled."""
    return braking_distance(np.array(SPEEDS), scale * system.FILE.friction_acceleration, system.FILE.friction_slope)


def propulsion_of(scale: float) -> Array:
    """Self-propulsion of the examples' agents, v_flock scaled."""
    return _desired(SelfPropulsion(scale * system.FLOCK_SPEED))


def repulsion_of(scale: float) -> Array:
    """Repulsion of the examples' agents, radius and largest speed scaled."""
    return _desired(
        LinearRepulsion(
            system.FILE.repulsion_slope, scale * system.FILE.repulsion_radius, scale * system.FILE.repulsion_speed
        )
    )


def alignment_of(scale: float) -> Array:
    """Alignment of the examples' agents, the gain scaled."""
    x = system.FILE
    return _desired(BrakingAlignment(
        scale * x.friction_gain, x.friction_slack, x.friction_radius, x.friction_acceleration, x.friction_slope,
        system.RANGE,
    ))  # fmt: skip


def walls_of(scale: float) -> Array:
    """What the walls of a small arena want of the examples' agents, their speed scaled."""
    return _desired(
        ShillWalls(28.0, scale * system.FILE.shill_speed, system.FILE.shill_acceleration, system.FILE.shill_slope)
    )


def obstacle_of(scale: float) -> Array:
    """What a round obstacle wants of the examples' agents, its radius scaled."""
    return _desired(
        ShillDisc(
            (5.0, -3.0), scale * 12.0, system.FILE.shill_speed, system.FILE.shill_acceleration, system.FILE.shill_slope
        )
    )


def sum_of(scale: float) -> Array:
    """The desired velocities of the examples' agents, scaled."""
    return scale * control(system.law(), few())


def limits_of(scale: float) -> tuple[Array, Array]:
    """Wanted velocities cut at v_max, and all scaled to v_flock; the limits scaled."""
    found = []
    for scaled in (False, True):
        unit = system.unit(scaled=scaled)
        assert unit.speed is not None
        body = replace(unit, speed=scale * unit.speed)
        agents = np.arange(15)
        found.append(body.updated(few().p, 1.5 * few().p, np.full(15, 0.2), agents, 0 * agents))
    return found[0], found[1]


def _of_two_ticks(body: VelocityUnit, **changes: object) -> Scenario:
    made = Scenario(system.law(), few(), t_end=0.4, frames=3, agents=body, control=Held(system.REFRESH))
    return made.with_(**changes)


def lag_of(scale: float) -> tuple[Array, Array]:
    """Places and velocities after one tick of agents that know the present, the largest acceleration scaled."""
    run = simulate(_of_two_ticks(replace(system.unit(noise=0.0), acceleration=3.0 * scale)), progress=False)
    return np.asarray(run.q[1]), np.asarray(run.p[1])


def noise_of(scale: float) -> Array:
    """Differences that the process noise makes to velocities after one tick, the noise scaled."""
    noisy, quiet = (
        simulate(_of_two_ticks(replace(system.unit(noise=noise, seed=6), acceleration=None)), progress=False)
        for noise in (scale * system.PROCESS_NOISE, 0.0)
    )
    return np.asarray(noisy.p[1] - quiet.p[1])


def knowledge_of(scale: float) -> Array:
    """Velocities after two ticks of agents that know others one tick late with errors, these scaled."""
    fixes = system.knowledge(delay=system.REFRESH, noise=scale * 40.0, seed=9)
    run = simulate(_of_two_ticks(system.unit(noise=0.0), information=fixes), progress=False)
    return np.asarray(run.p[2])


def errors_of(scale: float) -> tuple[float, float]:
    """Stationary variances of the errors of fixes, the stiffness scaled."""
    return closed_forms.error_variances(
        system.REFRESH, system.POSITION_NOISE, system.ERROR_DAMPING, scale * system.ERROR_STIFFNESS
    )


def parameters_of(scale: float) -> tuple[float, ...]:
    """Order parameters of seven agents in three clusters, one of them outside the arena, distances scaled."""
    q = np.array([[0, 0], [2, 0], [30, 0], [150, 0], [190, 0], [-100, -100], [240, 225]], dtype=np.float64)
    p = np.array([[1, 0], [0, 2], [3, 0], [0, 1], [0, -1], [1, 1], [-2, 0]], dtype=np.float64)
    return parameters.at(scale * q, p, 45.0)


def settings_of(scale: float) -> tuple[float, ...]:
    """Numbers of the main scenario: agents, end, widths, limits, range, delay and noise, scaled."""
    made = system.scenario()
    body, fixes, walls = made.agents, made.information, made.law.terms[3]
    assert isinstance(body, VelocityUnit)
    assert isinstance(walls, ShillWalls)
    values = (
        float(made.start.n), made.t_end, walls.half_width, float(body.speed or 0.0), float(body.acceleration or 0.0),
        float(np.max(body.time_constant)), body.diffusion,
        *(float(getattr(fixes, name)) for name in ("range", "delay", "period", "diffusion")),
        float(np.max(np.asarray(made.law.graph.break_radius))),
    )  # fmt: skip
    return tuple(scale * x for x in values)


def found_of(scale: float) -> tuple[float, ...]:
    """Numbers of the optimised flock, as the terms of its scenario hold them, scaled."""
    made = system.scenario(name=system.OPTIMIZED)
    propulsion, repulsion, alignment, walls = made.law.terms
    assert isinstance(propulsion, SelfPropulsion)
    assert isinstance(repulsion, LinearRepulsion)
    assert isinstance(alignment, BrakingAlignment)
    assert isinstance(walls, ShillWalls)
    values = (
        propulsion.speed, repulsion.radius, repulsion.slope, repulsion.most, alignment.radius, alignment.gain,
        alignment.slack, alignment.acceleration, alignment.slope, alignment.range, walls.half_width, walls.speed,
        walls.acceleration, walls.slope, walls.offset, float(np.max(np.asarray(made.law.graph.break_radius))),
    )  # fmt: skip
    return tuple(scale * x for x in values)


def program_start_of(scale: float) -> tuple[float, ...]:
    """Of the program's start: least distance of two agents, largest coordinate, largest speed; and whether every wanted
    velocity is scaled and to what; scaled.
    """
    made = system.scenario(name=system.PROGRAM)
    body = made.agents
    assert isinstance(body, VelocityUnit)
    apart = pair_distances(made.start.q) + np.diag(np.full(made.start.n, np.inf))
    values = (
        float(apart.min()), float(np.abs(made.start.q).max()), float(np.abs(made.start.p).max()), float(body.fixed),
        float(body.speed or 0.0), made.t_end, float(made.start.n),
    )  # fmt: skip
    return tuple(scale * x for x in values)


def lone_of(scale: float) -> Array:
    """Speeds of a lone agent at its first ticks, scaled."""
    return scale * closed_forms.lone_speeds(1.0, 5)


def judgements_of(scale: float) -> dict[str, Verdict]:
    """Verdicts about a lone agent whose velocities are declared to be scaled."""
    run = simulate(system.alone(), progress=False)
    run = replace(run, p=run.p * scale)
    return {r.claim.key: r.verdict for r in audit(run, theorems.claims(system.ALONE)).results}
