"""Claims about the system of Vicsek et al. with their grounds.

The authors prove nothing. What is judged of every run is its rule, update by update, from the frames alone, so that a
motion from another program can be judged as well: between two updates there is nothing to know. Bounds of random
quantities are wider than exact inequalities allow a run of this law to miss with a probability above `FALSE_ALARM`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np

from flocking.model.bodies.discrete_bodies import Heading
from flocking.model.checks import Array
from flocking.model.world.control import Held
from flocking.papers.grounds import OBSERVED, Ground, claims_by_name, proved
from flocking.papers.vicsek_1995 import system
from flocking.papers.vicsek_1995 import transition_claims as transition
from flocking.papers.vicsek_1995.closed_forms import deviations, random_order
from flocking.study.claims import general_claims as general
from flocking.study.claims.claim import Claim, Measure, Origin, above, below
from flocking.study.claims.subjects import Subject, about
from flocking.study.evidence import Evidence, NotMeasurable

FALSE_ALARM = 1e-9
"""Largest probability with which a run of the law misses the bound of a random quantity."""

ROUNDING = 1e-9
"""Relative rounding of velocities and places, and of angles in radians."""

LAST_HALF = 2
"""The order parameter is averaged over the last one of so many parts of a run."""

HALF_ORDER = 0.5
"""Mean order parameter above which a run is called ordered."""

CLOCK = 1e-6
"""Share of the time between two updates by which times of frames may be off."""


def _body(e: Evidence) -> Heading:
    body = e.run.scenario.agents
    if not isinstance(body, Heading):
        raise NotMeasurable("agents have no heading that is set at updates")
    return body


def _speeds(e: Evidence) -> Array:
    return np.broadcast_to(np.asarray(_body(e).speed, dtype=np.float64), e.run.n)


def _of_every_update(e: Evidence) -> None:
    """Refuse runs whose frames are not those of every update of all agents."""
    control = e.run.scenario.control
    if not isinstance(control, Held) or np.ndim(control.period) or np.any(control.phase):
        raise NotMeasurable("agents do not update together from the start on")
    period = float(control.period)
    if len(e.t) < 2 or np.abs(np.diff(e.t) - period).max() > CLOCK * period or e.t[0] != e.run.scenario.start.t:
        raise NotMeasurable("the frames are not those of every update")


def _sets_the_average(e: Evidence) -> None:
    """Refuse agents that do not turn into the mean direction of their neighbours.

    They turn into w = p + (T/m) u, the average velocity where T is m in units of the paper's step; of different speeds
    its direction is not that of the mean heading.
    """
    body, control = _body(e), e.run.scenario.control
    if e.law != system.law() or not isinstance(control, Held):
        raise NotMeasurable("the law is not that of the paper")
    share = np.asarray(control.period) / (system.STEP * np.asarray(body.masses))
    if np.any(np.abs(share - 1.0) > ROUNDING):
        raise NotMeasurable("with this mass and time between updates headings are not set to the average")
    if np.ptp(_speeds(e)):
        raise NotMeasurable("agents have different speeds")


@lru_cache(maxsize=8)
def _deviations(e: Evidence) -> Array:
    """Angles between the headings after each update and the mean directions before it, shape (F - 1, N)."""
    _of_every_update(e)
    body, graph = _body(e), e.law.graph
    if body.noise_kind != "angular" or body.update != "backward":
        raise NotMeasurable("the noise is not that of angles, or the update not that of the paper")
    _sets_the_average(e)
    if e.q.shape[2] != 2:
        raise NotMeasurable("headings are angles in the plane alone")
    e.need_few()
    space, radius = e.run.scenario.space, float(np.max(np.asarray(graph.break_radius)))
    return np.array([deviations(e.q[k], e.p[k], e.p[k + 1], space, radius) for k in range(len(e.t) - 1)])


@about(Subject.SPREAD, lasting=True)
def speeds_kept(e: Evidence) -> Measure:
    """Largest relative difference of a speed from that of the body."""
    speed = _speeds(e)
    off = float(np.abs(np.linalg.norm(e.p, axis=2) / speed - 1.0).max())
    return below(off, ROUNDING, f"speeds differ from v by at most {off:.1e} of it")


@about(Subject.NET, lasting=True)
def moved_as_they_headed(e: Evidence) -> Measure:
    """Largest difference of a displacement from one update to the next from the velocity before it."""
    _of_every_update(e)
    if _body(e).update != "backward":
        raise NotMeasurable("the update is not that of the paper")
    period = float(np.asarray(e.run.scenario.control.period))  # type: ignore[attr-defined]
    step = e.q[1:] - e.q[:-1] - period * e.p[:-1]
    length = period * float(_speeds(e).max()) + ROUNDING * float(np.abs(e.q).max())
    off = float(np.linalg.norm(step, axis=2).max()) / length
    return below(off, 1e-6, f"displacements differ from the old velocity by at most {off:.1e} of it")


@about(Subject.SPREAD, lasting=True)
def turns_within_noise(e: Evidence) -> Measure:
    """Largest angle between a heading and the mean direction before, against half the width of the noise."""
    found = np.abs(_deviations(e))
    half = 0.5 * np.broadcast_to(np.asarray(_body(e).noise, dtype=np.float64), e.run.n)
    if (half >= np.pi).any():
        raise NotMeasurable("the noise reaches all angles")
    excess = float((found - half).max())
    return below(excess, ROUNDING * 10.0, f"headings differ from the mean direction by at most {found.max():.4g}")


@about(Subject.SPREAD)
def turns_are_even(e: Evidence) -> Measure:
    """Largest difference of the distribution of these angles from the even one, against what draws allow.

    Of n independent draws it exceeds sqrt(log(2/a)/(2 n)) with a probability of at most a (Massart 1990).
    """
    noise = np.broadcast_to(np.asarray(_body(e).noise, dtype=np.float64), e.run.n)
    if not (noise > 0.0).all() or (noise > 2.0 * np.pi).any():
        raise NotMeasurable("some headings are not drawn evenly, or from more than a turn")
    shares = np.sort((_deviations(e) / noise + 0.5).ravel())
    count = len(shares)
    ranks = np.arange(count + 1) / count
    far = max(float(np.abs(ranks[1:] - shares).max()), float(np.abs(ranks[:-1] - shares).max()))
    bound = float(np.sqrt(np.log(2.0 / FALSE_ALARM) / (2.0 * count)))
    return below(far, bound, f"distribution of {count} angles differs from the even one by {far:.2g}, draws allow "
                             f"{bound:.2g}")  # fmt: skip


@about(Subject.SPREAD)
def headings_independent(e: Evidence) -> Measure:
    """Mean of N v_a^2 over the updates, against 1, for noise that reaches every angle evenly.

    Its values are independent, between 0 and N, of mean 1 and variance 1 - 1/N: Bernstein's inequality.
    """
    noise = np.asarray(_body(e).noise, dtype=np.float64)
    if not np.all(noise == 2.0 * np.pi) or _body(e).noise_kind != "angular":
        raise NotMeasurable("headings are not drawn evenly from all angles")
    _of_every_update(e)
    if np.ptp(_speeds(e)):
        raise NotMeasurable("agents have different speeds")
    n, order = e.run.n, _order(e)[1:]
    mean = float(n * (order**2).mean())
    _, _, variance = random_order(n)
    spread, log = n**2 * variance, float(np.log(2.0 / FALSE_ALARM))
    # The positive root of M x^2 = 2 log (spread + N x/3).
    b = log * n / (3.0 * len(order))
    bound = b + float(np.sqrt(b**2 + 2.0 * log * spread / len(order)))
    return below(abs(mean - 1.0), bound, f"mean of N v_a^2 is {mean:.4g} over {len(order)} updates, draws allow 1 "
                                         f"within {bound:.2g}")  # fmt: skip


def within_a_half_plane(e: Evidence) -> Measure:
    """Whether all headings at the start lie within less than half a turn, and there is no noise: by how much."""
    if np.any(np.asarray(_body(e).noise)):
        return Measure(-1.0, 0.0, "there is noise", everywhere=False)
    if e.p.shape[2] != 2:
        raise NotMeasurable("headings are angles in the plane alone")
    _sets_the_average(e)
    width = _width(e.p[0])
    note = f"headings lie within {width:.4g} at the start"
    return Measure(np.pi - width, ROUNDING, note, everywhere=False)


def _width(p: Array) -> float:
    """Width of the narrowest sector that holds all headings."""
    angles = np.sort(np.arctan2(p[:, 1], p[:, 0]))
    gaps = np.diff(np.append(angles, angles[0] + 2.0 * np.pi))
    return float(2.0 * np.pi - gaps.max())


@about(Subject.SPREAD, lasting=True)
def sector_never_widens(e: Evidence) -> Measure:
    """Largest growth, from one frame to the next, of the narrowest sector that holds all headings."""
    if len(e.t) < 2:
        raise NotMeasurable("the run has one frame")
    widths = np.array([_width(p) for p in e.p])
    growth = float(np.diff(widths).max())
    return below(growth, 10.0 * ROUNDING, f"the sector grew by at most {growth:.1e}, from {widths[0]:.4g} to "
                                          f"{widths[-1]:.4g}")  # fmt: skip


def _order(e: Evidence) -> Array:
    """Order parameter at every frame."""
    lengths = np.linalg.norm(e.p, axis=2).sum(axis=1)
    if not (lengths > 0.0).all():
        raise NotMeasurable("agents are at rest")
    return np.asarray(np.linalg.norm(e.p.sum(axis=1), axis=1) / lengths)


@about(Subject.SPREAD, at_end=True)
def ordered(e: Evidence) -> Measure:
    """Mean of v_a over the last half of the run, against one half."""
    series = _order(e)
    late = float(series[len(series) // LAST_HALF :].mean())
    return above(late, HALF_ORDER, f"mean of v_a over the last half of the run is {late:.3g}")


def grounds() -> Mapping[str, Ground]:
    """Grounds by the key of the claim."""
    definition = "by the definition of the system"
    return {
        "speed": proved(definition),
        "old-velocity": proved(definition),
        "noise-within": proved(definition),
        "noise-even": proved(
            f"{definition}, with the inequality of Dvoretzky, Kiefer, Wolfowitz and Massart (1990): a false alarm has "
            "a probability below 1e-9"
        ),
        "independent": proved(
            "angles drawn evenly from a full turn do not depend on the neighbours; Bernstein's inequality: a false "
            "alarm has a probability below 1e-9"
        ),
        "sector": proved("a sum of vectors in a convex cone lies in that cone, and below half a turn sectors are such"),
        "velocities-agree": OBSERVED,
        **dict.fromkeys(
            ("ordered", "one-phase", "two-phases", "cumulant-dips", "bands", "bands-across", "giant-fluctuations"),
            OBSERVED,
        ),
    }


def _of_transition(name: str) -> Sequence[Claim]:
    """What is asked about the transition: at a size of the paper, and with vectorial noise in larger groups."""
    own, jump, later = Origin.OWN, "Gregoire, Chate 2004", "Chate et al. 2008"
    return {
        system.MIDDLE: (
            Claim("one-phase", "Fig. 2", "Half way down the curve the order parameter does not change between two "
                  "phases: its cumulant is above that of disorder.", transition.one_phase),
        ),
        system.PHASES: (
            Claim("two-phases", jump, "At the transition the group is disordered at times and ordered at others.",
                  transition.two_phases, origin=own),
            Claim("cumulant-dips", jump, "The cumulant of the order parameter is below 0.233, that of disorder less "
                  "0.1; that it is negative, as later work finds, is not asked of one run.", transition.cumulant_dips,
                  origin=own),
        ),
        system.BANDS: (
            Claim("bands", later, "Beside the transition the density of an ordered group is one wave.",
                  transition.bands, origin=own),
            Claim("bands-across", later, "Its fronts move along their normal.", transition.bands_move_across,
                  origin=own),
        ),
        system.FLUCTUATIONS: (
            Claim("giant-fluctuations", later, "In an ordered group numbers in boxes deviate as a power of their "
                  "mean, with an exponent within 0.1 of the published 0.8.", transition.giant_fluctuations, origin=own),
        ),
    }[name]  # fmt: skip


def _stated(name: str) -> Sequence[Claim]:
    own, rule = Origin.OWN, "the rule, as commonly cited"
    speed = Claim("speed", rule, "All speeds are v at all times.", speeds_kept, dynamic=False)
    if name in (system.MIDDLE, system.PHASES, system.BANDS, system.FLUCTUATIONS):
        return (speed, *_of_transition(name))
    if name == system.VECTORIAL:
        return (
            speed,
            Claim("ordered", "not stated", "Vectorial noise of 0.4 leaves an ordered motion.", ordered, origin=own),
        )
    old = Claim("old-velocity", rule, "From one update to the next an agent moves with the velocity before it.",
                moved_as_they_headed, dynamic=False)  # fmt: skip
    within = Claim("noise-within", rule, "No heading differs from the mean direction of the neighbours before the "
                   "update by more than eta/2.", turns_within_noise, dynamic=False)  # fmt: skip
    if name == system.NOISELESS:
        return (
            speed, old, within,
            Claim("sector", "not stated", "Without noise headings within less than half a turn stay in the sector that "
                  "holds them.", sector_never_widens, within_a_half_plane, origin=own, dynamic=False),
            Claim("velocities-agree", "not stated", "All headings become the same.", general.velocities_agree,
                  within_a_half_plane, origin=own),
        )  # fmt: skip
    even = Claim("noise-even", rule, "Angles between headings and mean directions are drawn evenly.", turns_are_even,
                 dynamic=False)  # fmt: skip
    if name == system.RANDOM:
        return (
            speed, old, even,
            Claim("independent", "not stated", "At eta = 2 pi headings are independent: N v_a^2 has the mean 1.",
                  headings_independent, origin=own, dynamic=False),
        )  # fmt: skip
    sentence = "The motion is ordered: v_a is above one half on average."
    return (speed, old, within, even, Claim("ordered", "Figs. 1 and 2", sentence, ordered))


claims = claims_by_name(system.scenarios, _stated, lambda _: grounds())
"""Claims about a scenario by its name, see `claims_by_name`."""
