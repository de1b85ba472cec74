"""Bounds of certificates as lines beside margins: up to which value of a quantity of the world something is proven."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from flocking.errors import InvalidInput
from flocking.formula.safe_digits import DIGITS, rounded_down, rounded_up
from flocking.model.law import Scenario
from flocking.model.world.control import Control, Held
from flocking.model.world.information import Messages
from flocking.study.certificates.certificate import Certificates
from flocking.study.certificates.certify import certify


@dataclass(frozen=True)
class MarginLine:
    """A value of a quantity of the world up to which, or from which on, something is proven.

    Parameters
    ----------
    value
        The value.
    label
        What is proven, in a few words.
    key
        Key of the certificate.
    beyond
        Whether it is proven of larger values, as of limits that never act, instead of smaller ones.
    """

    value: float
    label: str
    key: str
    beyond: bool = False

    def text(self, digits: int = DIGITS) -> str:
        """The value with a few digits, rounded so that it is proven of it.

        Parameters
        ----------
        digits
            Significant digits, up to 15.
        """
        return rounded_up(self.value, digits) if self.beyond else rounded_down(self.value, digits)


PROVEN_QUANTITIES = ("period", "limit")
"""Names of the quantities of which certificates bound something."""

PERIODS = {
    "control_period": "agreement is stable below", "period_of_any_graph": "no disagreement grows up to",
    "directed_period": "agreement is stable below",
}  # fmt: skip
"""Certificates of periods of held control, where the present is known."""


def margin_lines(scenario: Scenario, quantity: str) -> tuple[MarginLine, ...]:
    """The lines that certificates draw beside the margin of a quantity; none where nothing is proven of it.

    Parameters
    ----------
    scenario
        The scenario whose margins are sought. ``period`` has lines where all agents act at the same times and without
        latency, and messages, if there are any, arrive at once: margins keep phases, latencies and delays in units of
        time, whatever the period. ``limit`` has one where the largest force is bounded in the scenario's own world.
        ``delay``, ``loss`` and ``noise`` have none: margins vary them in a world of messages under held control, of
        which no certificate bounds these.
    quantity
        Name of the quantity, as in ``flocking margins --vary``.

    Raises
    ------
    InvalidInput
        When it is no scenario.
    """
    if not isinstance(scenario, Scenario):
        raise InvalidInput("margin_lines", "scenario", "must be a Scenario", scenario)
    if quantity == "period":
        return _period_lines(scenario)
    if quantity == "limit":
        return _limit_lines(certify(scenario))
    return ()


def common_lines(scenarios: Iterable[Scenario], quantity: str) -> tuple[MarginLine, ...]:
    """The lines that hold for each of several scenarios, such as those of several seeds, at the safest of their values.

    Parameters
    ----------
    scenarios
        The scenarios.
    quantity
        As in `margin_lines`.

    Raises
    ------
    InvalidInput
        As `margin_lines`.
    """
    found = [{line.key: line for line in margin_lines(scenario, quantity)} for scenario in scenarios]
    if not found:
        return ()
    lines = []
    for key, line in found[0].items():
        if all(key in each for each in found):
            values = [each[key].value for each in found]
            lines.append(replace(line, value=max(values) if line.beyond else min(values)))
    return tuple(lines)


def _period_lines(scenario: Scenario) -> tuple[MarginLine, ...]:
    if not _acts_together(scenario.control, scenario.start.n):
        return ()
    found = certify(scenario)
    if not scenario.information.ideal:
        # How many periods a delay takes depends on the period, and the certificate is for one number of them.
        if isinstance(scenario.information, Messages) and scenario.information.delay:
            return ()
        each = found["period_in_world"]
        if not each.granted or each.bound is None:
            return ()
        return (
            MarginLine(
                each.bound.lo,
                "in the declared world, without errors of samples, the mean square disagreement falls at",
                each.key,
            ),
        )
    lines = []
    for key, label in PERIODS.items():
        bound = found[key].safe_lower
        if bound is not None:
            lines.append(MarginLine(bound, label, key))
    return tuple(lines)


def _acts_together(control: Control, n: int) -> bool:
    """Whether all of n agents act at the same times and without latency, which certificates of a period assume."""
    if control.ideal:  # margins hold it with neither phase nor latency
        return True
    return type(control) is Held and not np.any(control.latency) and not np.ptp(control.schedule(n).phase)


def _limit_lines(found: Certificates) -> tuple[MarginLine, ...]:
    each = found["largest_force"]
    if each.safe_bound is None or not np.isfinite(each.safe_bound):
        return ()
    return (MarginLine(each.safe_bound, "larger limits never act", each.key, beyond=True),)
