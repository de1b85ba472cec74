"""Whether limits of force and speed can ever act, from the bounds of the same run without them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flocking.arrays import Array
from flocking.formula.intervals import Interval
from flocking.formula.safe_digits import given_text, rounded_down, rounded_up
from flocking.model.bodies.actuators import Limited
from flocking.model.bodies.point_bodies import is_point_mass
from flocking.model.law import Scenario
from flocking.model.world.control import Continuous, Control, Held
from flocking.model.world.times import PER_SECOND, Instants
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
from flocking.study.certificates.energy_certificates import energy_certificates
from flocking.study.certificates.energy_setting import EnergySetting
from flocking.study.certificates.sources import sources

KEY = "limit_never_acts"
"""Key of the certificate of limits."""

LARGEST_GROUP = 2000
"""Agents up to which all pairs are looked at: two million, in arrays of 1 GB together."""

OF_HOLD = 0.125
"""Largest part of a T^2 by which an agent goes further whose force is held for T: the speed v that is left when it must
stop within a period takes v T / 2 instead of v^2 / (2 a), and the difference is largest at v = a T / 2."""

STOPPING = ("stopping_distance", "braking_suffices")
"""Keys of the certificates of what a largest force can do."""


def stopping_certificates(scenario: Scenario) -> tuple[Certificate, ...]:
    """What a largest force can do from the start, whatever the law: how far it takes to stop and to avoid contact.

    A force of at most F stops a mass m at the speed v in no less than m v^2/(2 F). Two agents at the distance g that
    close in at the speed w can avoid contact along the line between them if and only if
    w^2 <= 2 (F_i/m_i + F_j/m_j) g. Under held control no force acts before an agent's first tick and the latency: it
    goes on with its velocity until then. A force that is held for whole periods T stops an agent on at most F T^2/(8 m)
    and v T/2 more: v = k F T/m + r with 0 <= r < F T/m takes r T/2 - m r^2/(2 F) more, the last period with less force.
    To avoid contact a constant force suffices, which any period holds.

    Parameters
    ----------
    scenario
        The scenario.
    """
    body, source = scenario.agents, sources()["stopping"]
    limited = type(body) is Limited and body.force is not None and is_point_mass(body.body)
    undamped = limited and not np.any(np.asarray(body.damping))
    round_ = limited and type(body) is Limited and body.shape == "ball"
    hypotheses = until_failed(
        lambda: Hypothesis("point masses have a largest force", limited, type(body).__name__),
        lambda: Hypothesis(
            "it is the same in all directions, and agents are undamped",
            bool(round_ and undamped),
            "so" if round_ and undamped else "they are damped" if round_ else "it is one of each axis",
        ),
        lambda: Hypothesis("space is open", scenario.space.is_open, "so" if scenario.space.is_open else "it repeats"),
    )
    if not all(h.holds for h in hypotheses):
        return not_applicable(STOPPING, source, hypotheses)
    control = scenario.control
    hypotheses = until_failed(
        *(lambda h=h: h for h in hypotheses),
        lambda: Hypothesis(
            "control is continuous or held, and nothing changes the force that is held",
            type(control) in (Continuous, Held), control.summary or "continuous",
        ),
        lambda: Hypothesis(
            "agents know the present state", scenario.information.ideal, scenario.information.summary or "so"
        ),
    )  # fmt: skip
    if not all(h.holds for h in hypotheses):
        return tuple(decided(key, source, hypotheses) for key in STOPPING)
    assert type(body) is Limited
    n, start = scenario.start.n, scenario.start
    most = Interval.of(np.broadcast_to(np.asarray(body.force, dtype=np.float64), n)) / Interval.of(
        np.broadcast_to(np.asarray(body.masses, dtype=np.float64), n)
    )
    first = _first_forces(control, n)
    squares = Interval.of(np.zeros(n))
    for column in start.p.T:
        squares = squares + Interval.of(column).power(2)
    ways = squares / (most * Interval.of(2.0))
    if isinstance(control, Held):
        speeds = Interval(np.maximum(squares.lo, 0.0), squares.hi).sqrt()
        ways = ways + speeds * _in_seconds(first)
        period = _in_seconds(control.schedule(n).period)
        more = most * period.power(2) * Interval.of(OF_HOLD), speeds * period * Interval.of(0.5)
        ways = Interval(ways.lo, (ways + Interval(np.zeros(n), np.minimum(more[0].hi, more[1].hi))).hi)
    way = Interval.of(float(ways.lo.max()), float(ways.hi.max()))
    free = Hypothesis(
        "no largest speed keeps an agent from moving out of the way of another", body.speed is None,
        "none" if body.speed is None else f"speeds are at most {given_text(np.min(body.speed))}",
    )  # fmt: skip
    found = decided(
        STOPPING[0], source, hypotheses, bound=way, side="is", quantity="least distance on which all agents can stop",
        statement=f"No law stops every agent on less than {rounded_down(np.maximum(way.lo, 0.0))}; braking does on "
        f"{rounded_up(way.hi)}.",
    )  # fmt: skip
    if n == 1:
        return found, Certificate(STOPPING[1], "", source, hypotheses, NOT_APPLICABLE, ALONE)
    few = Hypothesis(f"at most {LARGEST_GROUP} agents, whose pairs are all looked at", n <= LARGEST_GROUP, f"{n}")
    if not few.holds:
        return found, decided(STOPPING[1], source, (*hypotheses, free, few))
    share = _contact_share(start.q, start.p, most, first)
    reason = (
        "to stop their approach along the line between them before its length is used up, two agents need "
        f"{rounded_up(share.hi, 6)} times their largest forces; they may pass each other all the same"
    )
    reason = "" if share.hi <= 1.0 else reason
    if np.isinf(share.hi):
        reason = (
            "two agents are at one point, or use up the distance along the line between them before both could brake; "
            "they may pass each other all the same"
        )
    return found, decided(
        STOPPING[1], source, (*hypotheses, free, few), reason=reason, bound=share, side="is",
        quantity="share of their largest forces with which two agents stop their approach along the line between them",
        statement="Braking suffices to avoid every contact between two agents alone"
        + (f": at most {rounded_up(share.hi, 6)} of their largest forces is needed." if share.hi <= 1.0 else "."),
    )  # fmt: skip


def _first_forces(control: Control, n: int) -> Instants:
    """Times at which each agent's first force acts, whole nanoseconds from the start, shape (N,)."""
    if not isinstance(control, Held):
        return np.zeros(n, dtype=np.int64)
    return control.schedule(n).phase + control.latencies(n)


