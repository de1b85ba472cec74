"""Claims about Cucker and Smale's systems with their grounds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from flocking.formula.safe_digits import compared_texts
from flocking.model.bodies.body import MOVES_ON
from flocking.model.checks import NO_LESS
from flocking.model.observables import diameters
from flocking.model.state import State
from flocking.model.terms.alignment import CuckerSmale
from flocking.papers.cucker_smale_2007 import system
from flocking.papers.cucker_smale_2007.closed_forms import (
    discrete_step,
    final_distance,
    final_speed,
    pair_invariant,
)
from flocking.papers.cucker_smale_2007.hypotheses import (
    alignment,
    alignment_alone,
    discrete_system,
    exponent_of_one,
    held_together,
    late_neighbours,
    monotone_delay,
    short_steps,
    stable_delay,
    too_long_delay,
    weights_not_summable,
)
from flocking.papers.grounds import OBSERVED, Ground, claims_by_name, proved, refuted
from flocking.study.claims import general_claims as general
from flocking.study.claims.claim import Claim, Measure, Origin, Verdict, above, below
from flocking.study.claims.settling import limit_of_series
from flocking.study.claims.subjects import Subject, about
from flocking.study.evidence import Evidence, NotMeasurable, NotResolvable

CLOSE = 1e-6
"""Relative difference up to which a limit or an invariant counts as reached or kept."""

DOWN_TO = 1e-3
"""Share of the first difference of velocities down to which its decay is compared with the bound."""

SHARE = 3
"""The first and the last of so many parts of a run are compared."""


@about(Subject.NET, lasting=True)
def diameter_bounded(e: Evidence) -> Measure:
    """Largest distance of two agents against X, up to which the integral of the weights is D_v(0)."""
    bound = alignment(e.run.scenario).farthest
    assert bound is not None
    return general.at_most(e, "diameter", float(e.diameter.max()), float(bound.hi))


@about(Subject.SPREAD, lasting=True)
def differences_decay(e: Evidence) -> Measure:
    """D_v(t) against D_v(0) exp(-N phi(X) t), while that is above `DOWN_TO` of its first value."""
    found = alignment(e.run.scenario)
    assert found.farthest is not None
    rate = float(found.rate(float(found.farthest.hi)).lo)
    first = float(found.difference.hi)
    allowed = first * np.exp(-rate * (e.t - e.t[0]))
    # At the first frame both are equal.
    frames = 1 + np.flatnonzero(allowed[1:] > DOWN_TO * first)
    if not len(frames):
        raise NotResolvable("the run has no frame between the start and the end of the decay")
    differences = diameters(e.p)[frames]
    worst = int(np.argmin((allowed[frames] - differences) / allowed[frames]))
    frame = int(frames[worst])
    error = _difference_error(e, frame)
    largest, bound = compared_texts(differences[worst], allowed[frame])
    note = f"largest difference {largest} at t = {e.when(e.t[frame], 3)}, bound {bound}"
    return above(float(allowed[frame]), float(differences[worst]), note, error)


def _difference_error(e: Evidence, frame: int) -> float:
    """Error of a difference of two velocities at a frame; NaN where the run states none."""
    accuracy = e.run.accuracy
    if accuracy is not None and len(accuracy.frames):
        return 2.0 * float(accuracy.frames[frame, 1])
    return 2.0 * e.velocity_error * float(np.sqrt(e.p.shape[2])) if e.sampled else np.nan


def _line(e: Evidence) -> tuple[np.ndarray, np.ndarray]:
    """Distance and relative speed of two agents on a line, in the direction in which they stand at the start."""
    if e.run.n != 2 or e.q.shape[2] != 1:
        raise NotMeasurable("the run is not one of two agents on a line")
    side = np.sign(e.q[0, 0, 0] - e.q[0, 1, 0])
    return side * (e.q[:, 0, 0] - e.q[:, 1, 0]), side * (e.p[:, 0, 0] - e.p[:, 1, 0])


def _line_of_closed_forms(e: Evidence) -> tuple[np.ndarray, np.ndarray]:
    """What `_line` gives, of two agents with w' = -w/(1 + r^2), of which the closed forms are."""
    found, agents, terms = _line(e), e.run.scenario.agents, e.law.terms
    free = agents.order == MOVES_ON and not np.ptp(agents.masses) and not np.any(np.asarray(agents.damping))
    if len(terms) != 1 or not isinstance(terms[0], CuckerSmale) or not free or not e.run.scenario.space.is_open:
        raise NotMeasurable("the law is not one alignment of two free agents of one mass")
    graph = terms[0].over or e.law.graph
    if graph.moves or int(graph.initial(e.run.scenario.start.q).sum()) != e.run.n * (e.run.n - 1):
        raise NotMeasurable("the two agents are not linked at all times")
    rate = 2.0 * terms[0].gain / float(np.max(agents.masses))
    if rate != 1.0 or terms[0].exponent != 1.0 or terms[0].scale != 1.0:
        raise NotMeasurable("the relative velocity does not fall at the rate 1/(1 + r^2)")
    return found


