"""Samples of leaders under continuous control: which one each agent uses, and those on their way."""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from copy import copy

import numpy as np

from flocking.arrays import Array, Indices, Links
from flocking.engine.archives.archive import Arrays
from flocking.engine.archives.data_checks import Form, Table
from flocking.engine.imperfect.checkpoint_form import MOST_COUNT, must
from flocking.engine.imperfect.messages.checkpoint_form import vectors
from flocking.engine.imperfect.messages.knowledge import NEVER, Knowledge
from flocking.engine.imperfect.messages.leader_news import arrivals_as_sent
from flocking.engine.imperfect.messages.samples import START
from flocking.model.known_leaders import PARTS, moved_on
from flocking.model.leaders_and_obstacles.leaders import Leader
from flocking.model.world.times import NANOSECOND, Instants


class LeaderSamples:
    """Samples of the leaders of a law, which are taken when agents take theirs, and what agents know by them.

    Parameters
    ----------
    leaders
        The leaders.
    knowledge
        How messages are sent, and how many samples were taken.
    base
        The scenario's time at the start.

    Attributes
    ----------
    leaders
        The leaders whose motion is sampled from now on.
    newest
        Number of the sample that each agent uses, -1 for the state at the start, shape (N,).
    """

    def __init__(self, leaders: Sequence[Leader], knowledge: Knowledge, base: float) -> None:
        self.leaders, self._knowledge, self._base = tuple(leaders), knowledge, base
        self.newest: Instants = np.full(knowledge.n, START, dtype=np.int64)
        self._start = self._moving(0)
        self._samples: dict[int, Array] = {}
        """Motions of all leaders by the number of the sample, shape (leaders, 3, m), as far back as one is used."""
        self._coming: list[tuple[int, int, int]] = []
        """Heap of instants at which samples arrive: receiver and number."""
        self.prepare()

    def of(self, knowledge: Knowledge) -> LeaderSamples:
        """These samples beside a copy of what agents know.

        Parameters
        ----------
        knowledge
            The copy.
        """
        other = copy(self)
        other._knowledge, other.newest = knowledge, self.newest.copy()
        other._samples, other._coming = dict(self._samples), list(self._coming)
        return other

    def _moving(self, instant: int) -> Array:
        """Motions of all leaders at an instant, shape (leaders, 3, m)."""
        t = self._base + instant * NANOSECOND
        found = np.array([leader.at(t) for leader in self.leaders])
        return np.asarray(found, dtype=np.float64).reshape(len(self.leaders), len(PARTS), self._knowledge.m)

    @property
    def next(self) -> int:
        """When the next sample arrives somewhere, in nanoseconds; `NEVER` where none is on its way."""
        return self._coming[0][0] if self._coming else NEVER

    @property
    def _taken(self) -> int:
        """How many samples have been taken: agents take theirs at the same instants."""
        return int(self._knowledge.taken[0])

    def measure(self, instant: int) -> None:
        """Take the sample that is due at an ``instant``, in nanoseconds, after agents have taken theirs."""
        number = self._taken - 1
        self._samples[number] = self._moving(instant)
        self._expect(np.array([number]))

    def _expect(self, numbers: Instants) -> None:
        """Take up when samples of these numbers arrive."""
        everyone = np.arange(self._knowledge.n)[:, None]
        receiver, k = (x.ravel() for x in np.broadcast_arrays(everyone, numbers))
        later = k > self.newest[receiver]
        receiver, k = receiver[later], k[later]
        times = self._arrivals(receiver, k)
        for time, agent, number in zip(times.tolist(), receiver.tolist(), k.tolist(), strict=True):
            if time < NEVER:
                heapq.heappush(self._coming, (time, agent, number))

    def _arrivals(self, receiver: Indices, k: Instants) -> Instants:
        """When samples arrive, in nanoseconds, by the settings under which each was sent; `NEVER` where lost."""
        return arrivals_as_sent(self._knowledge.settings, [int(x[0]) for x in self._knowledge.since], receiver, k)

    def hear(self, instant: int) -> Links:
        """Take up what arrives at an ``instant``, in nanoseconds; who uses another sample from now on, shape (N,)."""
        before = self.newest.copy()
        # What a later sample has overtaken changes nothing; a session that goes on from a checkpoint lacks it.
        while self._coming and (self._coming[0][0] <= instant or self._coming[0][2] <= self.newest[self._coming[0][1]]):
            _, agent, number = heapq.heappop(self._coming)
            self.newest[agent] = max(self.newest[agent], number)
        changed: Links = self.newest != before
        if changed.any():
            for number in [k for k in self._samples if k < self.newest.min()]:
                del self._samples[number]
        return changed

    def prepare(self) -> None:
        """Take up what agents know from now on."""
        rows = [self._start if k == START else self._samples[k] for k in self.newest.tolist()]
        self._known = np.array(rows).transpose(1, 2, 3, 0)
        self._begun = np.asarray(self._begin(self.newest) * NANOSECOND, dtype=np.float64)

    def _begin(self, numbers: Instants) -> Instants:
        """When samples were taken, in nanoseconds."""
        return self._knowledge.begun(np.zeros(len(numbers), dtype=np.int64), numbers)

    def motions(self, seconds: float) -> list[Array]:
        """Motion of each leader as every agent takes it to be, shape (3, m, N) each.

        Parameters
        ----------
        seconds
            Now, since the start.
        """
        predict = bool(self._knowledge.degree)
        ages: Array = seconds - self._begun
        return [moved_on(motion, ages, predict=predict) for motion in self._known]

    # Saving.

    def arrays(self) -> Arrays:
        """The samples that are used or on their way, and who uses which."""
        rows = [self._samples[k] for k in sorted(self._samples)]
        return {
            "leader_newest": self.newest, "leader_start": self._start,
            "leader_rows": np.array(rows).reshape(-1, *self._start.shape),
        }  # fmt: skip

    def forms(self) -> dict[str, Form[object]]:
        """Forms of these arrays."""
        shape = self._start.shape
        return {
            "leader_newest": Table("i8", (self._knowledge.n,), least=START, most=MOST_COUNT),
            "leader_start": vectors(*shape), "leader_rows": vectors(None, *shape),
        }  # fmt: skip

    def recall(self, arrays: Arrays, heard: int) -> None:
        """Take samples that were stored, if they are those of the schedule until the last instant.

        Parameters
        ----------
        arrays
            What was read, of these forms; what agents know of each other has been taken.
        heard
            The last instant that was taken up, in nanoseconds.

        Raises
        ------
        MalformedError
            When they are not.
        """
        newest, rows, taken = arrays["leader_newest"], arrays["leader_rows"], self._taken
        must((newest < max(taken, 0)).all(), "leader_newest", "name samples that were taken")
        first = max(int(newest.min()), 0)
        must(len(rows) == taken - first, "leader_rows", "be the samples that are used or on their way")
        numbers = np.arange(first, taken)
        if "replaced_at" not in arrays:
            declared = [self._moving(instant) for instant in self._begin(numbers).tolist()]
            must((arrays["leader_start"] == self._start).all(), "leader_start", "be the motion at the start")
            must(all((a == b).all() for a, b in zip(rows, declared, strict=True)), "leader_rows",
                 "be the motion of leaders")  # fmt: skip
        self.newest, self._start = newest, arrays["leader_start"]
        self._samples = dict(zip(numbers.tolist(), rows, strict=True))
        self._coming = []
        everyone = np.arange(self._knowledge.n)
        named = newest > START
        arrived = self._arrivals(everyone[named], newest[named]) <= heard
        must(arrived.all(), "leader_newest", "name samples that have arrived")
        self._expect(numbers)
        must(self.next > heard, "leader_newest", "name the newest samples that have arrived")
        self.prepare()
