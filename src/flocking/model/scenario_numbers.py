"""Validation of the end, the frames and the tolerance of a scenario."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import array, integer, number

LARGEST_TOLERANCE = 0.1
"""Bound on the tolerance: at a tenth the solution has no correct digit."""

MOST_FRAMES = 10_000_000
"""Largest number of frames at even times; a list of times has no limit."""


def checked_end(t_end: object, start: float) -> float:
    """The end ``t_end`` of a run that starts at time ``start``.

    Raises
    ------
    InvalidInput
        If it is before the start.
    """
    end = number("Scenario", "t_end", t_end)
    if end < start:
        raise InvalidInput("Scenario", "t_end", f"must be at least {start!r}, the time of the start", end)
    return end


def checked_tolerance(tolerance: object) -> float:
    """The tolerance of the adaptive engine.

    Raises
    ------
    InvalidInput
        If it is not between 0 and 0.1.
    """
    return number("Scenario", "tolerance", tolerance, above=0.0, below=LARGEST_TOLERANCE)


def checked_frames(frames: int | Sequence[float], start: float, end: float) -> int | tuple[float, ...]:
    """The number of frames, or their times between ``start`` and ``end``.

    Raises
    ------
    InvalidInput
        If the number is invalid or too large, or the times are out of order.
    """
    if isinstance(frames, int | np.integer) or np.ndim(frames) == 0:
        count = integer("Scenario", "frames", frames, least=1)
        if count > MOST_FRAMES:
            rule = f"must be at most {MOST_FRAMES}"
            raise InvalidInput("Scenario", "frames", rule, count, "Give the times for more.")
        return count
    times = array("Scenario", "frames", frames, ndim=1)
    if len(times) == 0 or (np.diff(times) <= 0).any() or times[0] < start or times[-1] > end:
        raise InvalidInput("Scenario", "frames", "must be ascending times between the start and t_end", frames)
    return tuple(float(t) for t in times)
