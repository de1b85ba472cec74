"""Claims of Olfati-Saber about the simulations and protocols (34) and (35), with the expected verdicts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from flocking.model.checks import Array
from flocking.model.potentials.potential import Potential
from flocking.model.terms.pair_terms import Gradient
from flocking.papers.grounds import claims_by_name
from flocking.papers.obstacle_passages import once_passed
from flocking.papers.olfati_saber_2003 import passage
from flocking.papers.olfati_saber_2003.grounds import grounds
from flocking.papers.olfati_saber_2003.system import FREE, KEY, SINK, SMOOTH, scenarios
from flocking.study.claims import general_claims as general
from flocking.study.claims.claim import Claim, Measure, Origin, Verdict, above, below, happens
from flocking.study.claims.conclusions.leaders import tracking
from flocking.study.claims.settling import limit_of, limit_of_configuration, limit_of_series, of_configuration
from flocking.study.claims.subjects import Subject, about
from flocking.study.evidence import Evidence, NotMeasurable, NotResolvable

LEAST_DENSITY = 0.9
"""Smallest density of a quasi-flock; the paper reports about 0.97."""
SAME = 0.1
"""Velocities and headings (in radians) count as approximately equal within this."""
CONNECTED_BY = 5.0
"""Time by which the net at a sink must be connected; the paper reports 4 s for its start."""
DEFECT_WEIGHT = 0.01
"""w of (46), (47)."""
LOW_DEFECT = 0.5
"""Largest mu_n that counts as low; at 1 every link is at the break radius. The paper gives no number."""
DOMINANT = 0.75
"""Smallest fraction of triangles among the faces of a dominantly triangular net."""
REALIZED = 1e-3
"""Largest relative error of link lengths of a net that realizes (d_alpha, r)."""


def potential_of(e: Evidence) -> Potential:
    """The potential of the law's links."""
    found = next((t.potential for t in e.law.pair_terms if isinstance(t, Gradient)), None)
    if found is None:
        raise NotMeasurable("the law has no potential over its graph")
    return found


def dense_at_end(e: Evidence) -> Measure:
    """Density (7) at the end."""
    from flocking.study.nets.matrices import density

    return limit_of(
        e, 1 - LEAST_DENSITY, lambda frame: 1 - density(e.links_at(frame)), lambda rest: f"density {1 - rest:.2f}"
    )


def dense_behind(e: Evidence) -> Measure:
    """The same, left open while obstacles are ahead."""
    return once_passed(e, dense_at_end(e))


def desired_velocity(e: Evidence) -> Array:
    """p_d at the end, the velocity of the run's own leader."""
    desired = tracking(e).leader.at(float(e.t[-1]))[1]
    if not desired.any():
        raise NotMeasurable("the leader is at rest: there is no desired direction")
    return np.asarray(desired)


@about(Subject.VELOCITIES, at_end=True)
def velocities_near_desired(e: Evidence) -> Measure:
    """Largest |p_i - p_d| at the end, against |p_d|."""
    desired = desired_velocity(e)
    off = float(np.linalg.norm(e.p[-1] - desired, axis=1).max() / np.linalg.norm(desired))
    return replace(below(off, SAME, f"velocities within {off:.1e} of |p_d|"), everywhere=False)


@about(Subject.VELOCITIES, at_end=True)
def headings_agree(e: Evidence) -> Measure:
    """Largest heading angle against the desired direction, at the end."""
    from flocking.model.observables import headings

    x, y = desired_velocity(e)
    off = float(np.abs(np.angle(np.exp(1j * (headings(e.state(-1)) - np.arctan2(y, x))))).max())
    return replace(below(off, SAME, f"headings within {off:.1e} rad"), everywhere=False)


def squeezes(e: Evidence) -> Measure:
    """Number of agents that pass between the last two obstacles."""
    if not passage.has_gap(e.run):
        raise NotMeasurable("the last two obstacles are not those of (59)")
    through = passage.through_gap(e.checked)
    return once_passed(e, happens(above(through, 2.5, f"{through} agents pass the gap of {passage.gap_width():g}")))