@about(Subject.SPREAD, lasting=True)
def invariant_kept(e: Evidence) -> Measure:
    """W + arctan r at all frames against its first value."""
    values = pair_invariant(*_line_of_closed_forms(e))
    off = float(np.abs(values - values[0]).max())
    return below(off, CLOSE, f"w + arctan r changed by at most {off:.1e}")


@about(Subject.NET)
def distance_as_predicted(e: Evidence) -> Measure:
    """The last distance against tan(arctan r(0) + w(0))."""
    r, w = _line_of_closed_forms(e)
    limit = final_distance(float(r[0]), float(w[0]))
    if not np.isfinite(limit):
        raise NotMeasurable("the two agents part for ever")
    off = np.abs(r - limit) / limit
    return limit_of_series(e, e.t, off, CLOSE, lambda x: f"distance {r[-1]:.9g}, predicted {limit:.9g}: off by {x:.1e}")


def _parting_speed(r: np.ndarray, w: np.ndarray) -> float:
    """The limit of the relative speed of two agents that are too fast for each other."""
    limit = final_speed(float(r[0]), float(w[0]))
    if not limit > 0.0:
        raise NotMeasurable("the weights suffice to hold the two agents together")
    return limit


@about(Subject.SPREAD)
def speed_as_predicted(e: Evidence) -> Measure:
    """The last relative speed against w(0) - (pi/2 - arctan r(0)); it falls to it as 1/r."""
    r, w = _line_of_closed_forms(e)
    limit = _parting_speed(r, w)
    # Beyond r the weights can still take pi/2 - arctan r.
    still = np.pi / 2 - np.arctan(r[-1])
    off = abs(w[-1] - limit - still)
    note = f"relative speed {w[-1]:.9g}, of which {still:.3g} is still to be lost; predicted limit {limit:.9g}"
    return below(float(off), CLOSE, note)


@about(Subject.NET)
def parts_for_ever(e: Evidence) -> Measure:
    """The least relative speed against the predicted limit, which is positive."""
    r, w = _line_of_closed_forms(e)
    limit = _parting_speed(r, w)
    least = float(w.min())
    return above(least, 0.5 * limit, f"least relative speed {least:.6g}, predicted limit {limit:.6g}")


@about(Subject.SPREAD, lasting=True)
def keeps_its_sign(e: Evidence) -> Measure:
    """The least relative velocity, by the first: positive where it never turns."""
    _, w = _line(e)
    if w[0] == 0.0:
        raise NotMeasurable("the two agents do not move relative to each other at the start")
    least = float((w / w[0]).min())
    rounding = 1e-9
    return above(least, -rounding, f"least relative velocity {least:.3g} of the first", rounding * 1e-3)


@about(Subject.SPREAD)
def differences_shrink(e: Evidence) -> Measure:
    """Largest difference of velocities in the last third of the run, by that in the first third."""
    differences, times = diameters(e.p), e.t - e.t[0]
    if not times[-1] > 0.0 or not differences[times <= times[-1] / SHARE].max() > 0.0:
        raise NotMeasurable("no velocities differ in the first third of the run")
    part = times[-1] / SHARE
    first, last = differences[times <= part].max(), differences[times >= times[-1] - part].max()
    return below(float(last / first), 1.0, f"largest difference {last:.3g} in the last third, {first:.3g} in the first")