def _in_seconds(times: Instants) -> Interval:
    """Whole nanoseconds as enclosed seconds."""
    found = times.astype(np.float64)
    # Above 2^53 not every whole number is one of double precision.
    around = Interval(
        np.where(found > 0.0, np.nextafter(found, 0.0), 0.0), np.where(found > 0.0, np.nextafter(found, np.inf), 0.0)
    )
    return around / Interval.of(float(PER_SECOND))


def _contact_share(q: Array, p: Array, most: Interval, first: Instants) -> Interval:
    """The least share s of their largest forces by which all pairs avoid contact, enclosed; infinite where none does.

    Along the line between the agents at the start the gap is g - w t + s a (t - c)^2/2 + s b (t - d)^2/2, each square
    from its time on, c <= d. Its least value is not negative from s = w^2/(2 a (g - w c)) on where it is reached before
    d, that is where 2 (g - w c) <= w (d - c). Else s solves a b (d - c)^2 s^2 + 2 B s = w^2 with
    B = a (g - w c) + b (g - w d), which for c = d is w^2/(2 (a + b) (g - w c)).
    """
    i, j = np.triu_indices(len(q), 1)
    if not len(i):
        return Interval.of(0.0)
    along, square = Interval.of(np.zeros(len(i))), Interval.of(np.zeros(len(i)))
    for k in range(q.shape[1]):
        away, speed = (Interval.of(x[j, k]) - Interval.of(x[i, k]) for x in (q, p))
        along, square = along + away * speed, square + away.power(2)
    distance = Interval(np.maximum(square.lo, 0.0), square.hi).sqrt()
    # Pairs at one point are set apart below, so that nothing is divided by zero.
    together = ~(distance.lo > 0.0)
    distance = Interval(np.where(together, 1.0, distance.lo), np.where(together, 1.0, distance.hi))
    closing = -along
    closing = Interval(np.maximum(closing.lo, 0.0), np.maximum(closing.hi, 0.0)) / distance
    closing = Interval(np.maximum(closing.lo, 0.0), closing.hi)
    earlier, later = np.where(first[i] <= first[j], i, j), np.where(first[i] <= first[j], j, i)
    a, b = (Interval(most.lo[k], most.hi[k]) for k in (earlier, later))
    c, wait = _in_seconds(first[earlier]), _in_seconds(first[later] - first[earlier])
    left = distance - closing * c
    both = a * left + b * (left - closing * wait)
    squared, waited = closing.power(2), closing * wait
    alone = _quotient(squared, a * left * Interval.of(2.0))
    under = both.power(2) + a * b * wait.power(2) * squared
    together_brake = _quotient(squared, both + Interval(np.maximum(under.lo, 0.0), under.hi).sqrt())
    twice = left * Interval.of(2.0)
    before, after = twice.hi <= waited.lo, twice.lo > waited.hi
    lo = np.where(before, alone.lo, np.where(after, together_brake.lo, np.minimum(alone.lo, together_brake.lo)))
    hi = np.where(before, alone.hi, np.where(after, together_brake.hi, np.maximum(alone.hi, together_brake.hi)))
    ends = (float(np.where(together, np.inf, x).max()) for x in (lo, hi))
    return Interval.of(*ends)


