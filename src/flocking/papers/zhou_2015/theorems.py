"""Claims of Zhou, Zhou and Zeng with their grounds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flocking.formula.safe_digits import compared_texts
from flocking.papers.grounds import claims_by_name
from flocking.papers.zhou_2015.bounds import largest_energy, most_new_links
from flocking.papers.zhou_2015.grounds import grounds
from flocking.papers.zhou_2015.system import LEADER, scenarios
from flocking.study.claims import general_claims as general
from flocking.study.claims.claim import Claim, Measure, Origin, Verdict, above, below
from flocking.study.claims.conclusions.energy import within_tolerances
from flocking.study.claims.conclusions.leaders import one_gain, tracking
from flocking.study.claims.settling import limit_of, limit_of_series, of_configuration
from flocking.study.claims.subjects import Subject, about
from flocking.study.evidence import Evidence

ROUNDING = 1e-9
"""Share of r - eps by which an unlinked pair may be nearer: where links appear is located to a tolerance."""

SAME_PRICE = 1e-6
"""Relative difference of what new links add from their price: a switch is located to a tolerance, where the potential
is steep."""

CLOSED_FORM = 100
"""Tolerances, of the largest speed or coordinate, by which means may differ from their closed form: as many as a ledger
may be open by."""


def energy_limit(e: Evidence) -> float:
    """Q_max or U_max of a run, from its start (16)-(18), (31)."""
    new = float(np.max(np.asarray(e.law.graph.appear_radius)))
    return largest_energy(float(e.trace["energy"][0]), e.run.n, e.potential, new)


@about(Subject.LEDGER, lasting=True)
def energy_bounded(e: Evidence) -> Measure:
    """Largest energy of the run against its bound, as far as the ledger resolves both.

    Of two agents no link is missing: the bound is the initial energy, which is the largest one.
    """
    largest, bound = float(e.trace["energy"].max()), energy_limit(e)
    reached, limit = compared_texts(largest, bound, 4)
    return below(largest, bound + e.ledger_bound, f"largest {reached}, bound {limit}")


@about(Subject.LINKS, lasting=True)
def new_links_bounded(e: Evidence) -> Measure:
    """Number of links added over the whole run against M of (16)."""
    most = most_new_links(e.run.n)
    if e.seen_created > most and not e.switches_known:
        return below(e.seen_created, most + 0.5, f"at least {e.seen_created} created, at most {most}")
    fewest, possible = e.numbers("appear")
    if fewest <= most < possible:
        return Measure(most - fewest + 0.5, np.inf, e.doubt_note("appear"))
    return below(fewest, most + 0.5, f"{e.links_created} created, at most {most}")


@about(Subject.LEDGER, lasting=True)
def new_links_cost_the_same(e: Evidence) -> Measure:
    """Jump of the energy at each new link against psi(r - eps), the value in (17)."""
    psi = e.potential
    price = float(psi(float(np.max(np.asarray(e.law.graph.appear_radius)))))
    paid, created = float(e.trace["jumped"][-1]), e.links_created
    # No link costs nothing, even an infinite price.
    off = abs(paid - created * price) if created else abs(paid)
    allowed = SAME_PRICE * max(abs(price), abs(paid))
    note = f"{created} new links added {paid:.6g}, {price:.6g} each"
    # Links of no price are not off by the bound of nothing.
    return below(off, allowed, note) if off else Measure(allowed or np.inf, 0.0, note)


@about(Subject.VELOCITIES, lasting=True)
def speeds_bounded(e: Evidence) -> Measure:
    """Largest speed against sqrt(2 Q_max), after (18)."""
    bound = float(np.sqrt(2 * energy_limit(e)))
    return general.at_most(e, "speed", float(e.speeds.max()), bound)


@about(Subject.NET, lasting=True)
def distances_bounded(e: Evidence) -> Measure:
    """Largest distance against (N-1) r, after (18)."""
    bound = (e.run.n - 1) * float(np.max(np.asarray(e.law.graph.break_radius)))
    return general.at_most(e, "diameter", float(e.diameter.max()), bound)


@about(Subject.CLOSEST, lasting=True)
def unlinked_apart(e: Evidence) -> Measure:
    """Closest unlinked pair against r - eps but for rounding, below which every pair is linked."""
    least = float(np.min(np.asarray(e.law.graph.appear_radius)))
    found = e.closest_unlinked
    bound = least * (1 - ROUNDING)
    closest, threshold = compared_texts(found.distance, bound, 6)
    return above(found.distance, bound, f"closest unlinked pair {closest}, threshold {threshold}")


def agents_coincide(e: Evidence) -> Measure:
    """Largest distance of two agents at the end against the largest at the start."""
    wide = float(e.diameter[0])
    return limit_of_series(
        e, e.t, e.diameter, general.SETTLED * wide, lambda d: f"the group ends {d:.3g} wide, from {wide:.3g}"
    )


def links_have_one_length(e: Evidence) -> Measure:
    """Largest difference between a link's length at the end and the minimum of the potential."""
    from flocking.study.claims.potential_minimum import smallest_value

    best, _ = smallest_value(e.potential, float(np.max(np.asarray(e.law.graph.break_radius))))
    lengths = e.equilibrium.r
    if len(lengths) == 0:
        absent = e.beyond_radius_at_end() if e.law.graph.moves else None
        return of_configuration(e, Measure(np.inf, 0.0, "no links", absent=absent))

    def off(frame: int) -> float:
        return float(np.abs(e.equilibrium_at(frame).r - best).max(initial=0.0))

    note = f"link lengths {lengths.min():.3g} to {lengths.max():.3g}, best {best:g}"
    return limit_of(e, general.SETTLED * best, off, lambda _: note)


