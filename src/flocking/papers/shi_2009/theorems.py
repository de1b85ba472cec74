"""What Shi, Wang, Chu claim, and what is expected of each claim before any run."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from flocking.model.checks import Array
from flocking.papers.shi_2009.closed_forms import centre_motion, steady_velocity_error
from flocking.papers.shi_2009.system import KEY, SETTINGS, VELOCITY_GAIN
from flocking.study import general_claims as general
from flocking.study.claims import Claim, Measure, Verdict, below
from flocking.study.evidence import Evidence

LAST = 2 * np.pi
"""Steady errors are taken over the last period of v0(t) = (sin t, cos t)."""


def leader_velocity(e: Evidence) -> Array:
    """v0 at the frames, shape (F, m)."""
    leader = e.law.leaders[0]
    return np.array([leader.at(float(t))[1] for t in e.run.t])


def _last_period(e: Evidence) -> NDArray[np.bool_]:
    return np.asarray(e.run.t >= e.run.t[-1] - LAST)


def tracks_leader(e: Evidence) -> Measure:
    """Largest |v^i - v0| over the last period against its largest value ever."""
    error = np.linalg.norm(e.run.p - leader_velocity(e)[:, None], axis=2).max(axis=1)
    late = float(error[_last_period(e)].max())
    return below(late / float(error.max()), general.SETTLED, f"|v_i - v0| is {late:.1e} over the last period")


def velocities_agree(e: Evidence) -> Measure:
    """Largest |v^i - v*| over the last period against its largest value ever."""
    most = float(e.velocity_spread.max())
    late = float(e.velocity_spread[_last_period(e)].max())
    return below(late / most, general.SETTLED, f"|v_i - v*| is {late:.1e} over the last period")


def centre_follows(law: int) -> Callable[[Evidence], Measure]:
    """Builder: the centre of mass against its closed form under law (8), (12) or (15)."""

    def conclusion(e: Evidence) -> Measure:
        t = e.run.t
        w = e.masses / e.masses.sum()
        place = np.einsum("i,fik->fk", w, e.run.q)
        expected_place, expected_velocity = centre_motion(law, t, place[0], e.mean_velocity[0])
        gap = max(float(np.abs(place - expected_place).max()), float(np.abs(e.mean_velocity - expected_velocity).max()))
        allowed = 1e4 * e.run.scenario.tolerance * max(1.0, float(np.abs(place).max()))
        return below(gap, allowed, f"centre of mass within {gap:.1e} of the closed form")

    return conclusion


def steady_error(law: int) -> Callable[[Evidence], Measure]:
    """Builder: steady |v* - v0| against its closed form under law (12) or (15)."""

    def conclusion(e: Evidence) -> Measure:
        error = np.linalg.norm(e.mean_velocity - leader_velocity(e), axis=1)[_last_period(e)]
        expected = steady_velocity_error(law)
        gap = float(np.abs(error - expected).max())
        return below(gap, 1e-3 * expected, f"|v* - v0| = {float(error.mean()):.6f}, closed form {expected:.6f}")

    return conclusion


def kept_connected(e: Evidence) -> Measure:
    """The paper's standing assumption: the graph is connected at all times."""
    return general.stays_connected(e)


def fell_apart(e: Evidence) -> Measure:
    """The condition of Fig. 6 and 11: the graph is not always connected."""
    kept = general.stays_connected(e)
    return Measure(-kept.margin, 0.0, kept.note)


def claims(scenario: str = KEY) -> Sequence[Claim]:
    """Claims of the paper about one of its simulations.

    Parameters
    ----------
    scenario
        Name of the scenario; a row of Table 1.
    """
    setting = SETTINGS[scenario]
    connected = kept_connected if setting.connected else fell_apart
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
            Claim("no-tracking", "sec. 3.2", "v0 is not tracked.", _negated(tracks_leader)),
            Claim(
                "steady-error",
                "(13)" if setting.law == 12 else "(16)",
                "The centre of mass keeps the closed form's distance from v0.",
                steady_error(setting.law),
            ),
        ]
    if setting.law in (8, 12, 15):
        source = {8: "(9), Theorem 3", 12: "(13)", 15: "(16)"}[setting.law]
        found.append(
            Claim("centre", source, "The centre of mass moves by the closed form.", centre_follows(setting.law))
        )
    return tuple(found)


def _negated(conclusion: Callable[[Evidence], Measure]) -> Callable[[Evidence], Measure]:
    def opposite(e: Evidence) -> Measure:
        found = conclusion(e)
        return Measure(-found.margin, found.error, found.note)

    return opposite


__all__ = ["VELOCITY_GAIN", "claims"]
