"""Instants at which samples are taken, messages arrive and samples expire: steps end there, and knowledge jumps."""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable
from copy import copy
from typing import NamedTuple

import numpy as np

from flocking.arrays import Array, Indices, Links
from flocking.engine.archives.archive import Arrays
from flocking.engine.archives.data_checks import Form, Table
from flocking.engine.delayed.breaking_points import BreakingPoints
from flocking.engine.delayed.messages.leader_samples import LeaderSamples
from flocking.engine.imperfect.checkpoint_form import MOST_COUNT, ROUNDED, must
from flocking.engine.imperfect.messages.checkpoint_form import (
    check_newest,
    check_samples,
    knowledge_arrays,
    knowledge_forms,
    recall_knowledge,
)
from flocking.engine.imperfect.messages.knowledge import NEVER, Knowledge
from flocking.model.world.times import NANOSECOND, PER_SECOND, Instants

BEFORE = -1
"""In place of the last instant: the one before the start."""


class Heard(NamedTuple):
    """What is known otherwise from an instant on.

    Parameters
    ----------
    states
        Entry (i, j) is whether agent i knows another state of agent j from now on, or none any more, or one again;
        entry (i, i) whether it knows itself by another sample. Shape (N, N).
    leaders
        Who knows leaders by another sample, shape (N,).
    """

    states: Links
    leaders: Links


