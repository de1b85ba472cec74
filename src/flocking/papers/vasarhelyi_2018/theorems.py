"""Claims about the flock of Vasarhelyi et al. with their grounds.

The authors prove nothing. The motion of a lone agent has a closed form, and that of a flock without noise follows from
its states at the ticks: both are judged from the frames alone, also of motions of other programs. Order parameters are
observed over seeds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache

import numpy as np

from flocking.model.bodies.velocity_units import VelocityUnit
from flocking.model.checks import NO_LESS, Array
from flocking.model.world.control import Held
from flocking.model.world.satellite_fixes import Fixes
from flocking.papers.grounds import OBSERVED, Ground, claims_by_name, proved
from flocking.papers.vasarhelyi_2018 import system
from flocking.papers.vasarhelyi_2018.closed_forms import lone_speeds
from flocking.papers.vasarhelyi_2018.observations import SETTLED, late
from flocking.papers.vasarhelyi_2018.parameters import OrderParameters, order_parameters
from flocking.papers.vasarhelyi_2018.rules import next_state, why_not
from flocking.study.claims.claim import Claim, Measure, Origin, above, below
from flocking.study.claims.subjects import Subject, about
from flocking.study.evidence import Evidence, NotMeasurable

ROUNDING = 1e-9
"""Relative rounding of speeds."""

AGREED, CLOCK = 1e-6, 1e-6
"""Relative differences that count as rounding: of states at ticks from the rule, and of times of frames from ticks. A
wrong rule differs by its error times what a tick changes, a tenth of the speed and more."""

ORDERED = 0.8
"""Mean correlation of directions above which a flock is called ordered."""

OVERRUN = 1.0
"""Mean overrun of the walls in m below which a flock is called confined."""

SLOWER = 0.75
"""Share of v_flock above which the mean speed is called kept."""

SMALLEST = 5
"""The smallest cluster is asked to hold one agent in so many (as commonly cited)."""


@lru_cache(maxsize=8)
def _parameters(e: Evidence) -> OrderParameters:
    if e.q.shape[2] != 2:
        raise NotMeasurable("agents do not move in the plane")
    return order_parameters(e.checked)


def _late(e: Evidence, name: str) -> Array:
    chosen = late(e.t, _parameters(e), name)
    if not len(chosen) or np.isnan(chosen).all():
        raise NotMeasurable(f"the run has no frame after {SETTLED:g} s at which it is defined")
    return np.asarray(chosen)


def _mean(e: Evidence, name: str) -> float:
    return float(np.nanmean(_late(e, name)))


@about(Subject.SPREAD, at_end=True)
def correlated(e: Evidence) -> Measure:
    """Mean correlation of directions within clusters, against `ORDERED`."""
    found = _mean(e, "correlation")
    return above(found, ORDERED, f"mean correlation within clusters {found:.3g}")


@about(Subject.CLOSEST, lasting=True)
def no_collisions(e: Evidence) -> Measure:
    """Share of pairs within the collision radius at the frames, against none."""
    if e.run.n < 2:
        raise NotMeasurable("there is one agent")
    found = float(_late(e, "collision").max())
    pairs = e.run.n * (e.run.n - 1)
    return below(found, 1.0 / pairs, f"at most {found * pairs / 2:.0f} pairs within 3 m at a frame")


@about(Subject.NET, at_end=True)
def confined(e: Evidence) -> Measure:
    """Mean overrun of the walls, against `OVERRUN`."""
    found = _mean(e, "overrun")
    return below(found, OVERRUN, f"mean overrun {found:.3g} m")


@about(Subject.SPREAD, at_end=True)
def fast(e: Evidence) -> Measure:
    """Mean speed, against a share of v_flock."""
    found = _mean(e, "speed")
    return above(found, SLOWER * system.FLOCK_SPEED, f"mean speed {found:.3g} m/s")


@about(Subject.CONNECTIVITY, at_end=True)
def connected(e: Evidence) -> Measure:
    """Mean number of agents alone, against one."""
    found = _mean(e, "disconnected")
    return below(found, 1.0, f"{found:.3g} agents alone on average")


@about(Subject.CONNECTIVITY, at_end=True)
def together(e: Evidence) -> Measure:
    """Mean size of the smallest cluster, against a fifth of the agents."""
    found = _mean(e, "smallest")
    return above(found, e.run.n / SMALLEST, f"smallest cluster of {found:.3g} agents on average")


def _need_lone_agent(e: Evidence) -> None:
    """Refuse runs of several agents, of other laws and vehicles, with noise, and at rest at the start."""
    body, right, control = e.run.scenario.agents, system.unit(noise=0.0), e.run.scenario.control
    if e.run.n != 1:
        raise NotMeasurable("there is more than one agent")
    if e.law != system.law(half_width=None):
        raise NotMeasurable("the law is not that of a lone agent in free space")
    if not isinstance(control, Held) or np.any(np.asarray(control.period) != system.REFRESH) or np.any(control.phase):
        raise NotMeasurable("the agent is not told a velocity at the ticks of the paper")
    if not isinstance(body, VelocityUnit) or np.any(body.diffusion) or body.substeps != right.substeps:
        raise NotMeasurable("the agent is not the vehicle of the paper without noise")
    if np.any(np.asarray(body.time_constant) != right.time_constant):
        raise NotMeasurable("the agent has another time constant than that of the paper")
    known = e.run.scenario.information
    if not isinstance(known, Fixes) or known.diffusion:
        raise NotMeasurable("the agent does not know its own velocity")
    if not np.any(e.p[0]):
        raise NotMeasurable("the agent is at rest at the start")


@about(Subject.VELOCITIES, lasting=True)
def lone_speed(e: Evidence) -> Measure:
    """Largest difference of the speeds of a lone agent from the closed form."""
    _need_lone_agent(e)
    ticks = np.rint((e.t - e.t[0]) / system.REFRESH).astype(int)
    if np.abs(ticks * system.REFRESH - (e.t - e.t[0])).max() > 1e-6:
        raise NotMeasurable("the frames are not at ticks")
    speeds, body = np.linalg.norm(e.p[:, 0], axis=1), e.run.scenario.agents
    assert isinstance(body, VelocityUnit)
    limit, largest = body.speed, body.acceleration
    if limit is not None and (limit != system.FLOCK_SPEED if body.fixed else limit < system.FLOCK_SPEED):
        raise NotMeasurable("the agent does not follow the desired speed, v_flock")
    if largest is not None and abs(speeds[0] - system.FLOCK_SPEED) > system.TIME_CONSTANT * float(np.max(largest)):
        raise NotMeasurable("the agent cannot accelerate as much as the closed form asks for")
    off = float(np.abs(speeds - lone_speeds(float(speeds[0]), int(ticks[-1]))[ticks]).max()) / system.FLOCK_SPEED
    return below(off, ROUNDING, f"speeds differ from the closed form by at most {off:.1e} of v_flock")


@about(Subject.VELOCITIES, lasting=True)
def straight(e: Evidence) -> Measure:
    """Largest part of the velocities across that of the start, by the speed at the start."""
    _need_lone_agent(e)
    first = e.p[0, 0] / np.linalg.norm(e.p[0, 0])
    across = e.p[:, 0] - (e.p[:, 0] @ first)[:, None] * first
    off = float(np.linalg.norm(across, axis=1).max()) / system.FLOCK_SPEED
    return below(off, ROUNDING, f"velocities turn by at most {off:.1e} of v_flock")


def _of_every_tick(e: Evidence) -> float:
    """Time between two ticks of a run whose motion follows from its frames."""
    if reason := why_not(e.run.scenario):
        raise NotMeasurable(reason)
    period = float(e.run.scenario.information.period)  # type: ignore[attr-defined]
    if len(e.t) < 2 or np.abs(np.diff(e.t) - period).max() > CLOCK * period or e.t[0] != e.run.scenario.start.t:
        raise NotMeasurable("the frames are not those of every tick from the start on")
    e.need_few()
    return period


@lru_cache(maxsize=8)
def _differences(e: Evidence) -> tuple[float, float, int]:
    """Largest differences of places and of velocities at ticks from the rule, relative, and number of ticks."""
    period, ticks = _of_every_tick(e), len(e.t) - 1
    speed = max(float(np.linalg.norm(e.p, axis=2).max()), NO_LESS)
    places = velocities = 0.0
    seen = np.asarray(e.q, dtype=np.float64), np.asarray(e.p, dtype=np.float64)
    for tick in range(ticks):
        q, p = next_state(e.run.scenario, *seen, tick)
        places = max(places, float(np.linalg.norm(q - e.q[tick + 1], axis=1).max()) / (period * speed))
        velocities = max(velocities, float(np.linalg.norm(p - e.p[tick + 1], axis=1).max()) / speed)
    return places, velocities, ticks


@about(Subject.SPREAD, lasting=True)
def rule_followed(e: Evidence) -> Measure:
    """Largest difference of velocities at a tick from those by the rule, by the largest speed."""
    _, off, ticks = _differences(e)
    note = f"velocities at {ticks} ticks differ from the rule by at most {off:.1e} of the largest speed"
    return below(off, AGREED, note)


@about(Subject.NET, lasting=True)
def moved_by_rule(e: Evidence) -> Measure:
    """Largest difference of places at a tick from those by the rule, by what the largest speed covers in a tick."""
    off, _, ticks = _differences(e)
    return below(off, AGREED, f"places at {ticks} ticks differ from the rule by at most {off:.1e} of the largest step")


@about(Subject.VELOCITIES, lasting=True)
def acceleration_limited(e: Evidence) -> Measure:
    """Largest change of a velocity between two ticks, against what the largest acceleration allows."""
    period, body = _of_every_tick(e), e.run.scenario.agents
    largest = body.acceleration  # type: ignore[attr-defined]
    if largest is None:
        raise NotMeasurable("agents have no largest acceleration")
    share = float(np.linalg.norm(np.diff(e.p, axis=0), axis=2).max()) / (period * largest)
    return below(share, 1.0 + ROUNDING, f"largest change of a velocity {share:.6g} of what the acceleration allows")


def grounds() -> Mapping[str, Ground]:
    """Grounds by the key of the claim."""
    alone = "the desired velocity has the direction of the own one and the length v_flock"
    found = dict.fromkeys(("correlated", "no-collisions", "confined", "fast", "connected", "together"), OBSERVED)
    rule = "by the definition of the system: without noise a tick follows from the states at it and a delay before"
    found |= dict.fromkeys(("rule", "places"), proved(rule))
    found["acceleration"] = proved("by the definition of the system, and the triangle inequality within a tick")
    return {**found, "lone-speed": proved(f"{alone}: a linear recursion"), "straight": proved(alone)}


def _stated(name: str) -> Sequence[Claim]:
    own = Origin.OWN
    if name == system.ALONE:
        return (
            Claim("lone-speed", "not stated", "The speed of a lone agent comes to v_flock by (1 - h/tau) a step.",
                  lone_speed, origin=own, dynamic=False),
            Claim("straight", "not stated", "A lone agent without noise moves on a straight line.", straight,
                  origin=own, dynamic=False),
        )  # fmt: skip
    if name == system.QUIET:
        program = "the program"
        return (
            Claim("rule", program, "Velocities at ticks are those that the terms of the law, the delay, the range and "
                  "the lag give.", rule_followed, dynamic=False),
            Claim("places", program, "Places move with the velocity before each step.", moved_by_rule, dynamic=False),
            Claim("acceleration", program, "No velocity changes by more than the largest acceleration allows.",
                  acceleration_limited, dynamic=False),
        )  # fmt: skip
    asked: tuple[tuple[str, str, Callable[[Evidence], Measure]], ...] = (
        ("correlated", "After a minute directions within clusters have a mean correlation above 0.8.", correlated),
        ("no-collisions", "After a minute no two agents are within 3 m at any frame.", no_collisions),
        ("confined", "After a minute agents are outside by less than 1 m on average.", confined),
        ("fast", "After a minute the mean speed is above three quarters of v_flock.", fast),
        ("connected", "After a minute fewer than one agent is alone on average.", connected),
        ("together", "After a minute the smallest cluster has a fifth of the agents on average.", together),
    )
    return tuple(Claim(key, "order parameters", words, measure, origin=own) for key, words, measure in asked)


claims = claims_by_name(system.scenarios, _stated, lambda _: grounds())
"""Claims about a scenario by its name, see `claims_by_name`."""
