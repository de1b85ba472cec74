"""Linear consensus of first order on undirected graphs that switch: what composes, and what does not.

Between switches x' = -a L x, or under held control x(t + T) = (1 - a T L) x(t), with the Laplacian L of the graph of
that moment. |x - mean|^2 does not grow under any of them: L is symmetric and positive, keeps the mean, and its
eigenvalues are at most N (and at most twice the largest degree), so that |1 - a T lambda| <= 1 for T <= 2/(a N). One
function serves for all graphs, so the bound of the period composes. With delays there is no such function: a delay
below pi/(2 a N) is harmless on every single graph, and what switching does between them is not stated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flocking.formula.intervals import Interval
from flocking.formula.safe_digits import rounded_down, rounded_up
from flocking.model.graphs.all_pairs import Complete
from flocking.model.graphs.distance_graphs import Fixed, Hysteresis, Proximity
from flocking.model.law import Scenario
from flocking.study.certificates.certificate import (
    Certificate,
    Hypothesis,
    decided,
    graph_in_words,
    not_applicable,
    until_failed,
)
from flocking.study.certificates.consensus_certificates import PI, TOGETHER, LinearConsensus
from flocking.study.certificates.sources import sources

SWITCHING = ("disagreement", "period_of_any_graph", "delay_of_each_graph")
"""Keys of the certificates of graphs that switch."""


@dataclass(frozen=True, eq=False)
class FirstOrder:
    """A scenario as linear consensus of first order on some graph.

    Parameters
    ----------
    scenario
        The scenario.
    """

    scenario: Scenario

    @property
    def consensus(self) -> LinearConsensus:
        """The same as linear consensus on a fixed undirected graph: its gains do not depend on the graph."""
        return LinearConsensus(self.scenario)

    def bodies(self) -> Hypothesis:
        """Bodies of linear consensus."""
        return self.consensus.body_hypothesis()

    def terms(self) -> Hypothesis:
        """A linear law that is of first order."""
        found = self.consensus.term_hypothesis()
        if found.holds and not self.consensus.is_first:
            statement = "positions of agents of order 1 are agreed on, or velocities alone"
            return Hypothesis(statement, False, "positions and velocities")
        return found

    def undirected(self) -> Hypothesis:
        """A graph whose links are the same from both sides."""
        graph, statement = self.scenario.law.graph, "two agents or more have one undirected graph in open space"
        fits = type(graph) in (Complete, Fixed, Proximity, Hysteresis) and not graph.directed
        fits = fits and len(self.scenario.law.graphs) == 1 and self.scenario.space.is_open and self.scenario.start.n > 1
        links = self.scenario.start.links
        if fits and links is not None and not np.array_equal(links, np.asarray(links).T):
            return Hypothesis(statement, False, "links of the start are directed")
        return Hypothesis(statement, fits, graph_in_words(self.scenario))


def switching_certificates(scenario: Scenario) -> tuple[Certificate, ...]:
    """Guarantees of a scenario that is linear consensus of first order on an undirected graph, which may switch.

    Parameters
    ----------
    scenario
        The scenario.
    """
    system = FirstOrder(scenario)
    source = sources()["switching"]
    hypotheses = until_failed(system.undirected, system.bodies, system.terms)
    if not all(h.holds for h in hypotheses):
        return not_applicable(SWITCHING, source, hypotheses)
    consensus = system.consensus
    what = "velocities" if consensus.only_velocities else "positions"
    values = scenario.start.p if consensus.only_velocities else scenario.start.q
    ideal = Hypothesis("information and control are ideal", not scenario.imperfections, scenario.imperfections or "so")
    fastest = consensus.first_gain * Interval.of(float(scenario.start.n))
    period, delay = Interval.of(2.0) / fastest, PI / (fastest * Interval.of(2.0))
    # No eigenvalue exceeds twice the largest number k of neighbours.
    of_neighbours = Interval.of(1.0) / consensus.first_gain, PI / (consensus.first_gain * Interval.of(4.0))
    few_period, few_delay = (float(x.lo) for x in of_neighbours)
    spread = spread_about_mean(values)
    return (
        decided(
            "disagreement", source, (*hypotheses, ideal), bound=spread,
            quantity=f"root of the sum of squares of {what} about their mean",
            statement=f"The {what} never differ by more than at the start: the root of the sum of squares about their "
            f"mean is at most {rounded_up(spread.hi)}, whatever links appear and break.",
        ),
        decided(
            "period_of_any_graph", source, hypotheses, bound=period, side="is", quantity="period of held control",
            statement=f"Under held control of a period of at most {rounded_down(period.lo)}, {TOGETHER}, and with the "
            f"present known, the {what} never differ by more than at the start, whatever links appear and break; while "
            f"no agent has more than k neighbours, of one of at most {rounded_down(few_period)}/k.",
        ),
        decided(
            "delay_of_each_graph", source, hypotheses, bound=delay, side="is",
            quantity="delay of all states, the own one too",
            statement="Under continuous control, on every connected graph that stays as it is, a delay below "
            f"{rounded_down(delay.lo)} is harmless, and below {rounded_down(few_delay)}/k where no agent has more than "
            "k neighbours; of graphs that switch this holds for each interval alone, not for all together.",
        ),
    )  # fmt: skip


def spread_about_mean(values: np.ndarray) -> Interval:
    """Root of the sum of squares of the differences from the mean, enclosed.

    Parameters
    ----------
    values
        Values, shape (N, m).
    """
    total = Interval.of(0.0)
    for column in np.asarray(values, dtype=np.float64).T:
        mean = Interval.of(column).total() / Interval.of(float(len(column)))
        square = (Interval.of(column) - mean).power(2).total()
        total = total + square
    return Interval(np.maximum(total.lo, 0.0), total.hi).sqrt()
