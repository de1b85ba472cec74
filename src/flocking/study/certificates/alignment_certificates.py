"""Guarantees of velocity alignment of all pairs with weights that decrease with the distance.

With v_i' = sum over j of phi(|x_j - x_i|) (v_j - v_i) over all pairs, phi not increasing, the diameters of positions
and velocities satisfy D_x' <= D_v and D_v' <= -N phi(D_x) D_v: project onto the difference of the two velocities that
are farthest apart; every agent's contribution is at most -phi(D_x) D_v. Hence D_v + (N times the integral of phi from
D_x(0) to D_x) does not grow.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from flocking.arrays import Array
from flocking.formula.intervals import Interval
from flocking.formula.safe_digits import nearest_text, rounded_down, rounded_up
from flocking.model.bodies.point_bodies import is_point_mass
from flocking.model.law import Scenario
from flocking.model.observables import diameters
from flocking.model.terms.alignment import CuckerSmale
from flocking.model.terms.pair_terms import Consensus
from flocking.study.certificates.certificate import (
    Certificate,
    Hypothesis,
    decided,
    ideal_world,
    not_applicable,
    until_failed,
)
from flocking.study.certificates.power_law_integral import PowerLaw
from flocking.study.certificates.sources import sources

TINY = 1e-300
"""Absolute tolerance of a root: so small that the relative one decides."""

ROOT_ERROR = 4e-15
"""Relative tolerance of a root; SciPy allows none below four units of 2.2e-16. The bound is proven at the root that is
found."""

LARGEST_GROUP = 5000
"""Agents up to which all pairs are looked at: 12.5 million distances, 100 MB."""

KEYS = ("velocity_difference", "alignment_diameter", "alignment_rate")

FARTHEST = 1e150
"""Largest diameter that is looked for: its square, 1e300, does not overflow."""

REFINED, TRIES = 1e-12, 24
"""First relative distance of the ends of the bound of the diameter from its estimate, and how often it is tried with
four times as much."""


@dataclass(frozen=True, eq=False)
class Alignment:
    """A scenario as velocity alignment of all pairs.

    Parameters
    ----------
    scenario
        The scenario.
    """

    scenario: Scenario

    @cached_property
    def hypotheses(self) -> tuple[Hypothesis, ...]:
        """What must hold, in the order of the checks; later ones assume earlier ones."""
        return until_failed(partial(ideal_world, self.scenario), self._bodies, self._terms, self._all_pairs)

    @property
    def holds(self) -> bool:
        """Whether all hypotheses hold."""
        return all(h.holds for h in self.hypotheses)

    def _bodies(self) -> Hypothesis:
        body = self.scenario.agents
        alike = is_point_mass(body) and np.ptp(np.asarray(body.masses)) == 0.0 and not np.any(np.asarray(body.damping))
        return Hypothesis("agents are point masses of one mass, undamped", bool(alike), type(body).__name__)

    def _terms(self) -> Hypothesis:
        law, statement = self.scenario.law, "the law aligns velocities, with one weight of the distance for all pairs"
        strange = [type(t).__name__ for t in law.terms if type(t) not in (CuckerSmale, Consensus)]
        if strange:
            return Hypothesis(statement, False, f"the law has {', '.join(strange)}")
        for term in law.pair_terms:
            if isinstance(term, Consensus) and (
                np.ndim(term.gain) or term.weights is not None or term.functional or term.weighted
            ):
                return Hypothesis(statement, False, "weights of Consensus differ")
        return Hypothesis(statement, True, "so")

    def _all_pairs(self) -> Hypothesis:
        start, statement = self.scenario.start, "two agents or more, and all pairs are linked at all times"
        if start.n < 2:
            return Hypothesis(statement, False, "one agent")
        if start.n > LARGEST_GROUP:
            return Hypothesis(f"at most {LARGEST_GROUP} agents, whose pairs are all looked at", False, f"{start.n}")
        for graph in self.scenario.law.graphs:
            if graph.moves:
                return Hypothesis(statement, False, f"links by {type(graph).__name__} break")
            links = graph.initial(start.q)
            if graph is self.scenario.law.graph and start.links is not None:
                links = np.asarray(start.links, dtype=bool)
            if int(np.count_nonzero(links)) != start.n * (start.n - 1):
                return Hypothesis(statement, False, f"{type(graph).__name__} lacks a pair")
        return Hypothesis(statement, True, "so")

    @cached_property
    def weights(self) -> tuple[PowerLaw, ...]:
        """The weights, whose sum is phi times the mass; a constant one has the exponent 0."""
        found = []
        for term in self.scenario.law.pair_terms:
            if isinstance(term, CuckerSmale):
                found.append(PowerLaw(term.gain, term.exponent, term.scale))
            elif isinstance(term, Consensus):
                found.append(PowerLaw(float(np.max(term.gain)), 0.0, 1.0))
        return tuple(found)

    @cached_property
    def factor(self) -> Interval:
        """N over the mass."""
        return Interval.of(float(self.scenario.start.n)) / Interval.of(float(np.max(self.scenario.agents.masses)))

    @cached_property
    def spread(self) -> Interval:
        """D_x at the start."""
        return diameter(self.scenario.start.q)

    @cached_property
    def difference(self) -> Interval:
        """D_v at the start."""
        return diameter(self.scenario.start.p)

    @property
    def unconditional(self) -> bool:
        """Whether every start is held together, since the weights are not summable."""
        return any(not w.summable for w in self.weights)

    def integral(self, begin: Interval, end: float) -> Interval:
        """N times the integral of phi from ``begin`` to ``end``."""
        total = Interval.of(0.0)
        for weight in self.weights:
            total = total + weight.integral(begin, Interval.of(end))
        return self.factor * total

    @cached_property
    def available(self) -> float:
        """An upper bound of N times the integral of phi from D_x(0) to infinity."""
        total = Interval.of(0.0)
        for weight in self.weights:
            total = total + Interval.of(weight.beyond(float(self.spread.lo)))
        return float((self.factor * total).hi)

    @cached_property
    def farthest(self) -> Interval | None:
        """The X at which N times the integral of phi from D_x(0) on is D_v(0), enclosed; None if none is known."""
        start = float(self.spread.hi)
        if float(self.difference.hi) == 0.0:
            return self.spread

        start, difference = float(self.spread.hi), self.difference
        if self.available <= difference.lo:
            return None
        guess = self._estimated(start, float(difference.hi))
        if guess is None:
            return None
        for k in range(TRIES):
            high = start + (guess - start) * (1.0 + REFINED * 4.0**k) + start * REFINED * 4.0**k
            if self.integral(self.spread, high).lo >= difference.hi:
                break
        else:
            return None
        for k in range(TRIES):
            low = start + (guess - start) * max(1.0 - REFINED * 4.0**k, 0.0)
            if self.integral(self.spread, low).hi <= difference.lo:
                break
        return Interval.of(max(low, float(self.spread.lo)), high)

    def _estimated(self, start: float, needed: float) -> float | None:
        """The distance up to which N times the integral of phi is about ``needed``."""
        from scipy.optimize import brentq

        factor = float(self.factor.hi)

        def missing(end: float) -> float:
            return factor * sum(w.estimate(start, end) for w in self.weights) - needed

        step = max(start, min(w.scale for w in self.weights))
        end = start + step
        while missing(end) < 0.0:
            step *= 4.0
            end = start + step
            if end > FARTHEST:
                return None
        return float(brentq(missing, start, end, xtol=TINY, rtol=ROOT_ERROR))

    def rate(self, distance: float) -> Interval:
        """N phi at a distance."""
        total = Interval.of(0.0)
        for weight in self.weights:
            total = total + weight.at(Interval.of(distance))
        return self.factor * total


def diameter(points: Array) -> Interval:
    """The largest distance of two points, shape (N, m), enclosed.

    Parameters
    ----------
    points
        The points.
    """
    if not np.ptp(points, axis=0).any():
        return Interval.of(0.0)
    # Rounding of differences, squares, sums and the root stays below this many units in the last place.
    units = 4.0 + points.shape[1]
    found = float(diameters(points[None])[0])
    slack = units * float(np.spacing(np.abs(points).max(initial=0.0) + found))
    return Interval.of(max(found - slack, 0.0), found + slack)


def alignment_certificates(scenario: Scenario) -> tuple[Certificate, ...]:
    """All guarantees of a scenario whose law aligns the velocities of all pairs.

    Parameters
    ----------
    scenario
        The scenario.
    """
    setting = Alignment(scenario)
    source = sources()["alignment"]
    if not setting.holds:
        return not_applicable(KEYS, source, setting.hypotheses)
    difference, place = "largest difference of two velocities", "largest distance of two agents"
    quantity = "rate of decay of the largest difference of two velocities, on average up to any time"
    now = setting.difference
    found = [decided(
        "velocity_difference", source, setting.hypotheses, bound=now, quantity=difference,
        statement=f"No two velocities ever differ by more than {rounded_up(now.hi)}.",
    )]  # fmt: skip
    far = setting.farthest
    reason = ""
    if far is None:
        reason = (
            f"velocities differ by up to {nearest_text(now.lo)}, and the weights beyond the largest distance suffice "
            f"for no difference above {rounded_up(setting.available)}"
        )
        if setting.available > now.lo:
            reason = f"the bound of the largest distance lies beyond {FARTHEST:g}" + (
                ", though velocities agree from every start" if setting.unconditional else ""
            )
    certain = "from every start" if setting.unconditional else "from this start"
    found.append(decided(
        "alignment_diameter", source, setting.hypotheses, reason=reason, bound=far, quantity=place,
        statement="" if far is None else (
            f"No two agents are ever farther apart than {rounded_up(far.hi)}; the group stays together {certain}."
        ),
    ))  # fmt: skip
    rate = None
    if far is not None:
        slow, fast = setting.rate(float(far.hi)), setting.rate(float(far.lo))
        rate = Interval.of(float(slow.lo), float(fast.hi))
    return (*found, decided(
        "alignment_rate", source, setting.hypotheses, reason=reason, bound=rate, side="at least", quantity=quantity,
        statement="" if rate is None else (
            f"All velocities become the same: their largest difference is at most its first value times "
            f"exp(-{rounded_down(rate.lo)} t)."
        ),
    ))  # fmt: skip
