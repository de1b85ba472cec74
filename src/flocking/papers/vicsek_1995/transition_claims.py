"""Measures of the transition on one run: whether it passes between two phases, bands, and numbers in boxes."""

from __future__ import annotations

import numpy as np

from flocking.model.checks import Array
from flocking.model.observables import order_of
from flocking.model.space import Periodic
from flocking.papers.vicsek_1995.closed_forms import ENOUGH, binder_cumulant
from flocking.papers.vicsek_1995.density_waves import waves_of
from flocking.papers.vicsek_1995.transition import HIGH, LOW, SETTLING, counted
from flocking.study.claims.claim import Measure, above, below
from flocking.study.claims.subjects import Subject, about
from flocking.study.evidence import Evidence, NotMeasurable

DISORDER = 1.0 / 3.0
"""Cumulant of the order parameter of very many independent headings; with N of them it is 1/(3 N) larger."""

SHARE = 0.01
"""Share of the frames for which a run is in a phase at least, to count as one that takes it."""

DIP = 0.1
"""Distance below it that counts as a dip: the standard error of the cumulant of n independent values in disorder is
2/(3 sqrt(n)), a third of this for 400 of them."""

WAVE = 0.1
"""Least share of its largest possible strength, the number of agents, that the strongest wave of bands has: that of a
density 1 + 0.63 cos(x); the strongest of forty waves of a thousand independent places has 0.004."""

ACROSS = 0.9
"""Least mean |cos| of the angle between mean velocity and normal of the fronts, of bands that move across them."""

BOXES = (1.0, 2.0, 3.0, 4.0, 6.0, 8.0)
"""Sides of the boxes in which agents are counted: of 2 to 128 agents at the density 2."""

PUBLISHED, APART = 0.8, 0.1
"""Exponent of the fluctuations in ordered groups (Chate et al. 2008), and the difference from it allowed here."""


def _late(e: Evidence) -> slice:
    """Frames after the motion has settled."""
    first = int(np.searchsorted(e.t, e.t[0] + SETTLING * (e.t[-1] - e.t[0]))) if len(e.t) else 0
    if len(e.t) - first < ENOUGH:
        raise NotMeasurable("the run has too few frames")
    return slice(first, None)


def _order(e: Evidence) -> Array:
    p = e.p[_late(e)]
    if not np.any(p, axis=2).all():
        raise NotMeasurable("agents are at rest")
    return np.array([order_of(each) for each in p])


def _side(e: Evidence) -> float:
    space = e.run.scenario.space
    if not isinstance(space, Periodic) or len(space.lengths) != 2 or space.lengths[0] != space.lengths[1]:
        raise NotMeasurable("the space is no square torus")
    return float(space.lengths[0])


@about(Subject.SPREAD)
def one_phase(e: Evidence) -> Measure:
    """Cumulant of v_a at the frames, against that of disorder, below which it falls where two phases take turns."""
    found = binder_cumulant(_order(e))
    return above(found, DISORDER, f"cumulant of v_a {found:.3f}, that of disorder 0.333")


@about(Subject.SPREAD)
def cumulant_dips(e: Evidence) -> Measure:
    """Cumulant of v_a at the frames, against that of disorder less `DIP`."""
    found = binder_cumulant(_order(e))
    return below(found, DISORDER - DIP, f"cumulant of v_a {found:.3f}, that of disorder 0.333")


@about(Subject.SPREAD)
def two_phases(e: Evidence) -> Measure:
    """Smaller one of the shares of the frames at which v_a is below `LOW` and above `HIGH`, against `SHARE`."""
    order = _order(e)
    low, high = float((order < LOW).mean()), float((order > HIGH).mean())
    note = f"v_a is below {LOW} at {low:.1%} of the frames, and above {HIGH} at {high:.1%}"
    return above(min(low, high), SHARE, note)


def _waves(e: Evidence) -> tuple[float, float]:
    """Mean strength of the strongest wave over the settled frames; mean |cos| of its normal and the mean velocity."""
    side, late = _side(e), _late(e)
    space, rows = e.run.scenario.space, []
    for q, p in zip(np.asarray(e.q[late]), np.asarray(e.p[late]), strict=True):
        speeds = np.linalg.norm(p, axis=1, keepdims=True)
        if not (speeds > 0.0).all():
            raise NotMeasurable("agents are at rest")
        rows.append(waves_of(space.wrapped(q), p / speeds, side)[1:3])
    strength, across = np.mean(rows, axis=0)
    return float(strength), float(across)


@about(Subject.SPREAD)
def bands(e: Evidence) -> Measure:
    """Mean strength of the strongest wave of the density by its largest possible value, against `WAVE`."""
    share = _waves(e)[0] / e.run.n
    return above(share, WAVE, f"the strongest wave of the density has {share:.3g} of the largest possible strength")


@about(Subject.SPREAD)
def bands_move_across(e: Evidence) -> Measure:
    """Mean |cos| of the angle between the mean velocity and the normal of the fronts, against `ACROSS`."""
    _, across = _waves(e)
    return above(across, ACROSS, f"|cos| between the mean velocity and the normal of the fronts is {across:.3f}")


def fluctuation_exponent(e: Evidence) -> float:
    """Exponent of the standard deviation of the number in a box in its mean, by least squares of logarithms.

    Parameters
    ----------
    e
        Evidence of a run on a square torus.
    """
    side, late = _side(e), _late(e)
    space, sizes = e.run.scenario.space, [x for x in BOXES if side >= 2.0 * x]
    if len(sizes) < ENOUGH:
        raise NotMeasurable("the torus has no room for boxes of several sizes")
    rows = [counted(space.wrapped(np.asarray(q)), side, sizes) for q in e.q[late]]
    mean, square = np.mean(rows, axis=0).T
    deviation = np.sqrt(square - mean**2)
    if not (deviation > 0.0).all():
        raise NotMeasurable("numbers in boxes do not vary")
    return float(np.polyfit(np.log(mean), np.log(deviation), 1)[0])


@about(Subject.SPREAD)
def giant_fluctuations(e: Evidence) -> Measure:
    """The exponent of fluctuations of numbers in boxes, against the published one."""
    found = fluctuation_exponent(e)
    return below(abs(found - PUBLISHED), APART, f"numbers in boxes deviate as N^{found:.3f}, independent ones as N^0.5")
