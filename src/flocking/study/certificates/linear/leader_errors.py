"""The centre of mass of a group whose forces are opposite: steady drift, and how it follows a leader.

Forces between agents cancel in the sum. With gains per mass c1 = kappa m_i and c2 = gamma m_i, and a share g of the
leader's acceleration a0, the error e = X - x0 of the centre of mass X obeys, whatever the pairs do and however their
graph switches,

    e'' + gamma e' + kappa e = -(1 - g) a0.

Where the right side is zero, |e'|^2 + kappa |e|^2 never grows, and e is known in closed form. Where a0 is constant, e
tends to -(1 - g) a0/kappa, or e' to -(1 - g) a0/gamma without feedback of positions. Where it is a harmonic of one
frequency w (a0'' = -w^2 a0) of amplitudes A_k along the axes, e' tends to a harmonic of amplitudes
|1 - g| w A_k/sqrt((kappa - w^2)^2 + (gamma w)^2) (Shi, Wang, Chu 2009 for v0 = (sin t, cos t)).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np

from flocking.formula.identities import nothing_or_itself
from flocking.formula.intervals import Interval
from flocking.formula.safe_digits import nearest_text, rounded_up
from flocking.model.bodies.point_bodies import is_point_mass
from flocking.model.law import Scenario
from flocking.model.terms.body_terms import Compensate, Track
from flocking.model.terms.schedules import Schedule
from flocking.study.certificates.certificate import (
    Certificate,
    Hypothesis,
    decided,
    ideal_world,
    not_applicable,
    until_failed,
)
from flocking.study.certificates.pieces import leader_at, leader_jump
from flocking.study.certificates.sources import sources

if TYPE_CHECKING:
    import sympy

DRIFT = "steady_drift"
"""Key of the certificate of the centre of mass without a leader."""

KEYS = ("mean_leader_error", "mean_leader_error_at_end", "steady_leader_error")
"""Keys of the certificates of the centre of mass behind a leader."""

TIMES = ((1, 3), (7, 5), (23, 7))
"""Times, as fractions, at which formulas are compared: in no simple ratio, so that no period of a wave fits all."""

DIGITS, SAME = 40, 1e-25
"""Digits with which they are computed, and the relative difference that counts as rounding: 15 digits may be lost."""


@dataclass(frozen=True, eq=False)
class CentreOfMass:
    """A scenario as the motion of its centre of mass.

    Parameters
    ----------
    scenario
        The scenario.
    """

    scenario: Scenario

    @cached_property
    def hypotheses(self) -> tuple[Hypothesis, ...]:
        """What must hold for forces to cancel in the sum."""
        return until_failed(partial(ideal_world, self.scenario), self._bodies, self._opposite, self._body_terms)

    def _bodies(self) -> Hypothesis:
        body, law = self.scenario.agents, self.scenario.law
        free = not np.any(np.asarray(body.damping)) or any(type(t) is Compensate for t in law.body_terms)
        statement = "agents are point masses, undamped or compensated"
        return Hypothesis(statement, bool(is_point_mass(body) and free), type(body).__name__)

    def _opposite(self) -> Hypothesis:
        law, start = self.scenario.law, self.scenario.start
        statement = "forces of every pair are equal and opposite"
        for term in law.pair_terms:
            if "momentum" not in term.symmetries:
                return Hypothesis(statement, False, f"not those of {type(term).__name__}")
        if any(g.directed or g.sees_headings for g in law.graphs):
            return Hypothesis(statement, False, "links are directed")
        if any(np.ndim(g.break_radius) or np.ndim(g.appear_radius) for g in law.graphs):
            return Hypothesis(statement, False, "radii differ between agents")
        links = start.links
        fits = links is None or np.array_equal(links, np.asarray(links).T)
        return Hypothesis(statement, fits, "so" if fits else "links of the start are directed")

    def _body_terms(self) -> Hypothesis:
        terms = [t for t in self.scenario.law.body_terms if type(t) is not Compensate]
        names = ", ".join(type(t).__name__ for t in terms)
        fits = not terms or (len(terms) == 1 and type(terms[0]) is Track)
        return Hypothesis(
            "agents follow one leader at most, and nothing else acts on single agents", fits, names or "so"
        )

    @property
    def track(self) -> Track | None:
        """The pursuit of the leader."""
        return next((t for t in self.scenario.law.body_terms if type(t) is Track), None)

    def even(self) -> Hypothesis:
        """Whether all agents follow alike, in proportion to their masses."""
        track, masses = self.track, np.asarray(self.scenario.agents.masses, dtype=np.float64)
        assert track is not None
        statement = "all agents follow the leader with the same gains per mass, linearly and all the time"
        gains = (track.position_gain, track.velocity_gain, track.acceleration_gain)
        if any(isinstance(x, Schedule) for x in gains):
            return Hypothesis(statement, False, "gains change in time")
        if track.saturated:
            return Hypothesis(statement, False, "the feedback is saturated")
        if any(np.ptp(np.asarray(x)) for x in gains):
            return Hypothesis(statement, False, "gains differ between agents")
        if np.ptp(masses) and not track.per_mass:
            return Hypothesis(statement, False, "masses differ, and gains are not per mass")
        start = self.scenario.start.t
        found = leader_jump(track.leader, start, self.scenario.t_end)
        return Hypothesis(statement, not found, found or "so")

    def _gain(self, value: object) -> Interval:
        gain = Interval.of(float(np.max(np.asarray(value))))
        assert self.track is not None
        if self.track.per_mass:
            return gain
        return gain / Interval.of(float(np.max(np.asarray(self.scenario.agents.masses))))

    @property
    def kappa(self) -> Interval:
        """Feedback of positions, per mass."""
        assert self.track is not None
        return self._gain(self.track.position_gain)

    @property
    def gamma(self) -> Interval:
        """Feedback of velocities, per mass."""
        assert self.track is not None
        return self._gain(self.track.velocity_gain)

    @property
    def missing(self) -> Interval:
        """1 - g, what agents do not know of the leader's acceleration."""
        assert self.track is not None
        return Interval.of(1.0) - Interval.of(float(np.max(np.asarray(self.track.acceleration_gain))))

    def mean(self, values: np.ndarray) -> Interval:
        """Average of values, shape (N, m), weighted by masses; shape (m,)."""
        masses = np.broadcast_to(np.asarray(self.scenario.agents.masses, dtype=np.float64), len(values))
        weights = Interval.of(masses)
        parts = [(weights * Interval.of(column)).total() / weights.total() for column in np.asarray(values).T]
        return Interval(np.array([float(x.lo) for x in parts]), np.array([float(x.hi) for x in parts]))

    def error(self, which: int) -> Interval:
        """Error of the centre of mass at the start, shape (m,).

        Parameters
        ----------
        which
            0 for that of the position, 1 for that of the velocity.
        """
        start, track = self.scenario.start, self.track
        assert track is not None
        return self.mean(start.q if which == 0 else start.p) - leader_at(track.leader, start.t)[which]

    @cached_property
    def accelerations(self) -> tuple[sympy.Expr, ...]:
        """Accelerations of the leader, as formulas of t."""
        import sympy

        assert self.track is not None
        leader, t = self.track.leader, sympy.Symbol("t", real=True)
        numbers = {name: sympy.Rational(value) for name, value in leader.parameters.items()}
        found = [sympy.sympify(a) for a in leader.acceleration(t, lambda name: numbers[name])]
        # As rational numbers, since rounded ones would not cancel.
        exact = (a.xreplace({x: sympy.Rational(x) for x in a.atoms(sympy.Float)}) for a in found)
        return tuple(sympy.simplify(a) if _seems_constant(a, t) else nothing_or_itself(a) for a in exact)

    @property
    def unforced(self) -> bool:
        """Whether the right side of the equation is zero."""
        return bool(self.missing.lo == 0.0 == self.missing.hi) or all(a == 0 for a in self.accelerations)