class MessageInstants(BreakingPoints):
    """Instants at which what agents know may change, and what they know.

    Parameters
    ----------
    knowledge
        What they know.
    leaders
        Samples of leaders; None where these are known exactly.

    Attributes
    ----------
    heard
        The last instant that was taken up, in nanoseconds; `BEFORE` at first.
    there
        Of whom each agent knows a state, shape (N, N).
    """

    largest = 0.0

    def __init__(self, knowledge: Knowledge, leaders: LeaderSamples | None = None) -> None:
        self.knowledge, self.leaders = knowledge, leaders
        self.heard = BEFORE
        self.there: Links = np.ones((knowledge.n, knowledge.n), dtype=bool)
        self._coming: list[tuple[int, int, int, int]] = []
        """Heap of instants at which samples arrive, and of whom: receiver, sender and number."""
        self._ends = self._expiry()

    def of(self, knowledge: Knowledge) -> MessageInstants:
        """These instants of a copy of what agents know.

        Parameters
        ----------
        knowledge
            The copy.
        """
        other = copy(self)
        other.knowledge, other._coming = knowledge, list(self._coming)
        other.leaders = None if self.leaders is None else self.leaders.of(knowledge)
        return other

    def jump(self, seconds: float, agents: Indices, known_links: Links) -> None:
        """Nothing: a force that jumps is known to others by samples alone."""

    def reach(self, seconds: float, known_links: Links) -> None:
        """Nothing: see `hear`."""

    def following(self, seconds: float, known_links: Links) -> float:
        """The next instant; all until now have been taken up."""
        found = self.next
        return found * NANOSECOND if found < NEVER else math.inf

    @property
    def next(self) -> int:
        """The next instant, in nanoseconds; `NEVER` where there is none."""
        if self.heard == BEFORE:
            return 0
        coming = self._coming[0][0] if self._coming else NEVER
        led = NEVER if self.leaders is None else self.leaders.next
        return min(int(self.knowledge.next_sample.min()), coming, led, self._ends)

    def hear(self, instant: int, seen: Callable[[], tuple[Array, Array]]) -> Heard:
        """Take up an instant: samples are taken, then they arrive, then they expire.

        Parameters
        ----------
        instant
            In nanoseconds.
        seen
            Gives true positions and velocities of all agents then, before forces change, shape (N, m) each.

        Returns
        -------
        Heard
            What is known otherwise from now on.
        """
        knowledge = self.knowledge
        assert knowledge.messages is not None
        changed = np.zeros((knowledge.n, knowledge.n), dtype=bool)
        measuring = np.flatnonzero(knowledge.next_sample == instant)
        if measuring.size:
            q, p = seen()
            everyone = q if knowledge.reads_distances else None
            knowledge.measure(measuring, q[measuring], p[measuring], everyone)
            for sender in measuring.tolist():
                self._expect(sender, np.array([knowledge.taken[sender] - 1]))
            if knowledge.messages.self_known == "measured":
                changed[measuring, measuring] = True
            if self.leaders is not None:
                self.leaders.measure(instant)
        receivers: set[int] = set()
        while self._coming and self._coming[0][0] <= instant:
            receivers.add(heapq.heappop(self._coming)[1])
        if receivers:
            agents = np.array(sorted(receivers))
            before = knowledge.newest[agents].copy()
            knowledge.hear(instant, agents)
            changed[agents] |= knowledge.newest[agents] != before
            # What a later sample has overtaken changes nothing; a session that goes on from a checkpoint lacks it.
            while self._coming and self._coming[0][3] <= knowledge.newest[self._coming[0][1:3]]:
                heapq.heappop(self._coming)
        there = self._there(instant)
        changed |= there != self.there
        self.there, self.heard = there, instant
        self._ends = self._expiry()
        nobody = np.zeros(knowledge.n, dtype=bool)
        return Heard(changed, nobody if self.leaders is None else self.leaders.hear(instant))

    def _expect(self, sender: int, numbers: Instants) -> None:
        """Take up when samples of a ``sender`` arrive at all others."""
        knowledge = self.knowledge
        receivers = np.delete(np.arange(knowledge.n), sender)
        receiver, k = (x.ravel() for x in np.broadcast_arrays(receivers[:, None], numbers))
        later = k > knowledge.newest[receiver, sender]
        receiver, k = receiver[later], k[later]
        times = knowledge.arrivals(receiver, np.full(len(k), sender), k)
        for time, agent, number in zip(times.tolist(), receiver.tolist(), k.tolist(), strict=True):
            if time < NEVER:
                heapq.heappush(self._coming, (time, agent, sender, number))

    def _begun(self) -> Instants:
        """When the samples in use were taken, shape (N, N)."""
        return self.knowledge.begun(
            np.broadcast_to(np.arange(self.knowledge.n), self.there.shape), self.knowledge.newest
        )

    @property
    def _age(self) -> int | None:
        """Age at which samples expire, in nanoseconds; None where they do not."""
        return None if self.knowledge.messages is None else self.knowledge.messages.expires_in_nanoseconds

    def _there(self, instant: int) -> Links:
        if self._age is None:
            return self.there
        found: Links = instant - self._begun() < self._age
        np.fill_diagonal(found, True)
        return found

    def _expiry(self) -> int:
        """When the next sample in use expires, in nanoseconds."""
        if self._age is None:
            return NEVER
        others = self.there & ~np.eye(len(self.there), dtype=bool)
        return int((self._begun() + self._age).min(where=others, initial=NEVER))

    # Saving.

    def arrays(self) -> Arrays:
        """What agents know, and the last instant; what is on its way follows from it."""
        led = {} if self.leaders is None else self.leaders.arrays()
        return {**knowledge_arrays(self.knowledge), "heard": np.array([self.heard], dtype=np.int64), **led}

    def forms(self, n: int) -> dict[str, Form[object]]:
        """Samples of ``n`` agents, and the last instant."""
        led = {} if self.leaders is None else self.leaders.forms()
        heard: Form[object] = Table("i8", (1,), least=BEFORE, most=MOST_COUNT)
        return {**knowledge_forms(self.knowledge)[0], "heard": heard, **led}

    def later_forms(self) -> dict[str, Form[object]]:
        """Errors of samples, which are there once one was taken."""
        return knowledge_forms(self.knowledge)[1]

    def recall(self, arrays: Arrays) -> None:
        """Take what agents know, if it is what the schedule states until the last instant."""
        knowledge, heard = self.knowledge, int(arrays["heard"][0])
        end = float(arrays["times"][-1]) * PER_SECOND
        slack = 1.0 + ROUNDED * end
        must(heard <= end + slack, "heard", "not lie after the last step")
        schedule, taken = knowledge.schedule, arrays["taken"]
        assert schedule is not None
        counts = schedule.count_until(heard) if heard > BEFORE else np.zeros(knowledge.n, dtype=np.int64)
        must((taken == counts).all(), "taken", "agree with the schedule of the scenario until the last instant")
        check_samples(arrays, knowledge)
        if heard > BEFORE:
            check_newest(arrays, knowledge, np.arange(knowledge.n), np.full(knowledge.n, heard))
        else:
            must((arrays["newest"] < 0).all(), "newest", "name no samples before the start")
        recall_knowledge(knowledge, arrays)
        self.heard, self._coming = heard, []
        self.there = self._there(max(heard, 0))
        self._ends = self._expiry()
        others = np.where(np.eye(knowledge.n, dtype=bool), NEVER, knowledge.newest)
        # Of a single agent nobody has a sample.
        for sender, oldest in enumerate(np.minimum(others.min(axis=0), taken - 1).tolist()):
            self._expect(sender, np.arange(oldest + 1, taken[sender]))
        if self.leaders is not None:
            self.leaders.recall(arrays, heard)
        must(self.next >= end - slack, "heard", "be the last instant before the end of the last step")
