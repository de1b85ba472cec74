"""Claims of Shi, Wang, Chu with their grounds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from flocking.model.checks import Array
from flocking.papers.grounds import claims_by_name
from flocking.papers.shi_2009.closed_forms import centre_motion, steady_velocity_error
from flocking.papers.shi_2009.grounds import grounds
from flocking.papers.shi_2009.system import SETTINGS, VELOCITY_GAIN, scenarios
from flocking.study.claims import general_claims as general
from flocking.study.claims.claim import Claim, Measure, Origin, Verdict, below
from flocking.study.claims.conclusions.frames import with_frame
from flocking.study.claims.conclusions.leaders import one_gain, tracking
from flocking.study.claims.settling import limit_of_series
from flocking.study.claims.subjects import Subject, about, about_of
from flocking.study.evidence import Evidence, NotMeasurable

SAME_LEADER = 1e-9
"""Largest difference of a leader from the paper's; computed positions and velocities of both are of order 1."""

CENTRE = 1e4
"""Tolerances, of the largest coordinate, by which the centre of mass may differ from its closed form."""

LAST = 2 * np.pi
"""Period of v0(t) = (sin t, cos t); steady errors are taken over the last one."""


def leader_velocity(e: Evidence) -> Array:
    """v0 at the frames, shape (F, m)."""
    return tracking(e).leader.along(e.t)[1]


def _over_period(e: Evidence, values: Array) -> Array:
    """Largest value over the period that ends at each frame, shape (F,); shorter intervals in the first period."""
    first = np.searchsorted(e.t, e.t - LAST * (1 + 1e-12))
    return np.array([values[a : k + 1].max() for k, a in enumerate(first)])


def _periodic(e: Evidence, found: Measure) -> Measure:
    """Compare two successive periods to distinguish a steady state from the approach to it."""
    if e.t[-1] - e.t[0] >= 2 * LAST:
        return found
    return replace(found, unsettled=f"the run is shorter than two periods of the leader, {LAST:.3g} each")


@about(Subject.LEADER)
def tracks_leader(e: Evidence) -> Measure:
    """Largest |v^i - v0| over the last period against its largest value."""
    return _fades(e, np.linalg.norm(e.p - leader_velocity(e)[:, None], axis=2).max(axis=1), "v0")


def tracks_turning_leader(law: int) -> Callable[[Evidence], Measure]:
    """Builder: largest |v^i - v0| over the last period against the error that the centre of mass keeps by (13) or (16).

    That of the paper's leader: others, of constant velocity for example, are tracked without a0 too. Large gains make
    the error small beside that of the start, never zero.
    """

    @about(Subject.LEADER)
    def conclusion(e: Evidence) -> Measure:
        steady = steady_velocity_error(law, *_feedback(e))
        return _fades(e, np.linalg.norm(e.p - leader_velocity(e)[:, None], axis=2).max(axis=1), "v0", steady)

    return conclusion


@about(Subject.SPREAD)
def velocities_agree(e: Evidence) -> Measure:
    """Largest |v^i - v*| over the last period against its largest value."""
    return _fades(e, e.velocity_spread, "v*")


def _fades(e: Evidence, error: Array, goal: str, scale: float = 0.0) -> Measure:
    most = scale or float(error.max()) or 1.0
    found = limit_of_series(
        e, e.t, _over_period(e, error) / most, general.SETTLED,
        lambda ratio: f"|v_i - {goal}| is {ratio * most:.1e} over the last period",
    )  # fmt: skip
    return with_frame(e, _periodic(e, found))


def _feedback(e: Evidence) -> tuple[float, float]:
    """h0 and r0 of the run's law; its leader must be that of the closed forms, v0 = (sin t, cos t) and x0(0) = 0."""
    track = tracking(e)
    h0, r0 = one_gain(track, "velocity_gain"), one_gain(track, "position_gain")
    place, velocity, _ = track.leader.along(e.t)
    of_paper = _same(velocity, np.sin(e.t), np.cos(e.t))
    if not of_paper or (r0 and not _same(place, 1.0 - np.cos(e.t), np.sin(e.t))):
        raise NotMeasurable("the closed form is of a leader with v0 = (sin t, cos t) and x0(0) = 0")
    return h0, r0


def _same(seen: Array, *components: Array) -> bool:
    known = np.stack(components, axis=1)
    return seen.shape == known.shape and bool(np.abs(seen - known).max() <= SAME_LEADER)