def _obstacle_claims() -> tuple[Claim, ...]:
    return (
        Claim(
            "energy",
            "(54), (58)",
            "The ledger of H_s closes, obstacles and tracking included.",
            general.ledger_residual,
            dynamic=False,
        ),
        Claim("quasi-flock", "sec. 11", "The limit is a quasi-flock.", dense_behind),
        Claim("no-entry", "sec. 11", "No agent enters an obstacle.", general.outside_obstacles),
        Claim(
            "velocities", "sec. 11", "All agents approximately move with the desired velocity.", velocities_near_desired
        ),
        Claim("headings", "sec. 11", "All headings are approximately the same.", headings_agree),
        Claim("split", "sec. 11, Fig. 8", "Obstacles split the net.", passage.splits_net),
        Claim("rejoin", "sec. 11, Fig. 8", "Flocks rejoin behind the obstacles.", passage.rejoins_behind),
        Claim("squeeze", "sec. 11, Fig. 8", "Agents squeeze through the gap between the last two obstacles.", squeezes),
    )


# -- sink -----------------------------------------------------------------------------------------------


def starts_apart(e: Evidence) -> Measure:
    """The net is disconnected at the start, as the paper assumes."""
    return general.starts_connected(e).opposite


def connected_since(e: Evidence) -> float:
    """Time after which the net is connected; infinite if it is not at the end."""
    from flocking.model.graphs.connectivity import is_connected

    found = []
    for history in e.possible_histories:
        since = np.inf
        for time, links in reversed(history):
            if not is_connected(links):
                break
            since = time
        found.append(float(since))
    if found[0] != found[1]:
        raise NotResolvable(e.doubt_note())
    return found[0]


@about(Subject.CONNECTIVITY)
def becomes_connected(e: Evidence) -> Measure:
    """Time after which the net stays connected."""
    since = connected_since(e)
    found = below(since, CONNECTED_BY, f"connected from t = {e.when(since, 3)} on")
    return replace(found, unsettled="" if e.t[-1] > CONNECTED_BY else f"the run ends before t = {CONNECTED_BY:g}")


def centred(e: Evidence) -> Measure:
    """Distance of the centre of mass from the sink at the end, against that of the farthest agent at first."""
    sink = tracking(e).leader.along(e.t)[0]
    off = np.linalg.norm(e.q.mean(axis=1) - sink, axis=1)
    wide = float(np.linalg.norm(e.q[0] - sink[0], axis=1).max())
    return limit_of_series(e, e.t, off, general.SETTLED * wide, lambda d: f"centre of mass {d:.1e} from the sink")


def rigid(e: Evidence) -> Measure:
    """Infinitesimal motions with constant link lengths, apart from rigid motions."""
    from flocking.study.nets.rigidity import degrees_of_freedom

    free = degrees_of_freedom(e.q[-1], e.end_links)
    return of_configuration(e, below(free, 0.5, f"{free} degrees of freedom"))


def planar(e: Evidence) -> Measure:
    """Number of pairs of links that cross."""
    return limit_of_configuration(e, 0.5, lambda frame: _crossings(e, frame), lambda count: f"{count:.0f} crossings")


def _crossings(e: Evidence, frame: int) -> int:
    from flocking.study.nets.rigidity import crossing_links

    return crossing_links(e.q[frame], e.links_at(frame))


def triangular(e: Evidence) -> Measure:
    """Fraction of triangles among the bounded faces; if links cross there are no faces."""
    from flocking.study.nets.rigidity import faces, triangle_share

    crossed = _crossings(e, -1) > 0
    if not crossed and not faces(e.q[-1], e.end_links):
        raise NotMeasurable("the net has no bounded face at the end")

    def others(frame: int) -> float:
        return 1.0 if _crossings(e, frame) else 1 - triangle_share(e.q[frame], e.links_at(frame))

    def note(rest: float) -> str:
        return "links cross: there are no faces" if crossed else f"{1 - rest:.3f} of the faces are triangles"

    return limit_of_configuration(e, 1 - DOMINANT, others, note)


