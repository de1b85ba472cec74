"""Times of what is repeated, as whole nanoseconds from the start: ties between schedules are compared exactly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flocking.errors import InvalidInput
from flocking.formula.safe_digits import compared_texts
from flocking.model.checks import Array, scalar_or_each

NANOSECOND = 1e-9
"""Seconds in a nanosecond."""

PER_SECOND = 1_000_000_000
"""Nanoseconds in a unit of time."""

LONGEST = 1e8
"""Longest period, delay or phase: about three years in seconds, which leaves the sums of such times within 64 bits."""

COARSEST = 1e-4
"""Largest share of a time by which whole nanoseconds may miss it: times of 5 microseconds and longer always
pass; a shorter one that is rounded by more is another time."""

Instants = NDArray[np.int64]
"""Times as whole nanoseconds from the start."""


def nanoseconds(owner: str, name: str, value: float | Array, *, positive: bool = False) -> Instants:
    """Times as whole nanoseconds, rounded to the nearest.

    Parameters
    ----------
    owner, name
        The part and its parameter, for messages.
    value
        One time for all agents, or one for each.
    positive
        Whether zero is refused.

    Raises
    ------
    InvalidInput
        When a time is negative or longer than `LONGEST`, or whole nanoseconds miss one that must be positive by more
        than `COARSEST` of it.
    """
    found = np.asarray(scalar_or_each(owner, name, value, least=0.0), dtype=np.float64)
    if not found.size:
        raise InvalidInput(owner, name, "must be a number, or one for each agent", "no value")
    if (found > LONGEST).any():
        raise InvalidInput(owner, name, f"must be at most {LONGEST:g}", float(found.max()))
    nanoseconds = np.rint(found * PER_SECOND).astype(np.int64)
    if positive and (nanoseconds < 1).any():
        raise InvalidInput(owner, name, f"must be at least {NANOSECOND:g}", float(found.min()))
    missed = np.abs(found * PER_SECOND - nanoseconds)
    # Phases and delays may be as short as one likes beside a period.
    if positive and (coarse := missed > COARSEST * found * PER_SECOND).any():
        raise InvalidInput(
            owner, name, "must be a whole number of 1e-9 to one part in 10,000: ticks are counted in these",
            float(found[coarse].flat[0]), "Choose a smaller unit of time, so that periods are larger numbers.",
        )  # fmt: skip
    return np.asarray(nanoseconds)


def span(values: ArrayLike) -> str:
    """One number of all agents in a few digits, or the smallest and the largest, in as many as distinguish them.

    Parameters
    ----------
    values
        One number, or one for each agent.
    """
    found = np.asarray(values, dtype=np.float64)
    return " to ".join(dict.fromkeys(compared_texts(found.min(), found.max(), digits=6)))


def shared_times(*times: float | Array) -> tuple[int, ...] | None:
    """Times in nanoseconds that all agents share, such as a period and a phase; None where they differ.

    Parameters
    ----------
    times
        In the unit of time, each one for all agents or one for each.
    """
    found = [np.unique(np.rint(np.asarray(x, dtype=np.float64) / NANOSECOND)) for x in times]
    return None if max(len(x) for x in found) > 1 else tuple(int(x[0]) for x in found)


@dataclass(frozen=True, eq=False)
class PeriodicTimes:
    """What agents do at the times ``phase + k period``, k = 0, 1, ...

    Parameters
    ----------
    period, phase
        Of every agent, in nanoseconds, shape (N,).
    """

    period: Instants
    phase: Instants

    def at(self, agents: NDArray[np.integer], k: Instants) -> Instants:
        """When ``agents`` do it the ``k``-th time, counted from 0."""
        found: Instants = self.phase[agents] + k * self.period[agents]
        return found

    @property
    def alike(self) -> bool:
        """Whether all agents do it at the same times."""
        return bool((self.period == self.period[0]).all() and (self.phase == self.phase[0]).all())

    @property
    def of_one(self) -> PeriodicTimes:
        """The times of the first agent."""
        return PeriodicTimes(self.period[:1], self.phase[:1])

    def falls_on(self, time: int) -> NDArray[np.bool_]:
        """Whether every agent does it at ``time``, shape (N,)."""
        return np.asarray((time >= self.phase) & ((time - self.phase) % self.period == 0))

    def count_until(self, time: int | Instants) -> Instants:
        """How often every agent has done it until ``time``, one or one for each, that time included, shape (N,)."""
        found: Instants = np.asarray(
            np.where(time < self.phase, 0, (time - self.phase) // self.period + 1), dtype=np.int64
        )
        return found
