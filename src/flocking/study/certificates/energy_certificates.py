"""Guarantees from an energy that does not grow: distances, links, speeds and forces."""

from __future__ import annotations

import math

import numpy as np

from flocking.arrays import Links
from flocking.formula.intervals import Interval
from flocking.formula.safe_digits import rounded_down, rounded_up
from flocking.model.terms.pair_terms import Consensus
from flocking.study.certificates.certificate import ALONE, NOT_APPLICABLE, Certificate, decided
from flocking.study.certificates.energy_setting import LARGEST_GROUP, EnergySetting
from flocking.study.certificates.sources import sources

KEYS = (
    "largest_energy", "closest_approach", "simultaneous_collisions", "longest_link", "links_kept", "group_diameter",
    "largest_speed", "largest_force",
)  # fmt: skip
"""Keys of the certificates, in their order."""


def energy_certificates(setting: EnergySetting) -> tuple[Certificate, ...]:
    """All guarantees that follow from the energy of a scenario.

    Parameters
    ----------
    setting
        The scenario with its hypotheses.
    """
    found = [_energy(setting)]
    without = _without_pairs(setting) or ("" if setting.gradients else "no potential acts between agents")
    if without:
        found += [_not_said(key, without) for key in ("closest_approach", "simultaneous_collisions", "longest_link")]
    else:
        found += _distances(setting)
    return (*found, _links_kept(setting), _diameter(setting, found[-1]), _speed(setting), _force(setting))


def _of_graph(setting: EnergySetting) -> str:
    """Which links are meant, in words: of the graph over which potentials act, where terms have graphs of their own."""
    return " of the graph of the law" if len(setting.law.graphs) > 1 else ""


def _without_pairs(setting: EnergySetting) -> str:
    """Why there is no pair of which links or distances could be stated; empty where there is one."""
    if setting.n == 1:
        return ALONE
    # Of larger groups nothing is stated, and pairs are not looked at.
    linked = setting.graph.moves or setting.n > LARGEST_GROUP or setting.start_links.any()
    return "" if linked else "links are fixed, and there is none"


def _not_said(key: str, reason: str) -> Certificate:
    return Certificate(key, "", sources()["energy"], (), NOT_APPLICABLE, reason)


def _energy(setting: EnergySetting) -> Certificate:
    words = {"leader": "relative to the leader", "lab": "at rest", "centre of mass": "of the centre of mass"}
    hypotheses, quantity = setting.hypotheses, f"energy above its least value, in the frame {words[setting.frame]}"
    if not setting.holds:
        return decided("largest_energy", sources()["energy"], hypotheses, quantity=quantity)
    bound = setting.excess
    return decided(
        "largest_energy", sources()["energy"], hypotheses, bound=bound, quantity=quantity,
        statement=f"The {quantity} is at most {rounded_up(bound.hi)} at all times.",
    )  # fmt: skip


def _distances(setting: EnergySetting) -> list[Certificate]:
    hypotheses = setting.hypotheses
    if not setting.holds:
        found = {"closest_approach": "energy", "simultaneous_collisions": "count", "longest_link": "energy"}
        return [decided(key, sources()[source], hypotheses) for key, source in found.items()]
    fixed = setting.links_stay and not setting.keeps_links
    linked = "agents linked in the graph of the law" if _of_graph(setting) else "linked agents"
    pairs = linked if fixed else "agents"
    largest = setting.least + setting.excess
    contact = float(setting.pair.at_contact.lo)
    quantity = f"smallest distance of two {pairs}"
    if contact <= largest.hi:
        needed = max(contact, float(setting.least.lo))
        reason = (
            f"the energy may suffice for contact: {rounded_down(needed, 6)} is needed, "
            f"{rounded_up(largest.hi, 6)} may be there"
        )
        nearest = decided("closest_approach", sources()["energy"], hypotheses, reason=reason, quantity=quantity)
    else:
        bound = setting.nearest
        if not fixed:
            # A pair farther apart than this has no link yet and may be at any such distance.
            reach = float(np.asarray(setting.graph.appear_radius)) if setting.keeps_links else setting.pair.end
            bound = Interval.of(min(float(bound.lo), reach), min(float(bound.hi), reach))
        statement = f"Two {pairs} are never closer than {rounded_down(bound.lo)}: they do not collide."
        if not float(bound.lo) > 0.0:
            statement = (
                f"Two {pairs} do not collide: contact needs more energy than there is; how near they come is open."
            )
        nearest = decided(
            "closest_approach", sources()["energy"], hypotheses, statement=statement, bound=bound, side="at least",
            quantity=quantity,
        )  # fmt: skip
    return [nearest, _collisions(setting, contact, pairs), _longest(setting)]


