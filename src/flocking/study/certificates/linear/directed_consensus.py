"""Guarantees of linear consensus on a fixed directed graph, of first and of second order."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from flocking.formula.intervals import Interval
from flocking.formula.safe_digits import rounded_down, rounded_up
from flocking.model.graphs.distance_graphs import Fixed
from flocking.model.law import Scenario
from flocking.study.certificates.certificate import (
    Certificate,
    Hypothesis,
    decided,
    graph_in_words,
    not_applicable,
    until_failed,
)
from flocking.study.certificates.consensus_certificates import MOST_SAMPLES, TOGETHER, LinearConsensus
from flocking.study.certificates.linear.directed_graphs import DirectedSpectrum, roots_of
from flocking.study.certificates.linear.directed_modes import DirectedModes
from flocking.study.certificates.sources import sources

LATE = tuple(f"directed_period_delayed_{d}" for d in range(1, MOST_SAMPLES + 1))

KEYS = ("directed_decay_rate", "directed_delay", "directed_neighbour_delay", "directed_period", *LATE)
"""Keys of the certificates of directed graphs."""


@dataclass(frozen=True, eq=False)
class DirectedConsensus(LinearConsensus):
    """A scenario as linear consensus on a fixed directed graph: x' = -a L x, or x'' = -a L x - b L x'."""

    @cached_property
    def hypotheses(self) -> tuple[Hypothesis, ...]:
        """What must hold, in the order of the checks; later ones assume earlier ones."""
        return until_failed(self._graph, self.body_hypothesis, self.term_hypothesis, self._rooted, self._known)

    def _graph(self) -> Hypothesis:
        graph, start = self.scenario.law.graph, self.scenario.start
        statement = "two agents or more have one fixed, directed graph in open space"
        fits = type(graph) is Fixed and graph.directed and len(self.scenario.law.graphs) == 1
        fits = fits and self.scenario.space.is_open and start.n > 1 and start.links is None
        found = graph_in_words(self.scenario) + ("" if start.links is None else ", links of the start are given")
        return self.size_hypothesis(statement) if fits else Hypothesis(statement, False, found)

    def _rooted(self) -> Hypothesis:
        count = len(roots_of(self._links))
        return Hypothesis("one group of agents senses no other, and all lead to it", count == 1, f"{count} such groups")

    def _known(self) -> Hypothesis:
        reason = self.spectrum.reason
        return Hypothesis("eigenvalues of the Laplacian are distinguished from zero", not reason, reason or "so")

    @cached_property
    def spectrum(self) -> DirectedSpectrum:
        """Discs that hold the eigenvalues but the zero."""
        return DirectedSpectrum(self._links)

    @property
    def largest(self) -> Interval:
        """The largest modulus of an eigenvalue."""
        size = np.abs(self.spectrum.centres)
        return Interval.of(float((size - self.spectrum.radii).max()), float((size + self.spectrum.radii).max()))

    @cached_property
    def second(self) -> DirectedModes:
        """The modes of second order."""
        return DirectedModes(self.spectrum.centres, self.spectrum.radii, self.place_gain, self.rate_gain)

    def rate(self) -> Interval:
        """Rate at which the slowest mode decays, negative where one grows."""
        return self.spectrum.rate(self.first_gain) if self.is_first else self.second.rate()

    def delay(self) -> Interval | None:
        """Largest delay of all states, the own one too; None where agreement is not known to stand none."""
        return self.spectrum.delay(self.first_gain) if self.is_first else self.second.delay()

    def period(self, samples: int = 0) -> Interval | None:
        """Largest period of held control, with a delay of whole samples of all states; None where it is not known."""
        if self.is_first:
            return self.spectrum.period(self.first_gain, samples)
        return None if samples else self.second.period()


def directed_certificates(scenario: Scenario) -> tuple[Certificate, ...]:
    """Guarantees of a scenario that is linear consensus on a fixed directed graph.

    Parameters
    ----------
    scenario
        The scenario.
    """
    system, source = DirectedConsensus(scenario), sources()["directed"]
    hypotheses = system.hypotheses
    if len(hypotheses) < 4 and not all(h.holds for h in hypotheses):
        return not_applicable(KEYS, source, hypotheses)
    if not system.holds:
        return tuple(decided(key, source, hypotheses) for key in KEYS)
    rate = system.rate()
    grows = "" if rate.lo > 0.0 else _growing(system, rate)
    found = [_row(
        system, KEYS[0], rate, "rate of decay",
        f"In the ideal world every disagreement decays, in the end, at the rate {rounded_down(rate.lo)} or faster.",
        grows,
    )]  # fmt: skip
    delay = None if grows else system.delay()
    found.append(_row(
        system, KEYS[1], delay, "delay of all states, the own one too",
        "" if delay is None else "Under continuous control agreement is stable for every such delay below "
        f"{rounded_down(delay.lo)}.",
        grows or "the angle of an eigenvalue is not distinguished from the limit" * (delay is None),
    ))  # fmt: skip
    reason = "" if system.is_first else "not every delay is harmless, and no bound is known here"
    found.append(decided(
        KEYS[2], sources()["neighbour_delay"], hypotheses, reason=reason, side="is",
        statement="Under continuous control agreement is stable for every such delay.",
        quantity="delay of neighbours' states, the own one undelayed",
    ))  # fmt: skip
    for d, key in enumerate((KEYS[3], *LATE)):
        period = None if grows else system.period(d)
        words = f", all states delayed by {d} samples" if d else ""
        known = words or ", with the present known"
        reason = grows or (
            "" if period is not None else "no period was proven" if not d else "no closed form is known here"
        )
        found.append(_row(
            system, key, period, f"period of held control{words}",
            "" if period is None else
            f"Under held control{known}, {TOGETHER}, agreement is stable for every period below "
            f"{rounded_down(period.lo)}.", reason,
        ))  # fmt: skip
    return tuple(found)


def _growing(system: DirectedConsensus, rate: Interval) -> str:
    if rate.hi < 0.0:
        return f"it is not stable: a disagreement grows at the rate {rounded_down(-rate.hi)} or faster"
    return f"it is not certain that it decays: the rate lies between {rounded_down(rate.lo)} and {rounded_up(rate.hi)}"


def _row(
    system: DirectedConsensus, key: str, bound: Interval | None, quantity: str, statement: str, reason: str
) -> Certificate:
    if bound is not None and not (np.isfinite(bound.lo) and np.isfinite(bound.hi)):
        reason = reason or "the numbers of the law are too large or too small for an enclosure in double precision"
    return decided(
        key, sources()["directed"], system.hypotheses, statement=statement, reason=reason, bound=bound, side="is",
        quantity=quantity,
    )  # fmt: skip
