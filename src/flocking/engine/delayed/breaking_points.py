"""Times at which some derivative of a delayed motion jumps, because a force did a delay or several before.

A jump of a force comes back to all who know the agent, each time a derivative higher. Steps end where it does, so that
the polynomials of the steps are of smooth motions, until steps of order 8 do not notice it any more.
"""

from __future__ import annotations

import heapq
import math
from abc import ABC, abstractmethod
from copy import copy
from typing import Self

import numpy as np

from flocking.arrays import Array, Indices, Links
from flocking.engine.archives.archive import Arrays
from flocking.engine.archives.data_checks import Form, Table
from flocking.engine.imperfect.checkpoint_form import must

GENERATIONS = 8
"""How often a jump of a force comes back, each time a derivative higher, until steps of order 8 do not notice it."""

GENERATIONS_OF_PAIRS = 3
"""How often it is followed where delays differ: times are sums of delays, which multiply. Later generations are jumps
of high derivatives, which steps are shortened for as the tolerance asks."""

SAME_TIME = 1e-12
"""Breaking points closer than this, relative to the largest delay and the time, are one."""

APART = 0.05
"""Of the second generation on, breaking points that follow another one sooner than this share of the least delay are
not followed where delays differ, so that the least delay has 20 of them at most; the first generation is always
followed. Measured on four random worlds of the tests, residuals of the ledger were up to 1.5 times the tolerance with
this share, up to 20 times with 0.25, and up to 12 times without the third generation."""


class BreakingPoints(ABC):
    """Times at which steps must end, in seconds from the start."""

    largest: float
    """The largest delay."""

    def rounding(self, seconds: float) -> float:
        """Differences of times near ``seconds`` that count as none."""
        return SAME_TIME * (self.largest + abs(seconds))

    def copy(self) -> Self:
        """An independent copy."""
        other = copy(self)
        other.recall(self.arrays())
        return other

    @abstractmethod
    def jump(self, seconds: float, agents: Indices, known_links: Links) -> None:
        """Take up that the forces of ``agents`` jump at a time.

        Parameters
        ----------
        seconds
            The time.
        known_links
            Links by what agents know after it, shape (graphs, N, N).
        """

    @abstractmethod
    def reach(self, seconds: float, known_links: Links) -> None:
        """Take up that a step ended at a time.

        Parameters
        ----------
        seconds, known_links
            As for `jump`.
        """

    @abstractmethod
    def following(self, seconds: float, known_links: Links) -> float:
        """The next breaking point after a time; infinite where there is none.

        Parameters
        ----------
        seconds, known_links
            As for `jump`.
        """

    @abstractmethod
    def arrays(self) -> Arrays:
        """All that is ahead as named arrays."""

    @abstractmethod
    def forms(self, n: int) -> dict[str, Form[object]]:
        """Forms of these arrays, for ``n`` agents."""

    def later_forms(self) -> dict[str, Form[object]]:
        """Forms of those that are not there at first."""
        return {}

    @abstractmethod
    def recall(self, arrays: Arrays) -> None:
        """Take what `arrays` gave, after its checks.

        Raises
        ------
        MalformedError
            When it is not that.
        """


class OneDelayPoints(BreakingPoints):
    """Breaking points where everybody is known equally late: 1 to 8 delays after each jump.

    Parameters
    ----------
    tau
        The delay.
    """

    def __init__(self, tau: float) -> None:
        self.largest = tau
        self.times: list[float] = []

    def jump(self, seconds: float, agents: Indices, known_links: Links) -> None:
        """Let steps end where a jump of the forces at a time comes back."""
        for k in range(1, GENERATIONS + 1):
            at = seconds + k * self.largest
            if all(abs(at - other) > self.rounding(at) for other in self.times):
                heapq.heappush(self.times, at)

    def reach(self, seconds: float, known_links: Links) -> None:
        """Drop the times that are reached."""
        while self.times and self.times[0] - seconds <= self.rounding(seconds):
            heapq.heappop(self.times)

    def following(self, seconds: float, known_links: Links) -> float:
        """The next time."""
        return self.times[0] if self.times else math.inf

    def arrays(self) -> Arrays:
        """The times in order."""
        return {"breaks": np.array(sorted(self.times))}

    def forms(self, n: int) -> dict[str, Form[object]]:
        """Times, however many."""
        return {"breaks": Table("f8", (None,), least=0.0)}

    def recall(self, arrays: Arrays) -> None:
        """Take the times."""
        must((np.diff(arrays["breaks"]) > 0.0).all(), "breaks", "be in order")
        self.times = arrays["breaks"].tolist()