def little_defect(e: Evidence) -> Measure:
    """Normalized defect factor (47) at the end, for w = 0.01."""
    from flocking.papers.olfati_saber_2003.structural_nets import defect

    psi = potential_of(e)

    def normalized(frame: int) -> float:
        return defect(e.law.graph, psi, e.state(frame), weight=DEFECT_WEIGHT).normalized

    return limit_of_configuration(
        e, LOW_DEFECT, normalized, lambda found: f"mu_n = {found:.3f} for w = {DEFECT_WEIGHT:g}"
    )


def realizes(e: Evidence) -> Measure:
    """Largest deviation of a link's length from d_alpha at the end, the distance where the potential is least."""
    from flocking.papers.olfati_saber_2003.structural_nets import deviation
    from flocking.study.claims.potential_minimum import smallest_value

    distance, _ = smallest_value(potential_of(e), _radius(e))

    def off(frame: int) -> float:
        return deviation(e.q[frame], e.links_at(frame), distance) / distance

    return limit_of(e, REALIZED, off, lambda most: f"lengths within {most:.1e} of d_alpha")


@about(Subject.LEDGER)
def structural_energy_vanishes(e: Evidence) -> Measure:
    """H_s at the end against its largest value at a frame (Definition 2 ii)."""
    values = structural_energies(e)
    most = float(values.max()) or 1.0
    return limit_of_series(
        e, e.t, values / most, REALIZED, lambda ratio: f"H_s ends at {ratio * most:.3g}, {ratio:.1e} of its maximum"
    )


def structural_energies(e: Evidence) -> Array:
    """H_s at the frames, shape (F,)."""
    from flocking.papers.olfati_saber_2003.structural_nets import structural_energy

    psi = potential_of(e)
    return np.array([structural_energy(e.law.graph, psi, e.state(k)).total for k in range(len(e.t))])


def _sink_claims() -> tuple[Claim, ...]:
    return (
        Claim(
            "energy",
            "(50), (52)",
            "The ledger of H_s plus the sink's energy closes.",
            general.ledger_residual,
            dynamic=False,
        ),
        Claim("energy-falls", "(50)", "The energy never rises.", general.energy_rise),
        Claim(
            "connected",
            "sec. 11",
            "A disconnected net becomes connected within a few seconds and stays so.",
            becomes_connected,
            starts_apart,
        ),
        Claim(
            "switching-stops", "sec. 10, 11", "After finite time the topology is invariant.", general.switching_stops
        ),
        Claim("centred", "sec. 10", "The centre of mass comes to rest at the sink.", centred),
        Claim("rigid", "sec. 11", "The limiting flock is rigid.", rigid),
        Claim("planar", "sec. 11", "The limiting net is planar.", planar),
        Claim("triangular", "sec. 11", "Its faces are dominantly triangles.", triangular),
        Claim("low-defect", "sec. 11, (47)", "Its normalized defect factor is low.", little_defect),
        Claim(
            "realization",
            "(20)",
            "The limit realizes the structural net.",
            realizes,
            origin=Origin.OWN,
            expected=Verdict.FAILS,
            reason="The sink presses on the net: the limit is a quasi-realization, as section 11 says.",
        ),
        Claim(
            "flocking",
            "Definition 2",
            "H_s tends to 0.",
            structural_energy_vanishes,
            origin=Origin.OWN,
            expected=Verdict.FAILS,
            reason="V > 0 in a quasi-realization: Definition 2 does not cover the paper's own simulation.",
        ),
    )


# -- protocols (34) and (35) alone ----------------------------------------------------------------------


def settles_as_flock(e: Evidence) -> Measure:
    """Hypothesis of Propositions 4 and 5: finitely many switches, and one flock from then on."""
    if e.flocks_at_end > 1:
        return Measure(-1.0, 0.0, f"{e.flocks_at_end} flocks at the end")
    return general.switching_stops(e)


@about(Subject.LEDGER, lasting=True)
def jumps_by_h0(e: Evidence) -> Measure:
    """The jump of H_s at every switching time against h_0 times the links created less those lost at that time."""
    h0, trace, switches = link_energy(e), e.trace, e.link_switches
    at: Array = switches["time"]
    jumped: Array = trace["jumped"]
    times, which = np.unique(at, return_inverse=True)
    created = np.bincount(which, np.where(switches["kind"] == "appear", 1.0, -1.0), len(times))
    # The last row of the ledger at that time is after the jump; what jumps between is added to the next.
    rows = np.append(np.searchsorted(trace["time"], times, side="right") - 1, len(trace["time"]) - 1)
    jumps = np.diff(jumped[rows], prepend=jumped[0])
    off = float(np.abs(jumps / h0 - np.append(created, 0.0)).max())
    return below(off, 1e-6, f"{len(times)} jumps equal {h0:.4g} for each link within {off:.1e}")


