"""Guarantees of linear consensus on a fixed graph: rates, and the delays and periods that it stands."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from flocking.formula.intervals import Interval
from flocking.formula.safe_digits import rounded_down, rounded_up
from flocking.model.bodies.point_bodies import is_point_mass, is_single_integrator
from flocking.model.graphs.all_pairs import Complete
from flocking.model.graphs.connectivity import is_connected
from flocking.model.graphs.distance_graphs import Fixed
from flocking.model.law import Scenario
from flocking.model.terms.pair_terms import Consensus, Gradient
from flocking.study.certificates.certificate import (
    Certificate,
    Hypothesis,
    decided,
    graph_in_words,
    not_applicable,
    until_failed,
)
from flocking.study.certificates.laplacian_spectrum import has_two_sides, laplacian_spectrum
from flocking.study.certificates.late.late_samples import NeighboursLate, period_of_all_late
from flocking.study.certificates.sources import sources

PI = Interval.of(np.nextafter(np.pi, 0.0), np.nextafter(np.pi, 4.0))
"""The number pi, enclosed."""

SETTLED = 50.0
"""Factor by which a disagreement has fallen when it counts as settled: to 2 %."""

LARGEST_GROUP = 1000
"""Agents up to which spectra of graphs are enclosed: all statements on a ring of 1,000 take some 15 seconds."""

MOST_SAMPLES = 4
"""Largest delay, in whole samples, that a period is stated for."""

TOGETHER = "with all agents acting at the same times and without latency"
"""What statements on a period of held control assume, in words."""

KEYS = (
    "decay_rate", "settling_time", "delay", "neighbour_delay", "control_period",
    *(f"control_period_delayed_{d}" for d in range(1, MOST_SAMPLES + 1)),
    *(f"neighbour_period_delayed_{d}" for d in range(1, MOST_SAMPLES + 1)), "noise_variance",
)  # fmt: skip
"""Keys of the certificates, in their order."""


@dataclass(frozen=True, eq=False)
class LinearConsensus:
    """A scenario as linear consensus: x' = -a L x, or x'' = -a L x - b L x'.

    Parameters
    ----------
    scenario
        The scenario.
    """

    scenario: Scenario

    @cached_property
    def hypotheses(self) -> tuple[Hypothesis, ...]:
        """What must hold, in the order of the checks; later ones assume earlier ones."""
        return until_failed(self.body_hypothesis, self._graph, self.term_hypothesis, self._connected)

    @property
    def holds(self) -> bool:
        """Whether all hypotheses hold."""
        return all(h.holds for h in self.hypotheses)

    def body_hypothesis(self) -> Hypothesis:
        """Whether the bodies are those of linear consensus."""
        body, statement = self.scenario.agents, "agents are single integrators, or point masses of one mass, undamped"
        if is_single_integrator(body):
            return Hypothesis(statement, True, "single integrators")
        alike = is_point_mass(body) and np.ptp(np.asarray(body.masses)) == 0.0 and not np.any(np.asarray(body.damping))
        return Hypothesis(statement, bool(alike), type(body).__name__ if not alike else "point masses")

    def _graph(self) -> Hypothesis:
        graph = self.scenario.law.graph
        fits = type(graph) in (Complete, Fixed) and not graph.directed and len(self.scenario.law.graphs) == 1
        fits = fits and self.scenario.space.is_open and self.scenario.start.n > 1
        statement = "two agents or more have a fixed, undirected graph in open space"
        return self.size_hypothesis(statement) if fits else Hypothesis(statement, False, graph_in_words(self.scenario))

    def size_hypothesis(self, statement: str) -> Hypothesis:
        """Whether the spectrum of the graph is that of a small enough matrix.

        Parameters
        ----------
        statement
            What else is known to hold of the graph, in words.
        """
        n, graph = self.scenario.start.n, self.scenario.law.graph
        if n > LARGEST_GROUP:
            return Hypothesis(f"at most {LARGEST_GROUP} agents, whose graph has its spectrum enclosed", False, f"{n}")
        return Hypothesis(statement, True, type(graph).__name__)

    def term_hypothesis(self) -> Hypothesis:
        """Whether the law is linear, and one of agreement."""
        statement = "the law is linear: potentials c r^2 and velocity consensus of one gain"
        law = self.scenario.law
        if law.body_terms:
            return Hypothesis(statement, False, f"the law has {type(law.body_terms[0]).__name__}")
        for term in law.pair_terms:
            name = type(term).__name__
            if type(term) is Gradient and _square_factor(term) is None:
                return Hypothesis(statement, False, f"{term.potential!r} is not c r^2")
            if type(term) is Consensus and (np.ndim(term.gain) or term.weights is not None or term.functional):
                return Hypothesis(statement, False, "weights of Consensus differ")
            if type(term) not in (Gradient, Consensus):
                return Hypothesis(statement, False, f"the law has {name}")
        first = self.order == 1
        if first and any(type(t) is Consensus for t in law.pair_terms):
            return Hypothesis(statement, False, "velocity consensus of agents of order 1")
        if not first and not self.rate_gain.lo > 0.0:
            return Hypothesis(statement, False, "without velocity consensus nothing decays")
        if first and not self.place_gain.lo > 0.0:
            return Hypothesis(
                statement, False, f"the factor of r^2 is not positive: {rounded_down(self.place_gain.lo)}"
            )
        if self.place_gain.lo < 0.0:
            return Hypothesis(statement, False, "agents repel each other")
        return Hypothesis(statement, True, "so")

    def _connected(self) -> Hypothesis:
        return Hypothesis("the graph is connected", bool(is_connected(self._links)), "see its components")

    @property
    def _links(self) -> np.ndarray:
        start = self.scenario.start
        return np.asarray(start.links if start.links is not None else self.scenario.law.graph.initial(start.q))

    @property
    def order(self) -> int:
        """Order of the agents."""
        return self.scenario.agents.order

    @cached_property
    def _mass(self) -> Interval:
        return Interval.of(float(np.max(self.scenario.agents.masses)) if self.order == 2 else 1.0)

    @cached_property
    def place_gain(self) -> Interval:
        """The coefficient a of positions."""
        factors = [_square_factor(t) for t in self.scenario.law.pair_terms if type(t) is Gradient]
        total = Interval.of(0.0)
        for factor in factors:
            assert factor is not None
            total = total + factor * Interval.of(2.0)
        return total / self._mass

    @cached_property
    def rate_gain(self) -> Interval:
        """The coefficient b of velocities."""
        total = Interval.of(0.0)
        for term in self.scenario.law.pair_terms:
            if isinstance(term, Consensus):
                total = total + Interval.of(float(np.max(term.gain)))
        return total / self._mass

    @property
    def only_velocities(self) -> bool:
        """Whether velocities alone are agreed on: then they are as positions of agents of order 1."""
        return self.order == 2 and float(self.place_gain.hi) == 0.0

    @property
    def first_gain(self) -> Interval:
        """The coefficient of the agreement of first order that this is, where it is one."""
        return self.place_gain if self.order == 1 else self.rate_gain

    @property
    def is_first(self) -> bool:
        """Whether it is an agreement of first order."""
        return self.order == 1 or self.only_velocities

    @cached_property
    def modes(self) -> Interval:
        """The eigenvalues of the Laplacian but the smallest, shape (N - 1,)."""
        found = laplacian_spectrum(self._links)
        return Interval(found.lo[1:], found.hi[1:])

    @property
    def largest(self) -> Interval:
        """The largest eigenvalue."""
        return Interval.of(self.modes.lo.max(), self.modes.hi.max())

    def rate(self) -> Interval:
        """Rate at which the slowest mode of disagreement decays."""
        if self.is_first:
            rates = self.first_gain * self.modes
        else:
            half = self.rate_gain * self.modes * Interval.of(0.5)
            inner = half.power(2) - self.place_gain * self.modes
            root = Interval(np.maximum(inner.lo, 0.0), np.maximum(inner.hi, 0.0)).sqrt()
            # (sqrt(x^2 - c) of x) written so that nothing cancels: x - sqrt(x^2 - c) = c/(x + sqrt(x^2 - c)).
            real = self.place_gain * self.modes / (half + root)
            rates = Interval(np.where(inner.hi < 0.0, half.lo, np.minimum(real.lo, half.lo)),
                             np.where(inner.hi < 0.0, half.hi, np.minimum(real.hi, half.hi)))  # fmt: skip
        return Interval.of(rates.lo.min(), rates.hi.min())

    def delay(self) -> Interval | None:
        """Largest delay of all states, the own one too, that the agreement stands; None where it is not known."""
        if self.is_first:
            return PI / (self.first_gain * self.largest * Interval.of(2.0))
        a, b, modes = self.place_gain, self.rate_gain, self.modes
        x = (modes * b).power(2)
        w = ((x + (x.power(2) + (modes * a).power(2) * Interval.of(4.0)).sqrt()) * Interval.of(0.5)).sqrt()
        found = (w * b / a).atan() / w
        return Interval.of(found.lo.min(), found.hi.min())

    def period(self, samples: int = 0) -> Interval | None:
        """Largest period of held control, with a delay of whole samples of all states; None where it is not known."""
        if self.is_first:
            speed = self.first_gain * self.largest
            return (PI / Interval.of(2.0 * (2 * samples + 1))).sin() * Interval.of(2.0) / speed
        if samples:
            return period_of_all_late(self.modes, self.place_gain, self.rate_gain, samples)
        first = self.rate_gain * Interval.of(2.0) / self.place_gain
        second = Interval.of(2.0) / (self.rate_gain * self.largest)
        return Interval.of(min(first.lo, second.lo), min(first.hi, second.hi))

    def neighbour_period(self, samples: int) -> Interval | str:
        """Largest period of held control with a delay of whole samples of neighbours alone; or why none is proven."""
        links = self._links
        neighbours = links.sum(axis=1)
        if np.ptp(neighbours):
            return (
                "agents have different numbers of neighbours, and eigenvalues of the Laplacian do not decide it alone; "
                "a scenario with such messages has `period_in_world`"
            )
        place = Interval.of(0.0) if self.is_first else self.place_gain
        rate = self.first_gain if self.is_first else self.rate_gain
        found = NeighboursLate(int(neighbours[0]), self.modes, has_two_sides(links), place, rate, samples).period()
        return "no period was proven" if found is None else found

    def variance(self) -> Interval:
        """Stationary mean square disagreement of an agent and axis under white noise of intensity 1 on its rate.

        Of positions for order 1, of velocities for order 2.
        """
        inverse = (self.first_gain * self.modes).reciprocal().total()
        return inverse / Interval.of(2.0 * (len(self.modes.lo) + 1))


def _square_factor(term: Gradient) -> Interval | None:
    """The c of a potential c r^2, enclosed; None for another one."""
    import sympy

    from flocking.formula.interval_values import enclosed

    r = sympy.Symbol("r", positive=True)
    expression = term.potential.expression(r)
    if term.over is not None or not expression.is_polynomial(r):
        return None
    terms = sympy.Poly(expression, r).as_dict()
    factor = terms.pop((2,), sympy.Integer(0))
    # A constant exerts no force.
    return enclosed(factor, r, Interval.of(1.0)) if set(terms) <= {(0,)} else None


def consensus_certificates(scenario: Scenario) -> tuple[Certificate, ...]:
    """All guarantees of a scenario that is linear consensus.

    Parameters
    ----------
    scenario
        The scenario.
    """
    system = LinearConsensus(scenario)
    if not system.holds:
        return not_applicable(KEYS, sources()["spectrum"], system.hypotheses)
    what = "velocities" if system.only_velocities else "positions" if system.order == 1 else "positions and velocities"
    rate = system.rate()
    found = [_of(
        system, "decay_rate", "spectrum", rate, "rate of decay",
        f"In the ideal world, every disagreement of {what} decays, in the end, at the rate {rounded_down(rate.lo)} or "
        f"faster.",
    )]  # fmt: skip
    settling = Interval.of(SETTLED).log() / rate
    statement = f"In the ideal world, the disagreement of {what} has fallen to 2 % after {rounded_up(settling.hi)}."
    reason = "" if system.is_first else "before it decays a disagreement of second order may grow"
    found.append(_of(system, "settling_time", "spectrum", settling, "time to 2 %", statement, reason))
    delay = system.delay()
    assert delay is not None
    found.append(_of(
        system, "delay", "delay", delay, "delay of all states, the own one too",
        f"Under continuous control agreement is stable for every such delay below {rounded_down(delay.lo)}, and for "
        f"none above {rounded_up(delay.hi)}.",
    ))  # fmt: skip
    reason = "" if system.is_first else "not every delay is harmless, and no bound is known here"
    found.append(_of(
        system, "neighbour_delay", "neighbour_delay", None,
        "delay of neighbours' states, the own one undelayed",
        "Under continuous control agreement is stable for every such delay.", reason,
    ))  # fmt: skip
    for d in range(MOST_SAMPLES + 1):
        period = system.period(d)
        words = f", all states delayed by {d} samples, the own one too" if d else ""
        known = words or ", with the present known"
        statement, reason = "", "no period was proven"
        if period is not None:
            reason = ""
            statement = (
                f"Under held control{known}, {TOGETHER}, agreement is stable for every period below "
                f"{rounded_down(period.lo)}, and for none above {rounded_up(period.hi)}."
            )
        key = f"control_period_delayed_{d}" if d else "control_period"
        source = "late_samples" if d and not system.is_first else "sampling"
        found.append(_of(system, key, source, period, f"period of held control{words}", statement, reason))
    for d in range(1, MOST_SAMPLES + 1):
        late = system.neighbour_period(d)
        words = f", neighbours' states delayed by {d} samples, the own one not"
        statement, reason, bound = "", "", None
        if isinstance(late, str):
            reason = late
        else:
            bound = late
            statement = (
                f"Under held control{words}, {TOGETHER}, disagreement and common motion fall for every period below "
                f"{rounded_down(late.lo)}, and do not both at {rounded_up(late.hi)}."
            )
        key = f"neighbour_period_delayed_{d}"
        found.append(_of(system, key, "late_neighbours", bound, f"period of held control{words}", statement, reason))
    variance = system.variance()
    of, where = ("velocity", "accelerations") if system.order == 2 else ("position", "rates")
    found.append(_of(
        system, "noise_variance", "noise", variance,
        f"mean square disagreement of the {of} of an agent, for each axis and unit of noise intensity",
        f"In the ideal world white noise of intensity s^2 on the {where} gives s^2 times {rounded_up(variance.hi)} "
        "in the long run.",
    ))  # fmt: skip
    return tuple(found)


def _of(
    system: LinearConsensus, key: str, source: str, bound: Interval | None, quantity: str, statement: str,
    reason: str = "",
) -> Certificate:  # fmt: skip
    if bound is not None and not (np.isfinite(bound.lo) and np.isfinite(bound.hi)):
        reason = reason or "the numbers of the law are too large or too small for an enclosure in double precision"
    return decided(
        key, sources()[source], system.hypotheses, statement=statement, reason=reason, bound=bound, side="is",
        quantity=quantity,
    )  # fmt: skip