def _collisions(setting: EnergySetting, contact: float, pairs: str) -> Certificate:
    quantity = f"number of pairs of {pairs} at one point at one time"
    each = contact - float(setting.least.hi)
    if not each > 0.0:
        reason = "the energy of a pair at contact is not above its least value"
        return decided(
            "simultaneous_collisions", sources()["count"], setting.hypotheses, reason=reason, quantity=quantity
        )
    # Rounding up the quotient is on the safe side.
    with np.errstate(all="ignore"):
        most = np.nextafter(np.float64(setting.excess.hi) / np.nextafter(np.float64(each), 0.0), np.inf)
    every = setting.n * (setting.n - 1) // 2
    count = math.floor(most) if most < every else every
    statement = f"At most {count} pairs of {pairs} are at one point at any time."
    return decided(
        "simultaneous_collisions", sources()["count"], setting.hypotheses, statement=statement,
        bound=Interval.of(float(count)), quantity=quantity,
    )  # fmt: skip


def _longest(setting: EnergySetting) -> Certificate:
    quantity = "length of a link"
    bound = setting.farthest
    reason = "" if bound is not None else "the energy does not bound the distance of linked agents"
    statement = "" if bound is None else f"No link{_of_graph(setting)} is ever longer than {rounded_up(bound.hi)}."
    return decided(
        "longest_link", sources()["energy"], setting.hypotheses, reason=reason, statement=statement, bound=bound,
        quantity=quantity,
    )  # fmt: skip


def _links_kept(setting: EnergySetting) -> Certificate:
    if without := _without_pairs(setting):
        return _not_said("links_kept", without)
    hypotheses = setting.hypotheses
    reason = "" if not setting.holds or setting.links_stay else "links break at the radius at which they appear"
    return decided(
        "links_kept", sources()["energy"], hypotheses, reason=reason, bound=Interval.of(0.0),
        statement=f"No link{_of_graph(setting)} that exists is ever lost.", quantity="number of links lost",
    )  # fmt: skip


def _diameter(setting: EnergySetting, longest: Certificate) -> Certificate:
    if setting.n == 1:
        return _not_said("group_diameter", ALONE)
    hypotheses, quantity = setting.hypotheses, "largest distance of two agents"
    reason, bound = "", None
    if setting.holds:
        if not setting.links_stay:
            reason = "links may be lost"
        elif longest.bound is None:
            reason = longest.reason
        else:
            hops = _largest_hops(setting.start_links)
            if hops is None:
                reason = "the graph at the start is not connected"
            else:
                bound = Interval.of(longest.bound.lo, longest.bound.hi) * Interval.of(float(hops))
    statement = "" if bound is None else f"No two agents are ever farther apart than {rounded_up(bound.hi)}."
    return decided(
        "group_diameter", sources()["kept"], hypotheses, reason=reason,
        statement=statement, bound=bound, quantity=quantity,
    )  # fmt: skip


def _largest_hops(links: Links) -> int | None:
    """Largest number of links on a shortest path; None where the graph is not connected."""
    from scipy.sparse.csgraph import shortest_path

    hops = shortest_path(np.asarray(links, dtype=np.float64), unweighted=True)
    largest = float(hops.max())
    return None if np.isinf(largest) else int(largest)


def speed_bounds(setting: EnergySetting) -> Interval:
    """Bounds of the speeds in the frame of the energy, one for each agent.

    Parameters
    ----------
    setting
        A scenario whose hypotheses hold.
    """
    masses = Interval.of(setting.masses)
    inverse = masses.reciprocal()
    if setting.frame == "centre of mass":
        # The others carry the opposite momentum, so that not all energy can be in one agent.
        rest = masses.total() - masses
        inverse = inverse * rest * masses.total().reciprocal()
    twice = setting.excess * Interval.of(2.0)
    return _root(twice * Interval(np.maximum(inverse.lo, 0.0), inverse.hi))


def _root(square: Interval) -> Interval:
    """The root of what is never negative, though rounding may take the lower end of a number near zero below it."""
    return Interval(np.maximum(square.lo, 0.0), square.hi).sqrt()