def link_energy(e: Evidence) -> float:
    """h_0 = psi_alpha(r - d_alpha), what a link of the run's law costs where it appears (31)."""
    return float(potential_of(e)(_radius(e)))


def _radius(e: Evidence) -> float:
    return float(np.max(np.asarray(e.law.graph.break_radius)))


def some_switch(e: Evidence) -> Measure:
    """At least two switches."""
    fewest = int(e.link_certain.sum())
    if fewest < 2 <= fewest + len(e.link_doubts):
        raise NotResolvable(e.doubt_note())
    return happens(above(fewest, 1.5, f"{len(e.link_switches)} switches"))


@about(Subject.LEDGER, lasting=True)
def energy_falls_from_switch_to_switch(e: Evidence) -> Measure:
    """Largest rise of H_s from one switching time to the next (Remark 5)."""
    trace = e.trace
    after = [float(trace["energy"][0])]
    for time in np.unique(e.link_switches["time"]):
        # The last row of the ledger at that time is after the jump.
        after.append(float(trace["energy"][np.searchsorted(trace["time"], time, side="right") - 1]))
    rise = float(np.diff(after).max())
    return Measure(-rise, e.ledger_bound, f"H_s changes by up to {rise:+.3g} from switch to switch")


def _free_claims() -> tuple[Claim, ...]:
    return (
        Claim("energy", "(60)", "The ledger of H_s closes.", general.ledger_residual, dynamic=False),
        Claim("momentum", "A.2", "The mean velocity is invariant.", general.momentum_drift),
        Claim("energy-falls", "Proposition 4, (61)", "H_s never rises between switches.", general.energy_rise),
        Claim(
            "jumps",
            "(31)",
            "H_s jumps by h_0 where a link appears and by -h_0 where one is lost.",
            jumps_by_h0,
            some_switch,
        ),
        Claim(
            "velocities-agree",
            "Proposition 4",
            "All velocities become the same.",
            general.velocities_agree,
            settles_as_flock,
        ),
        Claim(
            "distances-settle",
            "Proposition 4",
            "All distances become constant.",
            general.distances_settle,
            settles_as_flock,
        ),
        Claim(
            "decreasing",
            "Remark 5",
            "H_s at the switching times decreases.",
            energy_falls_from_switch_to_switch,
            some_switch,
            expected=Verdict.FAILS,
            reason="A new link adds h_0, more than what has been dissipated since the last switch.",
        ),
    )


def _smooth_claims() -> tuple[Claim, ...]:
    return (
        Claim(
            "energy",
            "Proposition 5",
            "The ledger of H_s closes with the dissipation over ordered pairs.",
            general.ledger_residual,
            dynamic=False,
        ),
        Claim("momentum", "sec. 10", "The mean velocity is invariant.", general.momentum_drift),
        Claim("H_s-continuous", "sec. 5", "H_s does not jump where links switch.", general.energy_continuous),
        Claim("energy-falls", "Proposition 5", "H_s never rises.", general.energy_rise),
        Claim(
            "velocities-agree",
            "Proposition 5",
            "All velocities become the same.",
            general.velocities_agree,
            settles_as_flock,
        ),
        Claim(
            "distances-settle",
            "Proposition 5",
            "All distances become constant.",
            general.distances_settle,
            settles_as_flock,
        ),
    )


def _stated(scenario: str) -> Sequence[Claim]:
    found: dict[str, Callable[[], tuple[Claim, ...]]] = {
        KEY: _obstacle_claims,
        SINK: _sink_claims,
        FREE: _free_claims,
        SMOOTH: _smooth_claims,
    }
    return found[scenario]()


claims = claims_by_name(scenarios, _stated, grounds)
"""Claims about a scenario by its name, see `claims_by_name`."""