@about(Subject.LEADER)
def velocities_follow(e: Evidence) -> Measure:
    """Largest difference from the leader's velocity at the end against the largest of the run."""
    goal = tracking(e).leader.at(float(e.t[-1]))[1]
    off = np.linalg.norm(e.p - goal, axis=2).max(axis=1)
    ratios = off / off.max() if off.any() else off
    return limit_of_series(e, e.t, ratios, general.SETTLED, lambda r: f"difference fell to {r:.1e} of its maximum")


@about(Subject.LEADER, lasting=True)
def mean_velocity_decays(e: Evidence) -> Measure:
    """Largest difference between the mean velocity and the closed form (34)."""
    track = tracking(e)
    goal = track.leader.at(float(e.t[0]))[1]
    decay = np.exp(-one_gain(track, "velocity_gain") * (e.t - e.t[0]))
    expected = goal + (e.mean_velocity[0] - goal) * decay[:, None]
    off = float(np.abs(e.mean_velocity - expected).max())
    return within_tolerances(e, off, CLOSED_FORM, e.run.scenario.tolerance, f"off by {off:.1e}")


def leader_offset(e: Evidence) -> Measure:
    """Final mean position relative to the leader, against the integral of (34)."""
    track = tracking(e)
    start, goal, _ = track.leader.at(float(e.t[0]))
    end = track.leader.at(float(e.t[-1]))[0]
    gain, lasted = one_gain(track, "velocity_gain"), float(e.t[-1] - e.t[0])
    # The integral of exp(-gain t), which is the time itself without a gain.
    decayed = -np.expm1(-gain * lasted) / gain if gain else lasted
    expected = e.q[0].mean(axis=0) - start + (e.mean_velocity[0] - goal) * decayed
    off = float(np.abs(e.q[-1].mean(axis=0) - end - expected).max())
    allowed = CLOSED_FORM * e.run.scenario.tolerance * float(np.abs(e.q).max())
    note = f"ends {np.linalg.norm(expected):.3g} from the leader, closed form off by {off:.1e}"
    return below(off, allowed, note)


def leader_met(e: Evidence) -> Measure:
    """Distance of the mean position from the leader at the end against the start."""
    leader = tracking(e).leader
    distances = np.linalg.norm(e.q.mean(axis=1) - leader.along(e.t)[0], axis=1)
    first = float(distances[0])
    return limit_of_series(
        e, e.t, distances, general.SETTLED * first,
        lambda last: f"distance to the leader {first:.3g} at the start, {last:.3g} at the end",
    )  # fmt: skip