@about(Subject.SPREAD, lasting=True)
def steps_as_stated(e: Evidence) -> Measure:
    """Largest difference of a frame from the step of the system from the frame before, by the largest velocity."""
    term, step = discrete_system(e)
    if len(e.t) < 2 or np.abs(np.diff(e.t) - step).max() > CLOSE * step or e.t[0] != e.run.scenario.start.t:
        raise NotMeasurable("the frames are not those of every step")
    e.need_few()
    worst, size = 0.0, max(float(e.speeds.max()), NO_LESS)
    for k in range(len(e.t) - 1):
        after = discrete_step(State(e.q[k], e.p[k]), step, term.gain, term.exponent, term.scale)
        off = max(float(np.abs(after.p - e.p[k + 1]).max()), float(np.abs(after.q - e.q[k + 1]).max()) / step)
        worst = max(worst, off)
    rounding = 1e-12 * float(np.abs(e.q).max()) / (step * size)
    return below(worst / size, CLOSE * 1e-3 + rounding, f"steps differ by at most {worst / size:.1e} of the speed")


def grounds() -> Mapping[str, Ground]:
    """Grounds by the key of the claim."""
    diameters = (
        "D_x' <= D_v and D_v' <= -N phi(D_x) D_v, by projection on the two velocities that are farthest apart; "
        "so D_v + N (integral of phi up to D_x) does not grow (as Ha, Liu 2009)"
    )
    line = "w' = -K psi(r) r' on a line, so that w + K (integral of psi) is constant"
    return {
        "energy": proved("the weights of a pair are equal both ways: the kinetic energy falls by their sum"),
        "momentum": proved("the weights of a pair are equal both ways"),
        "velocities-agree": proved(f"{diameters}; the integral is infinite below beta = 1/2"),
        "velocities-agree-critical": proved(f"{diameters}; the integral is infinite at beta = 1/2 too"),
        "agree-if-held": proved(diameters),
        "diameter-bound": proved(diameters),
        "exponential": proved(diameters),
        "all-apart": OBSERVED,
        "discrete-rule": proved("by the definition of the system"),
        "agree-discrete": proved(
            "I - h L is stochastic with entries of at least a = h phi(D_x) off the diagonal and b = 1 - h sum > 0 on "
            "it: D_v falls by the factor 1 - (N - 2) a - 2 min(a, b) (Dobrushin 1956), and the sum of a over the steps "
            "is infinite for beta <= 1/2"
        ),
        "invariant": proved(line),
        "final-distance": proved(line),
        "final-speed": proved(line),
        "parting": proved(line),
        "agree-always": refuted(lambda: system.scenarios()[system.PARTING](0)),
        "agree-late-neighbours": proved(
            "for beta <= 1/2 and every delay of the neighbours (Rodriguez Cartabia 2020, arXiv 2008.09530)"
        ),
        "agree-late": proved(
            "roots of s + lambda exp(-s tau) have negative real parts if and only if lambda tau < pi/2"
        ),
        "shrink-too-late": refuted(lambda: system.scenarios()[system.UNSTABLE](0)),
        "shrink": proved("roots of s + lambda exp(-s tau) have negative real parts if and only if lambda tau < pi/2"),
        "monotone": proved("the characteristic equation has a real root if and only if lambda tau <= 1/e"),
        "monotone-late": refuted(lambda: system.scenarios()[system.REACTION](0)),
    }


