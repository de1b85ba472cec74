"""What a safety filter guarantees before the run: two agents that can brake never come closer than its distance."""

from __future__ import annotations

import numpy as np

from flocking.model.bodies.point_bodies import is_point_mass
from flocking.model.law import Scenario
from flocking.model.world.information import Instant
from flocking.model.world.safety_filters import MARGIN, ROUNDING, SafetyFilter
from flocking.study.certificates.certificate import (
    Certificate,
    Enclosure,
    Hypothesis,
    decided,
    not_applicable,
    until_failed,
)
from flocking.study.certificates.sources import sources

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
        return not_applicable(("safe_distance",), source, (declared,))
    n = scenario.start.n

    def form() -> Hypothesis:
        statement = "the filter's condition is that of held forces"
        return Hypothesis(statement, filter_.form != "continuous", f"form={filter_.form!r}")

    def number() -> Hypothesis:
        return Hypothesis("there are two agents, whose conditions never contradict each other", n == PAIR, f"{n}")

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
        holds = together and not filter_.latency
        return Hypothesis("all act together from the start on, without latency", bool(holds), filter_.summary)

    def able() -> Hypothesis:
        left = _reserve(scenario, filter_)
        return Hypothesis(
            "both can brake before the distance at the start", left > MARGIN * filter_.distance,
            f"{left:.4g} is left",
        )  # fmt: skip

    hypotheses = until_failed(form, number, bodies, knowledge, clock, able)
    bound = filter_.distance * (1.0 - ROUNDING)
    return (decided(
        "safe_distance", source, hypotheses, bound=Enclosure(bound, filter_.distance), side="at least",
        quantity="closest approach",
        statement=f"The two agents never come closer than {bound:.9g}.",
    ),)  # fmt: skip


def _reserve(scenario: Scenario, control: SafetyFilter) -> float:
    """Distance that is left when both brake from the start on."""
    (q, r), (p, v) = scenario.start.q, scenario.start.p
    apart = float(np.linalg.norm(r - q))
    closing = -float((r - q) @ (v - p)) / apart if apart else np.inf
    braking = float(control.accelerations(PAIR).sum())
    return float(control.reserve(np.asarray(apart), np.asarray(closing), np.asarray(braking)))