class PairPoints(BreakingPoints):
    """Breaking points where every pair has a delay of its own.

    What is kept are the jumps. One of agent j reaches agent i a time tau[i, j] later, if i is linked to j then, as a
    jump of the next derivative, which reaches others in turn; without a delay it does so at once.

    Parameters
    ----------
    tau
        Delays with which agents, by row, know others, by column, shape (N, N); the diagonal is how late they know
        themselves.
    """

    def __init__(self, tau: Array) -> None:
        positive = tau[tau > 0.0]
        self._tau, self.largest = tau, float(positive.max())
        least = float(positive.min())
        equal = self.largest - least <= SAME_TIME * self.largest
        self._generations = GENERATIONS if equal else GENERATIONS_OF_PAIRS
        self._apart = 0.0 if equal else APART * least
        self._late, self._present = tau > 0.0, (tau == 0.0) & ~np.eye(len(tau), dtype=bool)
        self._own = np.diag(tau.diagonal() > 0.0)
        self._times, self._jumps = np.zeros(0), np.zeros((0, 2), dtype=np.int64)

    def jump(self, seconds: float, agents: Indices, known_links: Links) -> None:
        """Keep the jump, and those of agents that know the present states of these."""
        levels = np.full(len(self._tau), self._generations + 1)
        levels[agents] = 0
        self._keep(seconds, levels, known_links)

    def reach(self, seconds: float, known_links: Links) -> None:
        """Let the jumps that reach somebody now be jumps of theirs, and drop those that reach nobody any more."""
        times, levels = self._arrivals(known_links)
        now = np.abs(times - seconds) <= self.rounding(seconds)
        beyond = self._generations + 1
        self._keep(seconds, np.where(now, levels, beyond).min(axis=0, initial=beyond), known_links)

    def following(self, seconds: float, known_links: Links) -> float:
        """The next time at which a jump reaches an agent that is linked now."""
        times, levels = self._arrivals(known_links)
        ahead = (levels <= self._generations) & (times > seconds + self.rounding(seconds))
        return float(times.min(where=ahead, initial=math.inf))

    def arrays(self) -> Arrays:
        """Times of the jumps, and their agents and generations."""
        return {"breaks": self._times, "jumps": self._jumps}

    def forms(self, n: int) -> dict[str, Form[object]]:
        """Jumps of ``n`` agents, however many."""
        jumps = Table("i8", (None, 2), least=0, most=max(n - 1, self._generations))
        return {"breaks": Table("f8", (None,), least=0.0), "jumps": jumps}

    def recall(self, arrays: Arrays) -> None:
        """Take the jumps."""
        times, jumps = arrays["breaks"], arrays["jumps"]
        must(len(times) == len(jumps), "jumps", "have as many rows as breaks")
        must((np.diff(times) >= 0.0).all(), "breaks", "be in order")
        must((jumps[:, 0] < len(self._tau)).all() and (jumps[:, 1] <= self._generations).all(), "jumps",
             "name agents and generations there are")  # fmt: skip
        self._times, self._jumps = times, jumps

    def _arrivals(self, known_links: Links) -> tuple[Array, Indices]:
        """When each jump reaches each agent, shape (jumps, N), and its generation there, beyond the last where not."""
        agents = self._jumps[:, 0]
        times = self._times[:, None] + self._tau[:, agents].T
        levels = np.broadcast_to(self._jumps[:, 1:] + 1, times.shape)
        last = self._times[-1] if len(self._times) else 0.0
        counts = (self._late & (known_links.any(axis=0) | self._own))[:, agents].T
        counts = counts & ((levels == 1) | (times >= last + self._apart - self.rounding(last)))
        return times, np.where(counts, levels, self._generations + 1)

    def _keep(self, seconds: float, levels: Indices, known_links: Links) -> None:
        """Keep jumps at a time, by the generation of each agent, shape (N,), beyond the last one for none."""
        beyond = self._generations + 1
        at_once = self._present & known_links.any(axis=0)
        for _ in range(self._generations):
            levels = np.minimum(levels, np.where(at_once, levels + 1, beyond).min(axis=1))
        left = self._times + self.largest >= seconds - self.rounding(seconds)
        self._times, self._jumps = self._times[left], self._jumps[left]
        here = np.abs(self._times - seconds) <= self.rounding(seconds)
        for agent, level in self._jumps[here].tolist():
            if level <= levels[agent]:
                levels[agent] = beyond
        new = np.flatnonzero(levels < beyond)
        self._times = np.concatenate([self._times, np.full(len(new), seconds)])
        self._jumps = np.concatenate([self._jumps, np.column_stack([new, levels[new]])])
