"""Lengths of the last steps of a run, and the agents that limit them if they become too short."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from flocking.model.checks import Array

RECENT = 50
"""Number of successive steps that must be short: a single one is cut by a crossing, or by the end of a run."""

USUAL = 0.01
"""The last steps count as usual while the longest of them is at least this share of the mean of all."""

TOO_MANY_STEPS = 1e9
"""Steps are too short if a scenario of this length would take more of them than this."""

STRAINED = 0.5
"""Agents with at least this share of the largest error are named."""

MOST_NAMED = 4
"""Largest number of agents in a message."""


@dataclass(frozen=True)
class Shrunk:
    """Steps so short that a run hardly advances.

    Parameters
    ----------
    step
        The longest of the last steps.
    agents
        The agents that limit it, where known.
    """

    step: float
    agents: tuple[int, ...] = ()

    def __str__(self) -> str:
        return f"steps have shrunk to {self.step:.2g}" + (f", {named(self.agents)}" if self.agents else "")


def named(agents: tuple[int, ...]) -> str:
    """Agents as text; ``agents`` are their numbers, at least one."""
    *first, last = map(str, agents)
    return f"agents {', '.join(first)} and {last}" if first else f"agent {last}"


class StepLengths:
    """The lengths of the last steps of a run; they do not affect later steps.

    Parameters
    ----------
    length
        Duration of the scenario.
    """

    def __init__(self, length: float) -> None:
        self._shortest = (length if length > 0 else 1.0) / TOO_MANY_STEPS
        self._last: deque[float] = deque(maxlen=RECENT)
        self._sum, self._count = 0.0, 0

    def add(self, step: float) -> None:
        """Add a step of length ``step``."""
        self._last.append(step)
        self._sum += step
        self._count += 1

    @property
    def usual(self) -> bool:
        """Whether the last steps are about as long as those before: a run that collapses has not come near its end."""
        return len(self._last) < RECENT or max(self._last) >= USUAL * self._sum / self._count

    @property
    def shrunk_to(self) -> float | None:
        """The longest of the last steps, if all of them were too short to advance."""
        if len(self._last) < RECENT or self._last[-1] >= self._shortest:
            return None
        longest = max(self._last)
        return longest if longest < self._shortest else None


def most_strained(errors: Array) -> tuple[int, ...]:
    """The agents with the largest errors on a step, in ascending order; ``errors`` has shape (N,).

    They are those within `STRAINED` of the largest error.
    """
    sizes = np.where(np.isnan(errors), np.inf, errors)
    if not len(sizes) or sizes.max() == 0.0:
        return ()
    order = np.argsort(-sizes, kind="stable")[:MOST_NAMED]
    return tuple(sorted(int(i) for i in order if sizes[i] >= STRAINED * sizes.max()))
