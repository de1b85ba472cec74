"""Claims about Algorithms 1, 2 and 3 with their grounds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from flocking.engine.reference.control import control
from flocking.model.bodies.point_bodies import is_point_mass
from flocking.model.graphs.smooth_graphs import Smooth
from flocking.model.leaders_and_obstacles.leaders import Sink, Velocity
from flocking.model.observables import flocks
from flocking.model.state import State
from flocking.model.terms.body_terms import Track
from flocking.model.terms.pair_terms import Consensus, Gradient
from flocking.model.terms.schedules import Schedule
from flocking.model.world.control import Held
from flocking.papers.grounds import OBSERVED, Ground, claims_by_name, proved, refuted
from flocking.papers.obstacle_passages import rejoins, splits
from flocking.papers.olfati_saber_2006 import system
from flocking.papers.olfati_saber_2006.closed_forms import (
    centre_motion,
    metrics,
    most_collisions,
    pair_potential,
    structural_energy,
)
from flocking.study.claims import general_claims as general
from flocking.study.claims.claim import Claim, Measure, Origin, Verdict, above, below
from flocking.study.claims.subjects import Subject, about
from flocking.study.evidence import Evidence, NotMeasurable, NotResolvable

FIRST, SECOND, THIRD = (f"on Algorithm {k}, as commonly cited" for k in (1, 2, 3))
APART = "on fragmentation, as commonly cited"
"""Where the article states a claim; its numbers are not used."""

NEAR = 0.01 * system.DISTANCE
"""Two agents that are closer count as merged."""

QUASI = 0.02
"""Largest deviation energy, by d^2, of what counts as a quasi alpha-lattice: deviations of about a seventh of d."""

ALIGNED = 0.01
"""Largest velocity mismatch by v^2, v the speed of the gamma-agent, of what counts as agreement: deviations of v/7."""

EXACT = 1e-4
"""Largest error of the centre, by the first distance from the goal, that counts as agreement with its closed form."""


JUDGED = 40
"""Updates of a run with held control that are computed again, spread over the run."""

AGREED = 1e-6
"""Relative difference of an update from the declared one that counts as rounding."""

ROUNDING_OF_TIMES = 1e-6
"""Largest difference of the times of frames from those of updates."""

ROUNDING = 1e-12
"""Relative difference of gains that counts as none."""


def _has_unit_masses(e: Evidence) -> bool:
    """Whether agents are undamped unit masses."""
    agents = e.run.scenario.agents
    unit = is_point_mass(agents) and np.all(np.asarray(agents.masses) == 1.0) and not np.any(np.asarray(agents.damping))
    return bool(unit)


def _need_algorithm_1(e: Evidence) -> None:
    """Refuse laws and agents whose energy is not the H of Algorithm 1 with the numbers of this package."""
    if not _has_unit_masses(e) or e.law != system.law(system.Algorithm(1)):
        raise NotMeasurable(
            "H is the energy of undamped unit masses under Algorithm 1 with the numbers of this package"
        )


def _need_distance(e: Evidence) -> None:
    """Refuse laws whose potential has its least value at another distance than d."""
    gradient = next((t for t in e.law.pair_terms if isinstance(t, Gradient)), None)
    slope = 0.0 if gradient is None else float(gradient.potential.slope(system.DISTANCE))
    if gradient is None or not abs(slope) <= ROUNDING * abs(float(gradient.potential.slope(system.RADIUS))):
        raise NotMeasurable(f"the law has no potential that is least at the distance {system.DISTANCE:g}")


def passive(e: Evidence) -> Measure:
    """That the forces of pairs are all that acts, and supply no energy."""
    if why := general.needs_momentum(e) or general.needs_ledger(e) or general.needs_passive(e):
        raise NotMeasurable(why)
    return Measure(np.inf, 0.0, "no energy is supplied", everywhere=False)


def led_alike(e: Evidence) -> Measure:
    """That free agents follow one gamma-agent of constant velocity alike, under a potential of the paper's form.

    Then H + J is bounded below, and falls at least at the rate c2 |p|^2 in the frame of the gamma-agent.
    """
    agents, law = e.run.scenario.agents, e.law
    if not is_point_mass(agents) or np.any(np.asarray(agents.damping)):
        raise NotMeasurable("agents are no undamped point masses")
    track = law.body_terms[0] if len(law.body_terms) == 1 else None
    if not isinstance(track, Track) or not isinstance(track.leader, Velocity | Sink):
        raise NotMeasurable("the law has not one pursuit of a gamma-agent of constant velocity as its only body term")
    gains = track.position_gain, track.velocity_gain
    alike = not any(isinstance(gain, Schedule) or np.ptp(gain) or not np.min(gain) > 0.0 for gain in gains)
    if track.shared or track.saturated or track.per_mass or not alike:
        raise NotMeasurable("the feedback is not linear with one positive gain for all agents")
    known = {type(term) for term in law.terms} <= {Gradient, Consensus, Track} and type(law.graph) is Smooth
    stated = system.potential().formula.text
    psi = [term for term in law.pair_terms if isinstance(term, Gradient)]
    same = all(term.potential.formula.text == stated and term.weighting == "force" for term in psi)
    opposite = all("momentum" in term.symmetries for term in law.pair_terms)
    if not known or not same or not opposite or len(law.graphs) > 1:
        raise NotMeasurable("the law is not that of Algorithm 2, with other numbers at most")
    return Measure(np.inf, 0.0, "one gamma-agent of constant velocity, followed alike", everywhere=False)


def too_little_energy(e: Evidence) -> Measure:
    """H(0) against psi_alpha(0), which one collision needs."""
    _need_algorithm_1(e)
    energy, needed = structural_energy(e.run.scenario.start), pair_potential(0.0)
    measured = below(energy, needed, f"H(0) = {energy:.4g}, a collision needs {needed:.4g}")
    return Measure(measured.margin, 0.0, measured.note, everywhere=False)


@about(Subject.CLOSEST, lasting=True)
def apart_by_energy(e: Evidence) -> Measure:
    """The closest approach against the distance whose potential is H(0)."""
    from scipy.optimize import brentq

    _need_algorithm_1(e)
    energy = structural_energy(e.run.scenario.start)
    if not energy < pair_potential(0.0):
        raise NotMeasurable("the energy suffices for a collision")
    norm = system.sigma_norm()
    start = float(norm(system.DISTANCE))
    least = norm.inverse(float(brentq(lambda z: pair_potential(z) - energy, 0.0, start, xtol=1e-12)))
    found = e.closest
    return above(found.distance, least, f"closest {found.distance:.4g}, H(0) allows {least:.4g}", e.error_of(found))


@about(Subject.CLOSEST, lasting=True)
def never_merge(e: Evidence) -> Measure:
    """The closest approach against a hundredth of d."""
    _need_distance(e)
    found = e.closest
    note = f"closest {found.distance:.3g} at t = {e.when(found.time, 3)} (agents {found.pair[0]}, {found.pair[1]})"
    return above(found.distance, NEAR, note, e.error_of(found))


@about(Subject.CLOSEST)
def few_collisions(e: Evidence) -> Measure:
    """Number of pairs that collide, 0 where all agents stay apart, against the k of the energy at the start."""
    _need_algorithm_1(e)
    most = most_collisions(structural_energy(e.run.scenario.start))
    found = e.closest
    if not found.distance > e.error_of(found):
        raise NotResolvable(f"two agents come within the error of each other, {found.distance:.3g}")
    return below(0.0, most + 0.5, f"no pair collides: closest {found.distance:.3g}, at most {most} pairs allowed")


@about(Subject.CONNECTIVITY, at_end=True)
def one_flock(e: Evidence) -> Measure:
    """Number of flocks at the end."""
    count = flocks(e.end_links)
    return Measure(1.5 - count, 0.0, f"{count} flocks at the end", everywhere=False)


@about(Subject.CONNECTIVITY, at_end=True)
def several_flocks(e: Evidence) -> Measure:
    """Number of flocks at the end, against one."""
    count = flocks(e.end_links)
    return Measure(count - 1.5, 0.0, f"{count} flocks at the end", everywhere=False)


@about(Subject.NET, at_end=True)
def quasi_lattice(e: Evidence) -> Measure:
    """Deviation energy at the end."""
    _need_distance(e)
    e.frame_links  # noqa: B018  raises where frames hold no links
    value = float(metrics(e.checked)["deviation energy"][-1])
    measured = below(value, QUASI, f"deviation energy {value:.2g} d^2 at the end")
    return Measure(measured.margin, 0.0, measured.note, everywhere=False)


@about(Subject.SPREAD, at_end=True)
def aligned_at_end(e: Evidence) -> Measure:
    """Velocity mismatch at the end, by the square of the speed of the gamma-agent."""
    if not len(e.t):
        raise NotMeasurable("the run keeps no frames")
    speed = max((float(np.linalg.norm(x.at(float(e.t[-1]))[1])) for x in e.law.leaders), default=0.0)
    if not speed > 0.0:
        raise NotMeasurable("there is no gamma-agent, or it is at rest")
    p = np.asarray(e.p[-1], dtype=np.float64)
    value = float(0.5 * ((p - p.mean(axis=0)) ** 2).sum() / len(p)) / speed**2
    measured = below(value, ALIGNED, f"velocity mismatch {value:.2g} v^2 at the end")
    return Measure(measured.margin, 0.0, measured.note, everywhere=False)


def _critical_pursuit(e: Evidence) -> tuple[Velocity, float]:
    """The leader and the c1 of a law whose centre moves as one agent, critically damped."""
    world, terms = e.run.scenario.imperfections, e.law.body_terms
    if world or len(terms) != 1 or type(terms[0]) is not Track:
        raise NotMeasurable(world or "the law has not one pursuit as its only body term")
    opposite = all("momentum" in t.symmetries for t in e.law.pair_terms)
    opposite = opposite and all("momentum" in g.symmetries for g in e.law.graphs)
    if not _has_unit_masses(e) or not opposite:
        raise NotMeasurable("forces of pairs do not cancel, or agents are no undamped unit masses")
    track = terms[0]
    gains = track.position_gain, track.velocity_gain
    if track.shared or track.saturated or track.per_mass or any(np.ndim(g) or isinstance(g, Schedule) for g in gains):
        raise NotMeasurable("the feedback is not linear with one gain for all agents")
    c1, c2 = (float(np.asarray(g)) for g in gains)
    if not c1 > 0.0 or abs(c2 - 2.0 * np.sqrt(c1)) > ROUNDING * c2:
        raise NotMeasurable("the feedback is not critically damped")
    if not isinstance(track.leader, Velocity):
        raise NotMeasurable("the gamma-agent does not move with constant velocity")
    return track.leader, c1


@about(Subject.LEADER, lasting=True)
def centre_as_predicted(e: Evidence) -> Measure:
    """The centre of mass at all frames against its closed form."""
    leader, gain = _critical_pursuit(e)
    start = e.run.scenario.start
    expected, _ = centre_motion(e.t, start, leader, gain)
    centre = np.asarray(e.q, np.float64).mean(axis=1)
    scale = max(float(np.linalg.norm(expected[0] - leader.at(start.t)[0])), system.DISTANCE)
    off = float(np.linalg.norm(centre - expected, axis=1).max()) / scale
    return below(off, EXACT, f"the centre differs from its closed form by at most {off:.1e} of {scale:.3g}")


@about(Subject.NET, lasting=True)
def moved_as_held(e: Evidence) -> Measure:
    """Largest difference of frames from the motion under the law's force at the frame before, held for the period."""
    control_, body = e.run.scenario.control, e.run.scenario.agents
    if not isinstance(control_, Held) or np.ndim(control_.period) or np.any(control_.phase) or np.any(control_.latency):
        raise NotMeasurable("control is not held for one time from the start on")
    if type(e.law.graph) is not Smooth or not is_point_mass(body):
        raise NotMeasurable("the net is not one of distances alone, or agents are no point masses")
    if np.any(np.asarray(body.masses) != 1.0) or np.any(np.asarray(body.damping)):
        raise NotMeasurable("agents are no undamped unit masses")
    period = float(control_.period)
    if len(e.t) < 2 or np.abs(np.diff(e.t) - period).max() > ROUNDING_OF_TIMES or e.t[0] != e.run.scenario.start.t:
        raise NotMeasurable("the frames are not those of every update")
    off, judged = 0.0, np.unique(np.linspace(0, len(e.t) - 2, JUDGED).astype(int))
    for k in judged:
        u = control(e.law, State(e.q[k], e.p[k], float(e.t[k])))
        q = e.q[k] + period * e.p[k] + 0.5 * period**2 * u
        scale = max(float(np.abs(period * u).max()), float(np.abs(e.p[k]).max()))
        off = max(off, float(np.abs(q - e.q[k + 1]).max()) / (period * scale))
        off = max(off, float(np.abs(e.p[k] + period * u - e.p[k + 1]).max()) / scale)
    return below(off, AGREED, f"{len(judged)} updates differ from those of the held force by at most {off:.1e} of it")