def _quotient(squared: Interval, under: Interval) -> Interval:
    """How much force a squared speed needs: none where it is zero, infinitely much where no way is left."""
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        lo, hi = squared.lo / under.hi, squared.hi / under.lo
    still = squared.hi <= 0.0
    lo = np.where(under.hi > 0.0, np.nextafter(np.maximum(lo, 0.0), 0.0), np.where(still, 0.0, np.inf))
    hi = np.where(under.lo > 0.0, np.nextafter(hi, np.inf), np.inf)
    return Interval(lo, np.where(still, 0.0, hi))


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
    inactive = Hypothesis("limits of the bodies never act", True, limits.statement)
    return (*(replace(each, hypotheses=(*each.hypotheses, inactive)) for each in found), limits)


def _limits(ideal: EnergySetting, body: Limited, found: dict[str, Certificate]) -> Certificate:
    hypotheses, force = ideal.hypotheses, found["largest_force"]
    quantity = "largest force of the law, over the limit"
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
        quantity = "largest speed, or force of the law, over the limit"
    share = float(max(shares))
    reason = "" if share < 1.0 else f"the bound is {rounded_up(share, 6)} times the limit, which may act"
    return decided(
        KEY, sources()["limits"], hypotheses, reason=reason, bound=Enclosure(0.0, share), quantity=quantity,
        statement=f"Limits never act: the {quantity}, is at most {rounded_up(share, 6)}.",
    )  # fmt: skip


def _largest_speed(ideal: EnergySetting, speed: Certificate) -> float | None:
    """Bound of the speed at rest; None where only speeds relative to a leader are bounded."""
    if speed.safe_bound is None or ideal.frame == "leader":
        return None
    drift = float(ideal.drift.hi) if ideal.frame == "centre of mass" else 0.0
    return float(np.nextafter(speed.safe_bound + drift, np.inf))
