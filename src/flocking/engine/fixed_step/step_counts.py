"""How many steps of a fixed length lie between two times, and how exactly times of such steps are known."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from flocking.model.law import Scenario

STEP_ROUNDING = 1e-9
"""Share of a step by which a time may be off: the rounding of a time a million steps from zero is 2e-10 of a step."""

TIME_ROUNDING = 1e-9
"""Share of the largest time of a run, or of 1 in a longer one, by which a stored time may lie outside of it: far above
its rounding."""

LARGEST_SQUARE = 1e300
"""Squares of lengths above it count as infinite: sums of a few of them do not overflow."""


def steps_between(start: float, end: float, step: float) -> int:
    """Number of steps of at most ``step`` from one time to another, at least one.

    Parameters
    ----------
    start, end
        The two times.
    """
    return max(1, math.ceil((end - start) / step - STEP_ROUNDING))


def is_reached(time: float, to: float, step: float) -> bool:
    """Whether a ``time`` is at another one, up to the rounding of a ``step``.

    Parameters
    ----------
    to
        The other one.
    """
    return time >= to - STEP_ROUNDING * step


def time_slack(scenario: Scenario) -> float:
    """By how much stored times of a run may lie before its start or after its end."""
    start, end = scenario.start.t, scenario.t_end
    return TIME_ROUNDING * max(abs(start), abs(end), min(1.0, end - start))
