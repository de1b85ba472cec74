"""Counts of runs at the levels of a quantity, and the bracket of the first level at which a conclusion is not shown."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from flocking.study.confidence_intervals import Interval, share_interval

ROUNDED = 1.0 - 1e-12
"""Factor for the rounding of share times total: numbers of runs are whole, so it decides only where both are equal."""

STEP_TO_IDEAL = 4.0
"""Where the first level fails, the next one tried is this many times nearer to the ideal value."""

DIGITS = 4
"""Significant digits of levels that are tried between two others, where these differ by so much."""


@dataclass(frozen=True)
class Count:
    """Runs at one level: the conclusion is shown, refuted, or left open.

    Parameters
    ----------
    held, failed, left_open
        Numbers of runs.
    """

    held: int = 0
    failed: int = 0
    left_open: int = 0

    @property
    def total(self) -> int:
        """Number of runs."""
        return self.held + self.failed + self.left_open

    def shown(self, share: float) -> bool:
        """Whether the conclusion is shown in at least this ``share`` of the runs."""
        return self.total > 0 and self.held >= share * self.total * ROUNDED

    def refuted(self, share: float) -> bool:
        """Whether runs refute the conclusion, and it is not shown in at least this ``share`` of them."""
        return self.failed > 0 and not self.shown(share)

    def interval(self, level: float) -> Interval:
        """Clopper and Pearson's interval of the probability that a run shows it, at a ``level`` of confidence."""
        return share_interval(self.held, self.total, level)


def open_everywhere(counts: Mapping[float, Count]) -> bool:
    """Whether runs at no level show or refute a conclusion: nothing is known of where it ceases to hold.

    Parameters
    ----------
    counts
        Counts by level.
    """
    return not any(count.held or count.failed for count in counts.values())


@dataclass(frozen=True)
class Bracket:
    """Where a conclusion is first not shown, on the levels that were tried.

    Parameters
    ----------
    lower
        Last level before it; None where that is the ideal world itself.
    upper
        First level at which it is not shown; None where it is shown at all.
    again
        Levels beyond ``upper`` at which it is shown again.
    """

    lower: float | None
    upper: float | None
    again: tuple[float, ...] = ()

    @property
    def width(self) -> float:
        """Distance of the two ends as a share of the larger; 0 where there is no first failure, 1 from the ideal."""
        if self.upper is None:
            return 0.0
        if self.lower is None:
            return 1.0
        return abs(self.upper - self.lower) / max(abs(self.upper), abs(self.lower))


def open_from_ideal(counts: Mapping[float, Count], found: Bracket) -> bool:
    """Whether a conclusion is not shown from the first level on, and runs there do not refute it either.

    Its margin is then not known: runs nearer to the ideal world would most likely leave it open too.

    Parameters
    ----------
    counts
        Counts by level.
    found
        Their bracket.
    """
    return found.lower is None and found.upper is not None and counts[found.upper].failed == 0


def bracket(counts: Mapping[float, Count], share: float, *, falling: bool = False) -> Bracket:
    """The bracket that counts show.

    Parameters
    ----------
    counts
        Counts by level.
    share
        Share of the runs that must show the conclusion.
    falling
        Whether smaller levels are further from the ideal one.
    """
    levels = sorted(counts, reverse=falling)
    first = next((k for k, level in enumerate(levels) if not counts[level].shown(share)), None)
    if first is None:
        return Bracket(levels[-1] if levels else None, None)
    again = tuple(level for level in levels[first + 1 :] if counts[level].shown(share))
    return Bracket(levels[first - 1] if first else None, levels[first], again)


def between(found: Bracket, *, falling: bool = False) -> float | None:
    """A level inside a bracket, in few digits; None where there is none.

    Parameters
    ----------
    found
        The bracket.
    falling
        Whether smaller levels are further from the ideal one.
    """
    lower, upper = found.lower, found.upper
    if upper is None or (upper == 0.0 and lower is None):
        return None
    if lower is None:
        middle = upper * STEP_TO_IDEAL if falling else upper / STEP_TO_IDEAL
        return float(f"{middle:.{DIGITS}g}")
    middle = math.sqrt(lower * upper) if lower * upper > 0 else (lower + upper) / 2
    low, high = sorted((lower, upper))
    short = float(f"{middle:.{DIGITS}g}")
    for found_level in (short, middle):
        if low < found_level < high:
            return found_level
    return None


def islands(found: Bracket, levels: Sequence[float], *, falling: bool = False) -> list[tuple[float, float]]:
    """Runs of neighbouring ``levels`` beyond the first failure of ``found`` at which the conclusion is shown again.

    Parameters
    ----------
    falling
        Whether smaller levels are further from the ideal one.
    """
    again, spans = set(found.again), []
    begin = end = None
    for level in sorted(levels, reverse=falling):
        if level in again:
            begin, end = (level if begin is None else begin), level
        elif begin is not None and end is not None:
            spans.append((begin, end))
            begin = None
    if begin is not None and end is not None:
        spans.append((begin, end))
    return spans
