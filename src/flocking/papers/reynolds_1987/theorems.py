"""Claims about boids and birds with their grounds.

Nobody proves anything of these flocks. What follows from the definition is judged from the frames alone, also of
motions of other programs; everything else is observed over seeds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from flocking.model.bodies.discrete_bodies import Heading, Impulsive
from flocking.model.checks import Array
from flocking.model.graphs.distance_graphs import Proximity
from flocking.model.law import Law
from flocking.model.observables import order_of
from flocking.model.world.control import Held
from flocking.papers.grounds import OBSERVED, Ground, claims_by_name, proved
from flocking.papers.reynolds_1987 import system
from flocking.papers.reynolds_1987.observations import measured
from flocking.papers.reynolds_1987.rules import next_state
from flocking.study.claims.claim import Claim, Measure, Origin, above, below
from flocking.study.claims.subjects import Subject, about
from flocking.study.evidence import Evidence, NotMeasurable

ROUNDING = 1e-9
"""Relative rounding of velocities and places."""

JUDGED = 5
"""Updates of a run that are computed again."""

LAST_QUARTER = 0.75
"""Share of a run after which order is averaged."""

HALF_ORDER = 0.5
"""Mean polarisation above which a flock is called polarised."""

TOUCHING = 2.0 * system.BODY
"""Distance of two boids below which their bodies touch."""

FAR = 2.0 * system.WORLD
"""Distance from the origin that boids which turn back at 50 are asked not to reach."""

CLOCK = 1e-6
"""Share of the time between two updates by which times of frames may be off."""


def _period(e: Evidence) -> float:
    control = e.run.scenario.control
    if not isinstance(control, Held) or np.ndim(control.period) or np.any(control.phase):
        raise NotMeasurable("agents do not update together from the start on")
    return float(control.period)


def _updates(e: Evidence) -> list[tuple[int, int]]:
    """Frames that an update separates from the next one, and how many updates there were before."""
    if getattr(e.run.scenario.agents, "update", "backward") == "backward":
        raise NotMeasurable("agents do not take their new velocities at once")
    period, t = _period(e), e.t - e.run.scenario.start.t
    found = []
    for k in np.flatnonzero(np.abs(np.diff(t) - period) < CLOCK * period):
        tick = round(float(t[k]) / period)
        if abs(t[k] - tick * period) < CLOCK * period:
            found.append((int(k), tick))
    if not found:
        raise NotMeasurable("no two frames are those before and after an update")
    return found


@about(Subject.SPREAD, lasting=True)
def speed_limited(e: Evidence) -> Measure:
    """Largest speed against the limit; of birds, largest difference from their speed."""
    body, speeds = e.run.scenario.agents, np.linalg.norm(e.p, axis=2)
    if isinstance(body, Heading):
        off = float(np.abs(speeds / np.asarray(body.speed) - 1.0).max())
        return below(off, ROUNDING, f"speeds differ from v by at most {off:.1e} of it")
    if not isinstance(body, Impulsive) or body.speed is None:
        raise NotMeasurable("agents have no largest speed")
    most = float((speeds / np.asarray(body.speed)).max())
    return below(most, 1.0 + ROUNDING, f"largest speed {most:.10g} of the limit")


@about(Subject.SPREAD, lasting=True)
def force_limited(e: Evidence) -> Measure:
    """Largest change of a velocity between two frames against the largest force times their time."""
    body = e.run.scenario.agents
    if not isinstance(body, Impulsive) or body.force is None:
        raise NotMeasurable("agents have no largest force")
    if np.any(np.asarray(body.damping)):
        raise NotMeasurable("agents are damped too")
    first = np.linalg.norm(e.p[0], axis=1)
    if body.speed is not None and (first > np.asarray(body.speed) * (1.0 + ROUNDING)).any():
        raise NotMeasurable("agents are faster than their largest speed at the start, and are slowed down at once")
    if len(e.t) < 2:
        raise NotMeasurable("the run has one frame")
    # Between frames that are not at updates there may be one update more than fits into their time.
    updates = np.maximum(np.ceil(np.diff(e.t) / _period(e) - CLOCK), 1.0)
    most = (updates * _period(e))[:, None] * np.asarray(body.force) / np.asarray(body.masses)
    share = float((np.linalg.norm(np.diff(e.p, axis=0), axis=2) / most).max())
    return below(share, 1.0 + ROUNDING, f"largest change of a velocity {share:.10g} of what the largest force allows")


@about(Subject.NET, lasting=True)
def moved_with_new_velocity(e: Evidence) -> Measure:
    """Largest difference of a displacement over an update from the velocity after it."""
    period = _period(e)
    steps = [e.q[k + 1] - e.q[k] - period * e.p[k + 1] for k, _ in _updates(e)]
    length = period * float(np.linalg.norm(e.p, axis=2).max()) + ROUNDING * float(np.abs(e.q).max())
    off = float(np.linalg.norm(np.array(steps), axis=2).max()) / length
    return below(off, 1e-6, f"displacements differ from the new velocity by at most {off:.1e} of the largest one")


def _is_stated_here(law: Law) -> bool:
    """Whether a law is that of boids, or that of birds of some vision."""
    if law == system.boid_law():
        return True
    return type(law.graph) is Proximity and law == system.bird_law(law.graph.radius)


@about(Subject.SPREAD, lasting=True)
def rule_followed(e: Evidence) -> Measure:
    """Largest difference of velocities after an update from those by the rule, at the first updates of the run."""
    scenario = e.run.scenario
    if not _is_stated_here(scenario.law):
        raise NotMeasurable("the law is not one of this package")
    e.need_few()
    off, speed = 0.0, float(np.linalg.norm(e.p, axis=2).max())
    judged = _updates(e)[:JUDGED]
    for k, tick in judged:
        _, p = next_state(scenario, e.q[k], e.p[k], tick)
        off = max(off, float(np.linalg.norm(p - e.p[k + 1], axis=1).max()) / speed)
    note = f"velocities after {len(judged)} updates differ from the rule by at most {off:.1e} of the largest speed"
    return below(off, 1e-6, note)


def _late(e: Evidence, series: Array) -> Array:
    start = e.t[0] + LAST_QUARTER * (e.t[-1] - e.t[0])
    return np.asarray(series[e.t >= start])


@about(Subject.SPREAD, at_end=True)
def polarised(e: Evidence) -> Measure:
    """Mean polarisation over the last quarter of the run, against one half."""
    late = float(_late(e, np.array([order_of(p) for p in e.p])).mean())
    return above(late, HALF_ORDER, f"mean polarisation over the last quarter is {late:.3g}")


@about(Subject.CLOSEST, lasting=True)
def apart(e: Evidence) -> Measure:
    """Smallest distance of two agents at the frames after the first, against that of touching bodies."""
    e.need_few()
    if len(e.t) < 2:
        raise NotMeasurable("the run has one frame")
    if e.run.n < 2:
        raise NotMeasurable("there is one agent")
    least = float(measured(e.checked)[1][1:].min())
    return above(least, TOUCHING, f"smallest distance at the frames {least:.3g}")


@about(Subject.CLOSEST, at_end=True)
def birds_apart(e: Evidence) -> Measure:
    """Smallest distance of two agents at the last frame, against that below which birds separate."""
    e.need_few()
    if e.run.n < 2:
        raise NotMeasurable("there is one agent")
    least = float(measured(e.checked)[1][-1])
    return above(least, system.BIRD_SEPARATION, f"smallest distance at the end {least:.3g}")


@about(Subject.CONNECTIVITY, at_end=True)
def one_flock(e: Evidence) -> Measure:
    """Number of groups at the last frame, against one."""
    e.need_few()
    if not np.isfinite(e.law.graph.break_radius).all():
        raise NotMeasurable("links of the law end at no distance")
    groups = int(measured(e.checked)[2][-1])
    return below(groups, 1.5, f"{groups} groups at the end")


@about(Subject.NET, lasting=True)
def returns(e: Evidence) -> Measure:
    """Largest distance from the origin at the frames, against twice that from which boids turn back."""
    most = float(np.linalg.norm(e.q, axis=2).max())
    return below(most, FAR, f"largest distance from the origin {most:.3g}")


def grounds() -> Mapping[str, Ground]:
    """Grounds by the key of the claim."""
    definition = "by the definition of the system"
    return {
        "speed": proved(definition),
        "force": proved(f"{definition}, and the triangle inequality between frames"),
        "new-velocity": proved(definition),
        "rule": proved(definition),
        "polarised": OBSERVED,
        "apart": OBSERVED,
        "birds-apart": OBSERVED,
        "one-flock": OBSERVED,
        "returns": OBSERVED,
    }


def _stated(name: str) -> Sequence[Claim]:
    own = Origin.OWN
    source = "the comparison's program" if name in system.BIRDS else "the library's program"
    limit = "All speeds are 1." if name in system.BIRDS else "No speed is above the largest one."
    rule = (
        Claim("speed", source, limit, speed_limited, dynamic=False),
        Claim("new-velocity", source, "Over an update an agent moves with the velocity after it.",
              moved_with_new_velocity, dynamic=False),
        Claim("rule", source, "Velocities after an update are those of the rule, in the declared order of the agents.",
              rule_followed, dynamic=False),
    )  # fmt: skip
    order = Claim("polarised", "not stated", "The mean polarisation over the last quarter is above one half.",
                  polarised, origin=own)  # fmt: skip
    united = Claim("one-flock", "not stated", "At the end all belong to one group.", one_flock, origin=own)
    if name in system.BIRDS:
        sentence = "At the end no two birds are closer than the distance below which they separate, 1."
        separate = Claim("birds-apart", "not stated", sentence, birds_apart, origin=own)
        return (*rule, order, united, separate)
    force = Claim("force", source, "No velocity changes by more than the largest force allows.", force_limited,
                  dynamic=False)  # fmt: skip
    return (
        *rule, force, order, united,
        Claim("apart", "not stated", "At no frame after the first do two bodies touch.", apart, origin=own),
        Claim("returns", "not stated", "At no frame is a boid twice as far as where it turns back.", returns,
              origin=own),
    )  # fmt: skip


claims = claims_by_name(system.scenarios, _stated, lambda _: grounds())
"""Claims about a scenario by its name, see `claims_by_name`."""