def _length(vector: Interval) -> Interval:
    square = vector.power(2).total()
    return Interval(np.maximum(square.lo, 0.0), square.hi).sqrt()


def leader_error_certificates(scenario: Scenario) -> tuple[Certificate, ...]:
    """Guarantees about the centre of mass: its steady drift, or its error behind a leader.

    Parameters
    ----------
    scenario
        The scenario.
    """
    system, source = CentreOfMass(scenario), sources()["centre"]
    hypotheses = system.hypotheses
    if not all(h.holds for h in hypotheses):
        return not_applicable((DRIFT, *KEYS), source, hypotheses)
    if system.track is None:
        drift = _length(system.mean(scenario.start.p))
        return decided(
            DRIFT, source, hypotheses, bound=drift, quantity="speed of the centre of mass",
            statement=f"The centre of mass moves on steadily, with {_speed_text(drift)}.",
        ), *not_applicable(KEYS, source, (Hypothesis("there is a leader", False, "none"),))  # fmt: skip
    led = not_applicable((DRIFT,), source, (Hypothesis("no agent follows a leader", False, "Track"),))
    hypotheses = (*hypotheses, system.even())
    if not hypotheses[-1].holds:
        return *led, *(decided(key, source, hypotheses) for key in KEYS)
    return *led, _largest(system, hypotheses), _at_end(system, hypotheses), _steady(system, hypotheses)