def _stated(name: str) -> Sequence[Claim]:
    own, cited = Origin.OWN, "as commonly cited"
    if name == system.DELAYED:
        return (
            Claim("agree-late-neighbours", "Rodriguez Cartabia 2020",
                  "With neighbours known late and beta <= 1/2 all velocities become the same, whatever the delay.",
                  general.velocities_agree, late_neighbours, origin=own),
        )  # fmt: skip
    if name == system.DISCRETE:
        return (
            Claim("discrete-rule", f"the system, {cited}",
                  "Every step is x + h v and v + h sum a_ij (v_j - v_i), both with the values before it.",
                  steps_as_stated, dynamic=False),
            Claim("agree-discrete", f"main theorem, {cited}",
                  "In discrete time too all velocities become the same for beta <= 1/2, if h times the sum of the "
                  "weights of an agent is below 1.", general.velocities_agree, short_steps),
        )  # fmt: skip
    if name in (system.REACTION, system.MONOTONE, system.UNSTABLE):
        return _late(name, own)
    if name in (system.PAIR, system.PARTING):
        return _of_two(name, own)
    if name == system.KEY:
        agree = Claim("velocities-agree", f"main theorem, {cited}", "For beta < 1/2 all velocities become the same.",
                      general.velocities_agree, weights_not_summable)  # fmt: skip
    elif name == system.CRITICAL:
        agree = Claim("velocities-agree-critical", "Ha, Liu 2009",
                      "For beta = 1/2 too all velocities become the same, whatever the start.",
                      general.velocities_agree, weights_not_summable, origin=own)  # fmt: skip
    else:
        agree = Claim("agree-if-held", "Ha, Liu 2009",
                      "If D_v(0) is below the integral of the weights from D_x(0) on, all velocities become the same.",
                      general.velocities_agree, held_together, origin=own)  # fmt: skip
    return (
        Claim("energy", f"the system, {cited}",
              "The kinetic energy falls by the sum of weights times squared differences.",
              general.ledger_residual, alignment_alone, dynamic=False),
        Claim("momentum", "not stated", "The common velocity is the mean of the initial ones.", general.momentum_drift,
              general.opposite_forces, origin=own),
        agree,
        Claim("diameter-bound", "Ha, Liu 2009", "No two agents are farther apart than the X up to which the integral "
              "of the weights from D_x(0) on is D_v(0).", diameter_bounded, held_together, origin=own),
        Claim("exponential", "Ha, Liu 2009", "The largest difference of velocities falls at least as "
              "exp(-N phi(X) t), down to a thousandth of the first.", differences_decay, held_together, origin=own),
        Claim("all-apart", "not stated", "No two agents collide.", general.all_apart, origin=own),
    )  # fmt: skip


claims = claims_by_name(system.scenarios, _stated, lambda _: grounds())
"""Claims about a scenario by its name, see `claims_by_name`."""


def _of_two(name: str, own: Origin) -> Sequence[Claim]:
    invariant = Claim("invariant", "not stated", "w + arctan r is constant while two agents on a line move apart.",
                      invariant_kept, origin=own)  # fmt: skip
    if name == system.PAIR:
        return (
            invariant,
            Claim("final-distance", "not stated", "Their distance tends to tan(arctan r(0) + w(0)).",
                  distance_as_predicted, held_together, origin=own),
        )  # fmt: skip
    return (
        invariant,
        Claim("final-speed", "not stated", "Their relative speed tends to w(0) - (pi/2 - arctan r(0)).",
              speed_as_predicted, origin=own),
        Claim("parting", "not stated", "They part for ever if w(0) exceeds the integral of the weights.",
              parts_for_ever, origin=own),
        Claim("agree-always", "not stated", "All velocities become the same from every start for beta = 1.",
              general.velocities_agree, exponent_of_one, origin=own, expected=Verdict.FAILS,
              reason="For beta > 1/2 the weights are summable, and a start that is fast enough escapes."),
    )  # fmt: skip


def _late(name: str, own: Origin) -> Sequence[Claim]:
    stable = Claim("agree-late", "Haskovec, Markou 2020",
                   "With constant weights, all states known late, velocities agree for lambda tau < pi/2.",
                   general.velocities_agree, stable_delay, origin=own)  # fmt: skip
    unstable = Claim("shrink-too-late", "Haskovec, Markou 2020",
                     "Differences of velocities shrink also for lambda tau > pi/2.", differences_shrink,
                     too_long_delay, origin=own, expected=Verdict.FAILS,
                     reason="Two roots of the characteristic equation have positive real parts.")  # fmt: skip
    shrinking = Claim("shrink", "Haskovec, Markou 2020", "Differences of velocities shrink for lambda tau < pi/2.",
                      differences_shrink, stable_delay, origin=own)  # fmt: skip
    monotone = Claim("monotone", "Haskovec, Markou 2020",
                     "For lambda tau <= 1/e the relative velocity never turns.", keeps_its_sign, monotone_delay,
                     origin=own)  # fmt: skip
    turning = Claim("monotone-late", "Haskovec, Markou 2020", "The relative velocity never turns, whatever the delay.",
                    keeps_its_sign, origin=own, expected=Verdict.FAILS,
                    reason="For lambda tau > 1/e no real root exists, and every solution oscillates.")  # fmt: skip
    return {
        system.REACTION: (stable, shrinking, turning),
        system.MONOTONE: (stable, monotone),
        system.UNSTABLE: (unstable,),
    }[name]