def _speed(setting: EnergySetting) -> Certificate:
    if setting.order == 1:
        return Certificate(
            "largest_speed", "", sources()["energy"], (), NOT_APPLICABLE, "agents of order 1 have no momentum"
        )
    words = {"leader": "relative to the leader", "lab": "", "centre of mass": "relative to the centre of mass"}
    quantity = f"speed of an agent {words[setting.frame]}".strip()
    bound = None
    if setting.holds:
        speeds = speed_bounds(setting)
        bound = Interval.of(speeds.lo.max(), speeds.hi.max())
    statement = "" if bound is None else f"The {quantity} is never above {rounded_up(bound.hi)}."
    return decided(
        "largest_speed", sources()["energy"], setting.hypotheses, statement=statement, bound=bound, quantity=quantity
    )


def _force(setting: EnergySetting) -> Certificate:
    quantity = "force of the law on an agent" if setting.order == 2 else "speed of the law for an agent"
    if not setting.holds:
        return decided("largest_force", sources()["energy"], setting.hypotheses, quantity=quantity)
    bound = _force_bound(setting)
    if isinstance(bound, str):
        return decided("largest_force", sources()["energy"], setting.hypotheses, reason=bound, quantity=quantity)
    return decided(
        "largest_force", sources()["energy"], setting.hypotheses, bound=Interval.of(float(bound.hi)), quantity=quantity,
        statement=f"The {quantity} is never above {rounded_up(bound.hi)}.",
    )  # fmt: skip


def _force_bound(setting: EnergySetting) -> Interval | str:
    """Bound of the norm of the control of any agent, or why there is none; the lower end of a bound means nothing."""
    most = Interval.of(float(setting.n - 1))
    if setting.links_stay and not setting.keeps_links:
        most = Interval.of(float(setting.start_links.sum(axis=1).max()))
    total = Interval.of(0.0)
    if setting.gradients:
        # A pair whose distance the energy does not bound may be at any distance beyond the nearest one.
        farthest = setting.farthest
        last = np.inf if farthest is None else float(farthest.hi)
        slope = setting.pair.slopes(float(setting.nearest.lo), last).absolute()
        if not np.isfinite(slope.hi):
            return "distances at which the force is unbounded are not excluded"
        total = total + most * slope
    if setting.order == 1:
        return total
    inverse = Interval.of(setting.masses).reciprocal()
    speeds = speed_bounds(setting)
    fastest, heaviest = Interval.of(0.0, speeds.hi.max()), float(setting.masses.max())
    # |w_i - w_j| <= sqrt(2 X (1/m_i + 1/m_j)) for the energy X of both.
    relative = _root(setting.excess * Interval.of(2.0) * (Interval.of(inverse.hi.max()) * Interval.of(2.0)))
    for term in setting.law.pair_terms:
        if isinstance(term, Consensus):
            weights = 1.0 if term.weights is None else float(term.weights.matrix(setting.n).max())
            gain = Interval.of(float(np.max(term.gain))) * Interval.of(weights)
            # Whoever senses whom: at most everybody.
            total = total + Interval.of(float(setting.n - 1)) * gain * relative
    if np.any(np.asarray(setting.scenario.agents.damping)) and not setting.damped:
        drift = setting.drift if setting.frame == "centre of mass" else None
        if drift is None:
            return "speeds, by which the force that cancels the damping grows, are bounded relative to a leader alone"
        total = total + Interval.of(float(np.max(setting.scenario.agents.damping))) * (fastest + drift)
    pursuit = _pursuit(setting, fastest, heaviest)
    return pursuit if isinstance(pursuit, str) else total + pursuit


def _pursuit(setting: EnergySetting, fastest: Interval, heaviest: float) -> Interval | str:
    """Bound of the force of the pursuit of a leader, or why there is none."""
    track = setting.track
    if track is None:
        return Interval.of(0.0)
    if np.any(np.asarray(track.acceleration_gain)) and not setting.leader_is_steady:
        return "the acceleration of the leader, which agents add to their force, is not bounded"
    scale = heaviest if track.per_mass else 1.0
    total = Interval.of(float(np.max(track.velocity_gain)) * scale) * fastest
    gains = setting.position_gains
    if gains.any():
        # c |q - x| where c |q - x|^2 / 2 is at most the energy.
        total = total + _root(setting.excess * Interval.of(2.0 * float(gains.max())))
    return total