def centre_follows(law: int) -> Callable[[Evidence], Measure]:
    """Builder: the centre of mass against its closed form under law (8), (12) or (15), with the gains of the run."""

    @about(Subject.LEADER)
    def conclusion(e: Evidence) -> Measure:
        t = e.t
        h0, r0 = _feedback(e)
        w = e.masses / e.masses.sum()
        place = np.einsum("i,fik->fk", w, e.q)
        expected_place, expected_velocity = centre_motion(
            law, t, place[0], e.mean_velocity[0], h0, r0, start_time=float(t[0])
        )
        gap = max(float(np.abs(place - expected_place).max()), float(np.abs(e.mean_velocity - expected_velocity).max()))
        # The closed forms are of the paper's leader, whose speed is the unit of velocities.
        size = max(float(np.abs(leader_velocity(e)).max()), float(np.abs(place).max()))
        allowed = CENTRE * e.run.scenario.tolerance * size
        return below(gap, allowed, f"centre of mass within {gap:.1e} of the closed form")

    return conclusion


def steady_error(law: int) -> Callable[[Evidence], Measure]:
    """Builder: steady |v* - v0| against its closed form under law (12) or (15), with the gains of the run."""

    @about(Subject.LEADER)
    def conclusion(e: Evidence) -> Measure:
        expected = steady_velocity_error(law, *_feedback(e))
        error = np.linalg.norm(e.mean_velocity - leader_velocity(e), axis=1)
        gaps = _over_period(e, np.abs(error - expected))
        mean = float(error[e.t >= e.t[-1] - LAST].mean())
        found = limit_of_series(
            e, e.t, gaps, 1e-3 * expected, lambda _: f"|v* - v0| = {mean:.6f}, closed form {expected:.6f}"
        )
        return _periodic(e, found)

    return conclusion


def connected_throughout(e: Evidence) -> Measure:
    """The paper's general assumption: the graph is connected at all times."""
    return general.stays_connected(e)


def fell_apart(e: Evidence) -> Measure:
    """The condition of Fig. 6 and 11: the graph is not always connected."""
    return general.stays_connected(e).opposite


def _stated(scenario: str) -> Sequence[Claim]:
    setting = SETTINGS[scenario]
    connected = connected_throughout if setting.connected else fell_apart
    found = [
        Claim(
            "energy",
            "(6)-(7), (11)",
            "The ledger of J closes in the paper's moving frame.",
            general.ledger_residual,
            dynamic=False,
        ),
        Claim("J-continuous", "(3)", "J does not jump where links switch.", general.energy_continuous),
        Claim("apart", "Theorems 1, 2, 4, 5", "No two agents collide.", general.all_apart),
    ]
    if setting.acceleration == "some":
        found += [
            Claim(
                "no-flocking",
                "Remark 6",
                "With a0 known to some agents only, velocities do not agree.",
                _negated(velocities_agree),
                connected,
            ),
            Claim(
                "no-tracking",
                "Remark 6",
                "With a0 known to some agents only, v0 is not tracked.",
                _negated(tracks_leader),
                connected,
            ),
        ]
        return tuple(found)
    falls = Claim("J-falls", "Theorems 2, 5", "J never rises.", general.energy_rise)
    stationary = Claim("stationary", "Theorems 1-5", "The limit is stationary.", general.forces_vanish, connected)
    minimal = Claim(
        "minimal",
        "Theorems 1-5",
        "The limit minimises every agent's potential.",
        general.agents_at_their_minimum,
        connected,
        expected=Verdict.FAILS,
        reason="Stationary only: the cosine well is 2 deep and links pull against each other.",
    )
    found += [falls]
    if setting.connected and setting.law != 15:
        found += [stationary, minimal]
    if setting.acceleration == "all":
        source = "Theorems 1, 2" if setting.connected else "Remark 1"
        found.append(Claim("tracks", source, "All velocities approach v0(t).", tracks_leader, connected))
    if setting.law in (12, 15):
        found += [
            Claim(
                "agree",
                "Theorems 4, 5",
                "All velocities approach that of the centre of mass.",
                velocities_agree,
                connected,
            ),
            Claim("no-tracking", "sec. 3.2", "v0 is not tracked.", _negated(tracks_turning_leader(setting.law))),
            Claim(
                "steady-error",
                "from (13)" if setting.law == 12 else "from (16)",
                "The centre of mass keeps the closed form's distance from v0.",
                steady_error(setting.law),
                origin=Origin.OWN,
            ),
        ]
    if setting.law in (8, 12, 15):
        source = {8: "(9), Theorem 3", 12: "(13)", 15: "(16)"}[setting.law]
        found.append(
            Claim("centre", source, "The centre of mass moves by the closed form.", centre_follows(setting.law))
        )
    return tuple(found)


claims = claims_by_name(scenarios, _stated, grounds)
"""Claims about a scenario by its name, see `claims_by_name`."""


def _negated(conclusion: Callable[[Evidence], Measure]) -> Callable[[Evidence], Measure]:
    @about(about_of(conclusion).subject)
    def opposite(e: Evidence) -> Measure:
        return conclusion(e).opposite

    return opposite


__all__ = ["VELOCITY_GAIN", "claims"]