def _largest(system: CentreOfMass, hypotheses: tuple[Hypothesis, ...]) -> Certificate:
    quantity = "speed of the centre of mass relative to the leader"
    reason = "" if system.unforced else "the leader accelerates and agents do not know it in full"
    square = system.error(1).power(2).total() + system.kappa * system.error(0).power(2).total()
    bound = Interval(np.maximum(square.lo, 0.0), square.hi).sqrt()
    return decided(
        KEYS[0], sources()["centre"], hypotheses, reason=reason, bound=bound, quantity=quantity,
        statement=f"The {quantity} is never above {rounded_up(bound.hi)}.",
    )  # fmt: skip


def _at_end(system: CentreOfMass, hypotheses: tuple[Hypothesis, ...]) -> Certificate:
    scenario, quantity = system.scenario, "speed of the centre of mass relative to the leader at the end of the run"
    reason = "" if system.unforced else "the leader accelerates and agents do not know it in full"
    bound = None if reason else _speed_after(system, Interval.of(scenario.t_end) - Interval.of(scenario.start.t))
    if bound is None and not reason:
        reason = "it is undecided whether the error oscillates"
    statement = "" if bound is None else f"The {quantity} is {rounded_up(bound.hi)} at most."
    return decided(
        KEYS[1], sources()["centre"], hypotheses, reason=reason, bound=bound, quantity=quantity, statement=statement
    )


def _speed_after(system: CentreOfMass, time: Interval) -> Interval | None:
    """|e'| after a time without a leader's acceleration; None where the discriminant may be zero."""
    kappa, half, e, v = system.kappa, system.gamma * Interval.of(0.5), system.error(0), system.error(1)
    if kappa.hi == 0.0:
        return _length(v) * (-(system.gamma * time)).exp()
    inner = half.power(2) - kappa
    if inner.lo <= 0.0 <= inner.hi:
        return None
    root = inner.absolute().sqrt()
    turned = root * time
    even, odd = (turned.cosh(), turned.sinh()) if inner.lo > 0.0 else (turned.cos(), turned.sin())
    now = v * (even - half / root * odd) - e * (kappa / root * odd)
    return _length(now) * (-(half * time)).exp()


def _speed_text(speed: Interval) -> str:
    """A speed in words: the number, where all that it may be are the same in as many digits as are written."""
    found = nearest_text(speed.hi)
    return f"the speed {found}" if nearest_text(speed.lo) == found else f"a speed of at most {rounded_up(speed.hi)}"