def _stated(scenario: str) -> Sequence[Claim]:
    led = scenario == LEADER
    theorem = "Theorem 2" if led else "Theorem 1"
    name, rate = ("U", "(29)") if led else ("Q", "(14)")
    start = general.starts_connected
    fails = Verdict.FAILS
    shared = (
        Claim("energy", rate, f"The rate of {name} between switches is the Laplacian form.", general.ledger_residual,
              dynamic=False),
        Claim("energy-falls", rate, f"{name} never rises between switches.", general.energy_rise),
        Claim("energy-bound", "(31)" if led else "(16)-(18)", f"{name} never exceeds its bound.", energy_bounded,
              start),
        Claim("energy-per-link", "(17)", "Every new link adds psi(r - eps) and nothing else.", new_links_cost_the_same,
              start),
        Claim("new-links", "(16)", "No more than M links are ever added.", new_links_bounded, start),
        Claim("connected", f"{theorem} (i)", "The graph stays connected.", general.stays_connected, start),
        Claim("links-kept", f"proof of {theorem}", "No link is ever lost.", general.no_link_lost, start),
        Claim("linked-apart", theorem, "Linked agents never collide.", general.linked_apart, start),
        Claim("all-apart", theorem, "No two agents ever collide.", general.all_apart, start),
        Claim("unlinked-apart", "rule (iii)", "Unlinked agents are never closer than r - eps.", unlinked_apart, start),
        Claim("distances-settle", theorem, "All distances tend to fixed values.", general.distances_settle, start),
        Claim("switching-stops", "before (19)", "The graph is fixed in the end.", general.switching_stops, start),
        Claim("speed-bound", "after (18)", f"No speed exceeds sqrt(2 {name}_max)"
              + (", in the leader's frame." if led else "."), relative_speeds_bounded if led else speeds_bounded,
              start),
        Claim("distance-bound", "after (18)", "No distance exceeds (N-1) r.", distances_bounded, start),
        Claim("coincide", "(23), sec. 2.2", "All agents come together at one point.", agents_coincide, start,
              expected=fails, reason="The potential is infinite there; L-hat has entries of both signs."),
        Claim("one-length", "not stated", "All links get the length r/2 at which the potential is least.",
              links_have_one_length, start, expected=fails, reason="Ten agents in a plane cannot all be r/2 apart.",
              origin=Origin.OWN),
    )  # fmt: skip
    if not led:
        return (
            *shared,
            Claim("momentum", f"{theorem} (ii), (21)", "The mean velocity is constant.", general.momentum_drift),
            Claim("velocities-agree", f"{theorem} (iii)", "All velocities become the mean.", general.velocities_agree,
                  start),
            Claim("stationary", "(22)-(23)", "The potential forces balance in the limit.", general.forces_vanish,
                  start),
        )  # fmt: skip
    return (
        *shared,
        Claim("velocities-agree", f"{theorem} (ii)", "All velocities become the same.", general.velocities_agree,
              start),
        Claim("velocities-follow", f"{theorem} (ii)", "All velocities become the leader's.", velocities_follow, start),
        Claim("mean-velocity", "(34)", "The mean velocity decays to the leader's exponentially.", mean_velocity_decays),
        Claim("leader-offset", "not stated", "The mean position keeps the offset that follows from (34).",
              leader_offset, origin=Origin.OWN),
        Claim("leader-met", "abstract", "The group comes together with the leader.", leader_met, start, expected=fails,
              reason="(24) feeds back the leader's velocity alone: nothing draws the group to its position."),
        Claim("stationary", "proof of Theorem 2", "The potential forces balance in the limit.", general.forces_vanish,
              start),
    )  # fmt: skip


claims = claims_by_name(scenarios, _stated, lambda name: grounds(name == LEADER))
"""Claims about a scenario by its name, see `claims_by_name`."""


@about(Subject.VELOCITIES, lasting=True)
def relative_speeds_bounded(e: Evidence) -> Measure:
    """Largest speed relative to the leader against sqrt(2 U_max)."""
    goal = tracking(e).leader.at(float(e.t[0]))[1]
    bound = float(np.sqrt(2 * energy_limit(e)))
    return general.at_most(e, "relative speed", float(np.linalg.norm(e.p - goal, axis=2).max()), bound)
