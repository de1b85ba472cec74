"""What a safety filter guarantees before the run: agents that can brake never come closer than its distance.

The form of pairs is a theorem for two agents; of more its conditions may contradict each other: nothing is granted.
The form of stopping paths is one for any number, proven in `flocking.engine.sampled.stopping`.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from flocking.arrays import Array
from flocking.engine.sampled.stopping import nearest_points, stopping_paths
from flocking.formula.safe_digits import rounded_down, rounded_up
from flocking.model.bodies.point_bodies import is_point_mass
from flocking.model.law import Scenario
from flocking.model.world.information import Instant
from flocking.model.world.safety_filters import MARGIN, ROUNDING, SafetyFilter
from flocking.study.certificates.certificate import (
    ALONE,
    NOT_APPLICABLE,
    Certificate,
    Enclosure,
    Hypothesis,
    decided,
    not_applicable,
    until_failed,
)
from flocking.study.certificates.enclosed_matrices import UNIT
from flocking.study.certificates.sources import sources

OBSTACLES = "obstacle_distance"
"""Key of the certificate of obstacles."""

UNITS = 64.0
"""Bound of the rounding errors of a tick, in units of rounding of the largest distance from the origin: the sums of a
few products in the motion, the paths and the planes."""

PAIR = 2
"""Number of agents whose conditions never contradict each other."""


def safety_certificates(scenario: Scenario) -> tuple[Certificate, ...]:
    """The guarantee of a scenario with a safety filter.

    Parameters
    ----------
    scenario
        The scenario.
    """
    source = sources()["safety_filter"]
    filter_ = scenario.control
    if not isinstance(filter_, SafetyFilter):
        declared = Hypothesis("control has a safety filter", False, type(filter_).__name__)
        return not_applicable(("safe_distance", OBSTACLES), source, (declared,))
    n = scenario.start.n

    stopping = filter_.form == "stopping"

    def form() -> Hypothesis:
        statement = "the filter's condition is that of held forces"
        return Hypothesis(statement, filter_.form != "continuous", f"form={filter_.form!r}")

    def number() -> Hypothesis:
        if stopping:
            return Hypothesis("conditions of stopping paths never contradict each other", True, "braking satisfies all")
        statement = "there are two agents, whose conditions never contradict each other, or form='stopping'"
        return Hypothesis(statement, n == PAIR, f"{n} agents")

    def bodies() -> Hypothesis:
        agents = scenario.agents
        holds = is_point_mass(agents) and not np.any(np.asarray(agents.damping))
        return Hypothesis("agents are undamped point masses", bool(holds), type(agents).__name__)

    def knowledge() -> Hypothesis:
        instant = isinstance(scenario.information, Instant) and scenario.space.is_open
        found = type(scenario.information).__name__ + ("" if scenario.space.is_open else ", space repeats")
        return Hypothesis("agents know each other's present state, in open space", instant, found)

    def clock() -> Hypothesis:
        together = not np.ptp(np.asarray(filter_.period)) and not np.any(np.asarray(filter_.phase))
        holds = together and not np.any(filter_.latency)
        return Hypothesis("all act together from the start on, without latency", bool(holds), filter_.summary)

    def able() -> Hypothesis:
        if stopping:
            return _paths_apart(scenario, filter_)
        left = _reserve(scenario, filter_)
        return Hypothesis(
            "both can brake before the distance at the start", left > MARGIN * filter_.distance,
            f"{rounded_down(left, 4)} is left",
        )  # fmt: skip

    hypotheses = until_failed(form, number, bodies, knowledge, clock, partial(_resolved, scenario, filter_), able)
    bound = filter_.distance * (1.0 - ROUNDING)
    agents = "The two agents" if n == PAIR else "No two agents"
    verb = "never come" if n == PAIR else "ever come"
    found = decided(
        "safe_distance", source, hypotheses, bound=Enclosure(bound, filter_.distance), side="at least",
        quantity="closest approach", statement=f"{agents} {verb} closer than {rounded_down(bound)}.",
    )  # fmt: skip
    if n == 1:
        found = Certificate("safe_distance", "", source, hypotheses, NOT_APPLICABLE, ALONE)
    if not filter_.obstacles:
        none = Hypothesis("the filter has obstacles", False, "none")
        return found, *not_applicable((OBSTACLES,), source, (none,))
    clear = filter_.margin_of_obstacles * (1.0 - ROUNDING)
    return found, decided(
        OBSTACLES, source, (*hypotheses, _clear(scenario, filter_)), side="at least",
        bound=Enclosure(clear, filter_.margin_of_obstacles), quantity="distance of an agent from an obstacle",
        statement=f"No agent ever comes closer to an obstacle of the filter than {rounded_down(clear)}.",
    )  # fmt: skip


def _reserve(scenario: Scenario, control: SafetyFilter) -> float:
    """Distance that is left when both brake from the start on."""
    (q, r), (p, v) = scenario.start.q, scenario.start.p
    apart = float(np.linalg.norm(r - q))
    closing = -float((r - q) @ (v - p)) / apart if apart else np.inf
    braking = float(control.accelerations(PAIR).sum())
    return float(control.reserve(np.asarray(apart), np.asarray(closing), np.asarray(braking)))


def _resolved(scenario: Scenario, control: SafetyFilter) -> Hypothesis:
    """Whether rounding errors of all ticks together stay below the millionth that the filter keeps more."""
    start, n = scenario.start, scenario.start.n
    length = scenario.t_end - start.t
    fastest = float(np.linalg.norm(start.p, axis=1).max()) + float(control.accelerations(n).max()) * length
    reach = float(np.abs(start.q).max(initial=0.0)) + fastest * length
    places = [obstacle.mover.at(0.0)[0] for obstacle in control.obstacles if obstacle.mover is not None]
    reach = max([reach, *(float(np.abs(x).max()) for x in places), *(b.radius for b in control.balls)])
    ticks = length / float(np.min(control.period)) + 1.0
    error = ticks * UNITS * UNIT * reach
    smallest = min(control.distance, control.margin_of_obstacles) if control.obstacles else control.distance
    return Hypothesis(
        "rounding errors of all ticks stay below the millionth of the distance that is kept more",
        error < 0.5 * MARGIN * smallest, f"at most {rounded_up(error, 3)}",
    )  # fmt: skip


def _paths_apart(scenario: Scenario, control: SafetyFilter) -> Hypothesis:
    """Whether all stopping paths are the distance apart at the start."""
    q, paths = scenario.start.q, _paths(scenario, control)
    least = np.inf
    for i in range(len(q) - 1):
        own, theirs = nearest_points(paths[i], q[i + 1 :] - q[i], paths[i + 1 :])
        least = min(least, float(np.linalg.norm(own - theirs, axis=1).min()))
    statement = "stopping paths are the distance apart at the start"
    return Hypothesis(
        statement,
        least > control.guarded_distance * (1.0 + ROUNDING),
        f"the nearest are {rounded_down(least, 6)} apart",
    )


def _clear(scenario: Scenario, control: SafetyFilter) -> Hypothesis:
    """Whether all stopping paths are the clearance away from all obstacles at the start."""
    q, paths, least = scenario.start.q, _paths(scenario, control), np.inf
    for place, path in zip(q, paths, strict=True):
        for wall in control.walls:
            ends = np.array([place, place + path]) - wall.point.at(0.0)[0]
            least = min(least, float((ends @ wall.normal).min()))
        for ball in control.balls:
            own, _ = nearest_points(path, (ball.centre.at(0.0)[0] - place)[None], np.zeros((1, len(place))))
            away = own[0] + place - ball.centre.at(0.0)[0]
            least = min(least, float(np.linalg.norm(away)) - ball.radius)
    statement = "stopping paths are the clearance away from obstacles at the start"
    return Hypothesis(
        statement, least > control.guarded_clearance * (1.0 + ROUNDING), f"the nearest is {rounded_down(least, 6)} away"
    )


def _paths(scenario: Scenario, control: SafetyFilter) -> Array:
    n = scenario.start.n
    return stopping_paths(scenario.start.p, control.accelerations(n), float(np.max(control.period)))