def _steady(system: CentreOfMass, hypotheses: tuple[Hypothesis, ...]) -> Certificate:
    """The error in the long run behind a leader of constant or harmonic acceleration."""
    import sympy

    source, kappa, gamma = sources()["centre"], system.kappa, system.gamma
    if not gamma.lo > 0.0:
        reason = "velocities are not fed back: the error does not settle"
        return decided(KEYS[2], source, hypotheses, reason=reason)
    if system.unforced:
        return decided(
            KEYS[2], source, hypotheses, bound=Interval.of(0.0), side="is", quantity="error in the long run",
            statement="The error of the velocity of the centre of mass tends to zero.",
        )  # fmt: skip
    t = sympy.Symbol("t", real=True)
    if all(a.is_number for a in system.accelerations):
        size = _length(_numbers(system.accelerations)) * system.missing.absolute()
        of_place = bool(kappa.lo > 0.0)
        bound = size / (kappa if of_place else gamma)
        quantity = f"error of the {'position' if of_place else 'velocity'} of the centre of mass in the long run"
        return decided(
            KEYS[2], source, hypotheses, bound=bound, side="is", quantity=quantity,
            statement=f"The {quantity} is {nearest_text(bound.hi)}.",
        )  # fmt: skip
    square = _squared_frequency(system.accelerations, t)
    if square is None:
        reason = "the leader's acceleration is neither constant nor a harmonic of one frequency"
        return decided(KEYS[2], source, hypotheses, reason=reason)
    # a0 = A cos(w t + phase) has a0^2 + (a0'/w)^2 = A^2.
    sizes = [sympy.simplify(a**2 + sympy.diff(a, t) ** 2 / square) for a in system.accelerations]
    if not all(s.is_number for s in sizes):
        return decided(KEYS[2], source, hypotheses, reason="the amplitude of the leader's acceleration is not found")
    total = _numbers(sizes).total()
    w2 = _numbers([square]).total()
    under = (kappa - w2).power(2) + gamma.power(2) * w2
    bound = (Interval(np.maximum(total.lo, 0.0), total.hi) * w2 / under).sqrt() * system.missing.absolute()
    quantity = "amplitude of the error of the velocity of the centre of mass in the long run, all axes together"
    return decided(
        KEYS[2], source, hypotheses, bound=bound, side="is", quantity=quantity,
        statement=f"The {quantity}, is {nearest_text(bound.hi)}.",
    )  # fmt: skip


def _seems_constant(expression: sympy.Expr, t: sympy.Symbol) -> bool:
    """Whether a formula has one value at some times: only then is it simplified, which of others may take for ever."""
    import sympy

    if expression.has(sympy.Piecewise):
        return bool(expression.is_number)
    first, *others = (expression.xreplace({t: sympy.Rational(*time)}).evalf(DIGITS) for time in TIMES)
    known = all(x.is_comparable for x in (first, *others))
    return known and all(abs(x - first) <= SAME * abs(first) for x in others)


def _numbers(values: tuple[sympy.Expr, ...] | list[sympy.Expr]) -> Interval:
    """Enclosures of numbers, shape (K,)."""
    import sympy

    from flocking.formula.interval_values import enclosed

    dummy = sympy.Symbol("t", real=True)
    found = [enclosed(sympy.sympify(v), dummy, Interval.of(0.0)) for v in values]
    return Interval(np.array([float(x.lo) for x in found]), np.array([float(x.hi) for x in found]))


def _squared_frequency(accelerations: tuple[sympy.Expr, ...], t: sympy.Symbol) -> sympy.Expr | None:
    """The w^2 of a0'' = -w^2 a0; None where there is none."""
    import sympy

    found = None
    for a in accelerations:
        if a == 0:
            continue
        ratio = -sympy.diff(a, t, 2) / a
        ratio = sympy.simplify(ratio) if _seems_constant(ratio, t) else ratio
        if not ratio.is_number or not ratio.is_positive or (found is not None and sympy.simplify(ratio - found) != 0):
            return None
        found = ratio
    return found