def grounds() -> Mapping[str, Ground]:
    """Grounds by the key of the claim."""
    return {
        "energy": proved("each pair force is the gradient of psi_alpha(|q_j - q_i|_sigma), opposite for i and j"),
        "momentum": proved("pair forces are opposite for i and j"),
        "falls": proved("dH/dt is minus the sum of a_ij |p_j - p_i|^2 over the links"),
        "velocities-agree": proved(
            "in the frame of the gamma-agent H + J falls at least at the rate c2 |p|^2 and is bounded below: LaSalle"
        ),
        "centre": proved("the forces of pairs cancel, and feedback is linear"),
        "no-collision": proved("H does not rise, and a pair at contact stores psi_alpha(0)"),
        "apart-by": proved("H does not rise, and every pair stores at least zero"),
        "collisions": proved("H does not rise, and k + 1 pairs at contact store (k + 1) psi_alpha(0)"),
        "never-merge": OBSERVED,
        "merge": refuted(lambda: system.scenarios()[system.PRESSED](0)),
        "one-flock": OBSERVED,
        "one-flock-behind": OBSERVED,
        "aligned-behind": OBSERVED,
        "lattice-behind": OBSERVED,
        "fragments": OBSERVED,
        "one-flock-alone": refuted(lambda: system.scenarios()[system.FRAGMENTS](0)),
        "lattice": OBSERVED,
        "held": proved("by the definition of the system"),
        "no-entry": OBSERVED,
        "entry": refuted(lambda: system.scenarios()[system.AGAINST](0)),
        "split": OBSERVED,
        "rejoin": OBSERVED,
    }


