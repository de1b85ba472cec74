"""Times at which the state of a running group was replaced, so that its past jumps, and when others know of it.

What an agent knows of another one jumps a delay after the state itself. A time lies on one side of a jump or on the
other, and rounding of `time - delay` must not decide on which: a step begins after all jumps that are known at its
beginning, and reads the past from there on, up to the next jump, which is known after its end at the earliest.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from flocking.arrays import Array, Indices, Links
from flocking.engine.archives.archive import Arrays
from flocking.engine.archives.data_checks import Form, Table
from flocking.engine.delayed.history import History
from flocking.engine.imperfect.checkpoint_form import must


class Windows(NamedTuple):
    """The steps of the past that may be read on a step.

    Parameters
    ----------
    first, last
        Numbers of the first and the last one by which each agent, by row, knows each other one, by column, shape
        (N, N); -1 is the line before the start. Without entries everything may be read.
    """

    first: Indices
    last: Indices

    def of(self, senders: Indices, sensed: Indices) -> Windows:
        """Those of pairs, shape (pairs,); without entries where there are none.

        Parameters
        ----------
        senders, sensed
            The agent of each pair that knows, and the one that is known.
        """
        if not self.first.size:
            return NO_WINDOWS
        return Windows(self.first[senders, sensed], self.last[senders, sensed])


EVERYTHING = Windows(np.zeros((0, 0), dtype=np.int64), np.zeros((0, 0), dtype=np.int64))
"""Windows where no state was replaced: all steps are read."""

NO_WINDOWS = Windows(np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64))
"""The same of a list of pairs."""


class StateJumps:
    """Replacements of the state that somebody does not know of yet.

    Parameters
    ----------
    n
        Number of agents.
    delays_of
        Delays with which all agents, by row, know some, by column, shape (N, agents), themselves included.

    Attributes
    ----------
    times
        When states were replaced, in seconds from the start, in order, shape (jumps,).
    agents
        Whose state was, shape (jumps, N).
    """

    def __init__(self, n: int, delays_of: Callable[[Indices], Array]) -> None:
        self._n, self._delays_of = n, delays_of
        self.times, self.agents = np.zeros(0), np.zeros((0, n), dtype=bool)

    def copy(self) -> StateJumps:
        """An independent copy."""
        other = StateJumps(self._n, self._delays_of)
        other.times, other.agents = self.times, self.agents
        return other

    def add(self, seconds: float, agents: Links) -> None:
        """Take up a jump.

        Parameters
        ----------
        seconds
            When, not before the jumps that there are.
        agents
            Whose state jumps, shape (N,).
        """
        if not agents.any():
            return
        if len(self.times) and self.times[-1] == seconds:
            self.agents = np.concatenate([self.agents[:-1], self.agents[-1:] | agents])
            return
        self.times = np.append(self.times, seconds)
        self.agents = np.concatenate([self.agents, agents[None]])

    def forget(self, seconds: float, rounding: float, largest: float) -> None:
        """Drop jumps that everybody has known of for a delay at a time: the past as it is kept has none of them.

        Parameters
        ----------
        seconds, rounding
            The time, and differences of times that count as none.
        largest
            The largest delay.
        """
        if len(self.times):
            left = self.times + 2.0 * largest >= seconds - 2.0 * rounding
            self.times, self.agents = self.times[left], self.agents[left]

    def following(self, seconds: float, rounding: float) -> float:
        """The next time at which somebody comes to know of a jump; infinite where there is none.

        Parameters
        ----------
        seconds, rounding
            As for `forget`.
        """
        times = (times.min(where=times > seconds + rounding, initial=math.inf) for _, times in self._known_from())
        return float(min(times, default=math.inf))

    def at_once(self, agents: Links) -> Links:
        """Pairs whose distance, as the first one knows it, jumps as soon as states do, shape (N, N).

        Parameters
        ----------
        agents
            Whose state jumps, shape (N,).
        """
        found, whose = np.zeros((self._n, self._n), dtype=bool), np.flatnonzero(agents)
        found[:, whose] = self._delays_of(whose) == 0.0
        return found | found.diagonal()[:, None]

    def arriving(self, seconds: float, rounding: float) -> Links:
        """Pairs whose distance, as the first one knows it, jumps at a time because of a jump before, shape (N, N).

        Parameters
        ----------
        seconds, rounding
            As for `forget`.
        """
        found = np.zeros((self._n, self._n), dtype=bool)
        for agents, times in self._known_from():
            found[:, agents] |= np.abs(times - seconds) <= rounding
        return found | found.diagonal()[:, None]

    def windows(self, history: History, seconds: float, rounding: float) -> Windows:
        """The first and the last step of the past that each agent may read of each other one on a step, shape (N, N).

        -1 stands for the line before the start. Without jumps the arrays have no entries: everything may be read.

        Parameters
        ----------
        history
            The past.
        seconds, rounding
            When the step begins, and differences of times that count as none.
        """
        if not len(self.times):
            return EVERYTHING
        first = np.full((self._n, self._n), -1, dtype=np.int64)
        last = np.full((self._n, self._n), len(history.segments) - 1, dtype=np.int64)
        each = [
            (*history.steps_beside(float(t)), *known) for t, known in zip(self.times, self._known_from(), strict=True)
        ]
        for before, after, agents, times in each:
            first[:, agents] = np.where(times <= seconds + rounding, after, first[:, agents])
            # The first jump that is not known yet is the first one in order that is found.
            unknown = (times > seconds + rounding) & np.isfinite(times)
            last[:, agents] = np.where(unknown, np.minimum(before, last[:, agents]), last[:, agents])
        return Windows(first, last)

    def arrays(self) -> Arrays:
        """The jumps as named arrays; none where there are none."""
        return {"replaced": self.times, "replaced_agents": self.agents} if len(self.times) else {}

    @staticmethod
    def forms(arrays: Arrays, n: int) -> dict[str, Form[object]]:
        """Forms of these arrays, for ``n`` agents, if there are any."""
        if "replaced" not in arrays:
            return {}
        return {"replaced": Table("f8", (None,), least=0.0), "replaced_agents": Table("?", (None, n))}

    def recall(self, arrays: Arrays, now: float) -> None:
        """Take what `arrays` gave, after its checks.

        Parameters
        ----------
        now
            The end of the last step.

        Raises
        ------
        MalformedError
            When it is not that.
        """
        if "replaced" not in arrays:
            return
        times, agents = arrays["replaced"], arrays["replaced_agents"]
        must(0 < len(times) == len(agents) and agents.any(axis=1).all(), "replaced", "have agents at every time")
        must((np.diff(times) > 0.0).all() and times[-1] <= now, "replaced", "ascend to the end of the last step")
        self.times, self.agents = times, agents

    def _known_from(self) -> Iterator[tuple[Indices, Array]]:
        """Of each jump its agents, and when all agents know of these, shape (N, agents); infinite for at once."""
        for t, whose in zip(self.times, self.agents, strict=True):
            agents = np.flatnonzero(whose)
            late = self._delays_of(agents)
            yield agents, np.where(late > 0.0, t + late, math.inf)
