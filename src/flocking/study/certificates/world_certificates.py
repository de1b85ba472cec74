"""Guarantees of linear consensus in the world that a scenario declares: held control, messages, delays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flocking.formula.intervals import Interval
from flocking.formula.safe_digits import given_text, rounded_down, rounded_up
from flocking.model.graphs.distance_graphs import Fixed
from flocking.model.law import Scenario
from flocking.model.world.information import Delayed
from flocking.study.certificates.certificate import NOT_APPLICABLE, Certificate, Enclosure, Hypothesis, decided
from flocking.study.certificates.consensus_certificates import LinearConsensus
from flocking.study.certificates.linear.directed_consensus import DirectedConsensus
from flocking.study.certificates.sampled_consensus import SampledConsensus
from flocking.study.certificates.sources import sources
from flocking.study.claims.conclusions.frames import frame_words

SUM_ERROR = 1e-13
"""Rounding of a sum of up to a million products relative to the sum of their absolute values: NumPy sums in pairs of
blocks of 128, fewer than 160 units of 1.1e-16."""

SEARCHED = 0.1
"""Tolerance of the search for a period, in the narrowest width that is proven: the search adds little to it."""

KEYS = ("growth_in_world", "period_in_world", "noise_in_world")
"""Keys of the certificates of held control."""

DELAY = "delay_in_world"
"""Key of the certificate of a delay in continuous time."""

FIRST_SHARE, PLACES = 1e-2, 40
"""Where the search for the largest period begins, as a share of where it ends, and its number of places."""

NARROWEST, WIDEST = 1e-9, 1e-2
"""Relative distances from the computed period at which it is tried to prove that it is stable below, unstable above."""

FINELY_SEARCHED, FEW_PLACES = 24, 10
"""Components above which the search looks at fewer places where messages are lost, and their number."""

LARGEST_SEARCHED = 100
"""Components up to which the largest period is searched for where messages are lost: some 20 growths, 4 seconds for 99
components on one core, and a minute for 198."""


def world_certificates(scenario: Scenario) -> tuple[Certificate, ...]:
    """All guarantees of a scenario that is linear consensus with held control, or with delays.

    Parameters
    ----------
    scenario
        The scenario.
    """
    graph = scenario.law.graph
    system = DirectedConsensus(scenario) if type(graph) is Fixed and graph.directed else LinearConsensus(scenario)
    found = *_sampled(scenario, system), _delay(scenario, system)
    return tuple(_with_frame(scenario, system, each) for each in found)


def _with_frame(scenario: Scenario, system: LinearConsensus, found: Certificate) -> Certificate:
    """A granted guarantee of positions and velocities, with what makes the rest frame of the world physical.

    Of positions of agents of order 1 there is no velocity, and velocities alone are agreed on in the same way by all
    observers who move uniformly.
    """
    words = frame_words(scenario)
    if not (words and found.granted) or system.is_first:
        return found
    return replace(found, statement=f"{found.statement} {words[0].upper()}{words[1:]}.")


def _sampled(scenario: Scenario, system: LinearConsensus) -> tuple[Certificate, ...]:
    """Guarantees under held control."""
    if scenario.control.ideal and scenario.information.ideal:
        return _without((), "information and control are ideal")
    failed = next((h for h in system.hypotheses if not h.holds), None)
    if failed is not None:
        return _without(system.hypotheses, f"{failed.statement}: {failed.found}")
    world = SampledConsensus(system)
    hypotheses = (*system.hypotheses, *world.hypotheses)
    if not world.holds:
        return tuple(decided(key, sources()["moments"], hypotheses) for key in KEYS)
    return _growth(world, hypotheses), _period(world, hypotheses), _noise(world, hypotheses)


def _without(hypotheses: tuple[Hypothesis, ...], reason: str) -> tuple[Certificate, ...]:
    return tuple(Certificate(key, "", sources()["moments"], hypotheses, NOT_APPLICABLE, reason) for key in KEYS)


def _delay(scenario: Scenario, system: LinearConsensus) -> Certificate:
    """Whether agreement is stable with the declared delay, and the delay up to which it is."""
    key, information = DELAY, scenario.information
    if not isinstance(information, Delayed) or information.ideal:
        return Certificate(key, "", sources()["delay"], (), NOT_APPLICABLE, "no delay in continuous time is declared")
    failed = next((h for h in system.hypotheses if not h.holds), None)
    if failed is not None:
        reason = f"{failed.statement}: {failed.found}"
        return Certificate(key, "", sources()["delay"], system.hypotheses, NOT_APPLICABLE, reason)
    found = scenario.control.summary or "so"
    hypotheses = (*system.hypotheses, Hypothesis("control is continuous", scenario.control.ideal, found))
    tau = information.largest
    if not information.self_delayed:
        # Rows stay diagonally dominant whatever the delay of each entry.
        reason = "" if system.is_first else "not every delay of neighbours is harmless, and no bound is known here"
        late = f"known {given_text(tau)} late, and for every other such delay."
        if information.of_pairs:
            late = f"known up to {given_text(tau)} late, each pair by its own delay, and for all other such delays."
        return decided(
            key, sources()["neighbour_delay"], hypotheses, reason=reason, side="is",
            statement=f"Agreement is stable where neighbours are {late}",
            quantity="delay of neighbours' states, the own one undelayed",
        )  # fmt: skip
    if information.of_pairs:
        reason = "no bound is known here for delays that differ between pairs where agents know themselves late, too"
        return decided(key, sources()["delay"], hypotheses, reason=reason, side="is")
    bound, reason = system.delay(), ""
    if bound is None:
        return decided(
            key, sources()["delay"], hypotheses, reason="agreement is not known to hold under any delay", side="is"
        )
    low, high = float(bound.lo), float(bound.hi)
    if tau > high:
        reason = (
            f"it is not stable: the delay is {given_text(tau)}, and above {rounded_up(high)} the disagreement "
            f"swings ever wider"
        )
    elif not tau < low:
        reason = f"it is not certain: the delay {given_text(tau)} lies between {given_text(low)} and {given_text(high)}"
    return decided(
        key, sources()["delay"], hypotheses, reason=reason, bound=bound, side="is",
        statement=f"Agreement is stable with the delay {given_text(tau)} of all states, and for every one below "
        f"{rounded_down(low)}.",
        quantity="delay of all states, the own one too",
    )  # fmt: skip


def _mean(world: SampledConsensus) -> str:
    """The words that distinguish an average over losses from what is certain."""
    return "mean square " if world.probability else ""


def _beside(world: SampledConsensus) -> str:
    """What is not part of what falls: where samples have errors these keep a disagreement up."""
    return ", apart from what errors of samples add" if world.noise_shares().any() else ""


def _growth(world: SampledConsensus, hypotheses: tuple[Hypothesis, ...]) -> Certificate:
    low, high = (float(x) for x in world.recursion(world.period).growth())
    if not world.probability:
        root = Interval.of(max(low, 0.0), high).sqrt()
        low, high = max(float(root.lo), 0.0), float(root.hi)
    quantity = f"factor of the {_mean(world)}{world.motion} from tick to tick, in the long run"
    if low >= 1.0:
        reason = f"it does not fall: the {quantity} is at least {rounded_down(low)}"
    elif not high < 1.0:
        reason = (
            f"it is not certain that it falls: the {quantity} lies between {rounded_down(low)} and {rounded_up(high)}"
        )
    else:
        reason = ""
    statement = f"The {quantity}{_beside(world)}, is at most {rounded_up(high)}."
    return decided(
        "growth_in_world", sources()["moments"], hypotheses, reason=reason, statement=statement,
        bound=Enclosure(low, high), side="is", quantity=quantity,
    )  # fmt: skip


def _period(world: SampledConsensus, hypotheses: tuple[Hypothesis, ...]) -> Certificate:
    both = world.holds_common_motion
    quantity = f"period at which the {world.motion} cease{'' if both else 's'} to fall"
    size = world.recursion(world.period).size
    if world.probability and size > LARGEST_SEARCHED:
        reason = f"searched for {LARGEST_SEARCHED} numbers of an axis at most where messages are lost, of {size}"
        return decided("period_in_world", sources()["moments"], hypotheses, reason=reason, quantity=quantity)
    places = FEW_PLACES if world.probability and size > FINELY_SEARCHED else PLACES
    found = largest_period(world, places)
    late = f", messages {world.delayed_samples} periods late" if world.delayed_samples else ""
    lost = f", {given_text(world.probability)} of the messages lost" if world.probability else ""
    reason = "" if found is not None else "no period was found below which it falls and above which it does not"
    statement = ""
    if found is not None:
        falls, not_so, so = ("fall", "do not both", "they were") if both else ("falls", "does not", "it was")
        statement = (
            f"With control held for a period{late}{lost}, the {_mean(world)}{world.motion}{_beside(world)} {falls} at "
            f"{given_text(found.lo)}, and {not_so} at {given_text(found.hi)}. At all shorter ones of {places} periods "
            f"{so} computed to fall."
        )
    return decided(
        "period_in_world", sources()["moments"], hypotheses, reason=reason, statement=statement, bound=found,
        side="is", quantity=quantity,
    )  # fmt: skip


def largest_period(world: SampledConsensus, number: int = PLACES) -> Enclosure | None:
    """A period at which the disagreement certainly falls, and one just above at which it certainly does not.

    Parameters
    ----------
    world
        The law in its world; its own period does not matter.
    number
        Number of periods that are looked at, from the shortest on, up to the first at which it does not fall.
    """
    from scipy.optimize import brentq

    def growing(period: float) -> float:
        # Powers of the factor grow without bounds where the period is far too long: only its sign counts there.
        rate = world.recursion(period).largest_growth()
        return float(np.log(rate)) if 0.0 < rate < np.inf else 1.0

    longest = _longest(world)
    places = np.geomspace(FIRST_SHARE * longest, longest, number)
    found = next((k for k, period in enumerate(places) if growing(float(period)) >= 0.0), None)
    if not found:
        return None
    ends = float(places[found - 1]), float(places[found])
    near = float(brentq(growing, *ends, xtol=SEARCHED * NARROWEST * ends[0], rtol=SEARCHED * NARROWEST))
    steps = np.geomspace(NARROWEST, WIDEST, 8)
    below = next((x for x in (near * (1.0 - s) for s in steps) if world.recursion(x).growth()[1] < 1.0), None)
    above = next((x for x in (near * (1.0 + s) for s in steps) if world.recursion(x).growth()[0] >= 1.0), None)
    return None if below is None or above is None else Enclosure(float(below), float(above))


def _longest(world: SampledConsensus) -> float:
    """A period beyond which the mean disagreement grows where nothing is late; twice that, to begin with."""
    largest = float(world.consensus.largest.hi) * (1.0 - world.probability)
    if world.order == 1:
        return 4.0 / (float(world.consensus.first_gain.lo) * largest)
    place, rate = float(world.consensus.place_gain.lo), float(world.consensus.rate_gain.lo)
    return 2.0 * min(2.0 * rate / place, 2.0 / (rate * largest))


def _noise(world: SampledConsensus, hypotheses: tuple[Hypothesis, ...]) -> Certificate:
    quantity = f"mean square deviation of {world.what} from their mean, of an agent and axis, in the long run"
    sigma = world.noise_shares()
    if not sigma.any():
        return Certificate("noise_in_world", "", sources()["moments"], hypotheses, NOT_APPLICABLE, "samples are exact")
    recursion = world.recursion(world.period).scaled_noise(sigma)
    found = recursion.stationary()
    reason, bound = "no stationary value was proven", None
    if found is not None:
        # Deviations from the mean of N numbers of which the first is zero: the form I - 1 1^T/N on the others.
        n, moment = world.n, found.moment
        form = np.zeros_like(moment)
        form[: n - 1, : n - 1] = (np.eye(n - 1) - 1.0 / n) / n
        value = float((form * moment).sum())
        error = found.error * (n - 1) / n + SUM_ERROR * float((np.abs(form) * np.abs(moment)).sum())
        reason, bound = "", Enclosure(max(0.0, value - error), value + error)
    statement = "" if bound is None else f"The {quantity}, is {bound}."
    return decided(
        "noise_in_world", sources()["moments"], hypotheses, reason=reason, statement=statement, bound=bound, side="is",
        quantity=quantity,
    )  # fmt: skip