def _stated(name: str) -> Sequence[Claim]:
    own = Origin.OWN
    energy = Claim("energy", FIRST, "The declared forces explain the energy of the motion.",
                   general.ledger_residual, dynamic=False)  # fmt: skip
    if name in (system.FRAGMENTS, system.GENTLE):
        first = (
            energy,
            Claim(
                "momentum",
                "not stated",
                "The mean velocity is constant.",
                general.momentum_drift,
                general.opposite_forces,
                origin=own,
            ),
            Claim("falls", FIRST, "H never rises under Algorithm 1.", general.energy_rise, passive),
            Claim(
                "collisions",
                FIRST,
                "At most k pairs collide if H(0) < (k + 1) psi_alpha(0).",
                few_collisions,
            ),
        )
        if name == system.FRAGMENTS:
            return (
                *first,
                Claim("fragments", APART, "Under Algorithm 1 the agents end in several flocks.", several_flocks),
                Claim("one-flock-alone", APART, "Algorithm 1 gathers all agents in one flock.",
                      one_flock, expected=Verdict.FAILS, origin=own,
                      reason="Algorithm 1 holds neighbours together; groups that do not meet stay apart."),
            )  # fmt: skip
        return (
            *first,
            Claim("no-collision", FIRST, "No agents collide if H(0) < psi_alpha(0).", general.all_apart,
                  too_little_energy),
            Claim("apart-by", "not stated", "No agents come closer than H(0) allows.", apart_by_energy,
                  too_little_energy, origin=own),
        )  # fmt: skip
    if name == system.AGAINST:
        return (
            energy,
            Claim("entry", "not stated", "No agent enters an obstacle, wherever it is led.", general.outside_obstacles,
                  origin=own, expected=Verdict.FAILS,
                  reason="The force of an obstacle vanishes at its boundary, with n_ij, and points inwards behind it."),
        )  # fmt: skip
    if name in (system.SPLIT, system.SQUEEZE, system.FIRM, system.NETWORK, system.HELD):
        passage = (
            Claim("split", THIRD, "Obstacles split the flock.", splits),
            Claim("rejoin", THIRD, "The parts of the flock rejoin.", rejoins),
        )
        if name == system.HELD:
            words = "Forces are those of the law at the last update, and are held."
            held = Claim("held", "the simulator's program", words, moved_as_held, dynamic=False)
            return (energy, held, *passage)
        entry = Claim("no-entry", THIRD, "No agent enters an obstacle.", general.outside_obstacles)
        if name == system.NETWORK:
            return (energy, entry, *passage)
        return (
            energy, entry, *passage,
            Claim("one-flock-behind", THIRD, "All agents end in one flock behind the obstacles.", one_flock),
            Claim("aligned-behind", THIRD, "At the end all velocities are nearly the same.", aligned_at_end),
            Claim("lattice-behind", THIRD, "The agents end as quasi alpha-lattices.", quasi_lattice),
        )  # fmt: skip
    merging = (
        Claim("merge", "not stated", "No two agents merge, whatever the gains.", never_merge, origin=own,
              expected=Verdict.FAILS,
              reason="The potential is finite at contact: a strong enough pull of the goal presses agents together.")
        if name == system.PRESSED
        else Claim("never-merge", "not stated", "No two agents come closer than a hundredth of d.", never_merge,
                   origin=own)
    )  # fmt: skip
    found = (
        energy,
        Claim("velocities-agree", SECOND, "All velocities become the same.",
              general.velocities_agree, led_alike),
        Claim("centre", "not stated", "The centre follows the gamma-agent as a critically damped oscillator.",
              centre_as_predicted, origin=own),
        Claim("one-flock", SECOND, "All agents end in one flock.", one_flock),
        merging,
    )  # fmt: skip
    if name == system.PRESSED:
        return found
    return (
        *found,
        Claim("lattice", SECOND, "The flock ends as a quasi alpha-lattice.", quasi_lattice),
    )


claims = claims_by_name(system.scenarios, _stated, lambda _: grounds())
"""Claims about a scenario by its name, see `claims_by_name`."""
