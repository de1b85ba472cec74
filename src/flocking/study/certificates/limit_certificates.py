"""Whether limits of force and speed can ever act, from the bounds of the same run without them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flocking.model.bodies.actuators import Limited
from flocking.model.law import Scenario
from flocking.study.certificates.certificate import (
    NOT_APPLICABLE,
    Certificate,
    Enclosure,
    Hypothesis,
    decided,
)
from flocking.study.certificates.energy_certificates import energy_certificates
from flocking.study.certificates.energy_setting import EnergySetting
from flocking.study.certificates.sources import sources

KEY = "limit_never_acts"
"""Key of the certificate of limits."""


def energy_and_limits(scenario: Scenario) -> tuple[Certificate, ...]:
    """The guarantees from the energy, and whether limits of the bodies ever act.

    Where they never do, every run is that of the bodies without limits, and has its guarantees.

    Parameters
    ----------
    scenario
        The scenario.
    """
    body = scenario.agents
    if type(body) is not Limited:
        none = Certificate(KEY, "", sources()["limits"], (), NOT_APPLICABLE, "bodies have no limits")
        return (*energy_certificates(EnergySetting(scenario)), none)
    ideal = EnergySetting(scenario.with_(agents=body.body))
    found = energy_certificates(ideal)
    limits = _limits(ideal, body, {each.key: each for each in found})
    if not limits.granted:
        return (*energy_certificates(EnergySetting(scenario)), limits)
    kept = Hypothesis("limits of the bodies never act", True, limits.statement)
    return (*(replace(each, hypotheses=(*each.hypotheses, kept)) for each in found), limits)


def _limits(ideal: EnergySetting, body: Limited, found: dict[str, Certificate]) -> Certificate:
    hypotheses, force = ideal.hypotheses, found["largest_force"]
    quantity = "largest force that the law asks, over the limit"
    if not ideal.holds:
        return decided(KEY, sources()["limits"], hypotheses, quantity=quantity)
    shares = []
    if body.rate is not None:
        return decided(KEY, sources()["limits"], hypotheses, reason="rates of force are not bounded", quantity=quantity)
    if body.force is not None:
        if force.safe_bound is None:
            return decided(KEY, sources()["limits"], hypotheses, reason=force.reason, quantity=quantity)
        shares.append(np.nextafter(force.safe_bound / float(np.min(body.force)), np.inf))
    if body.speed is not None:
        speed = force.safe_bound if ideal.order == 1 else _largest_speed(ideal, found["largest_speed"])
        if speed is None:
            reason = "speeds are bounded relative to a leader that moves"
            return decided(KEY, sources()["limits"], hypotheses, reason=reason, quantity=quantity)
        shares.append(np.nextafter(speed / float(np.min(body.speed)), np.inf))
        quantity = "largest speed, or force that the law asks, over the limit"
    share = float(max(shares))
    reason = "" if share < 1.0 else f"the bound is {share:.6g} times the limit, which may act"
    return decided(
        KEY, sources()["limits"], hypotheses, reason=reason, bound=Enclosure(0.0, share), quantity=quantity,
        statement=f"Limits never act: the {quantity}, is at most {share:.6g}.",
    )  # fmt: skip


def _largest_speed(ideal: EnergySetting, speed: Certificate) -> float | None:
    """Bound of the speed at rest; None where only speeds relative to a leader are bounded."""
    if speed.safe_bound is None or ideal.frame == "leader":
        return None
    drift = float(ideal.drift.hi) if ideal.frame == "centre of mass" else 0.0
    return float(np.nextafter(speed.safe_bound + drift, np.inf))
