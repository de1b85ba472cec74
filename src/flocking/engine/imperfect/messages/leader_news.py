"""What agents know of leaders by messages: the newest sample that has arrived at each agent."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flocking.arrays import AnyArray, Array, Indices
from flocking.engine.imperfect.messages.knowledge import NEVER, Knowledge
from flocking.engine.imperfect.messages.samples import START
from flocking.engine.runs.message_log import LEADER, LEADER_SENDER
from flocking.errors import InvalidInput, UnsupportedLaw
from flocking.model.known_leaders import PARTS, moved_on
from flocking.model.law import Law, Scenario
from flocking.model.leaders_and_obstacles.leaders import Leader
from flocking.model.world.information import Messages
from flocking.model.world.random_numbers import NOT_AN_AGENT, Purpose, uniform
from flocking.model.world.times import NANOSECOND, PER_SECOND, Instants


class Replaced(NamedTuple):
    """Leaders of a law that another one has replaced while a run went on.

    Parameters
    ----------
    until
        Number of the first sample of the leaders that came after them.
    leaders
        The leaders.
    """

    until: int
    leaders: tuple[Leader, ...]


def check_leader_messages(engine: str, scenario: Scenario) -> None:
    """Refuse messages of leaders where there is none, or where a term other than a pursuit would read them.

    Parameters
    ----------
    engine
        Name of the engine, for messages.
    scenario
        The scenario.

    Raises
    ------
    InvalidInput
        When the law has no leader.
    UnsupportedLaw
        When it has obstacles.
    """
    information, law = scenario.information, scenario.law
    if not isinstance(information, Messages) or not information.leader:
        return
    if not law.leaders:
        raise InvalidInput("Messages", "leader", "must be left out where no term of the law follows a leader", True)
    if any(getattr(term, "groups", ()) for term in law.body_terms):
        raise UnsupportedLaw(
            f"engine={engine!r} does not know leaders by messages beside obstacles, whose paths and directions are "
            "known exactly. Leave Avoid or leader=True out."
        )


def arrivals_of_leaders(messages: Messages, receiver: Indices, k: Instants) -> Instants:
    """When samples of leaders arrive, in nanoseconds; `NEVER` where they are lost.

    Parameters
    ----------
    messages
        How they are sent.
    receiver, k
        Who receives them, and their numbers, arrays of one shape.
    """
    sender = np.full(np.shape(k), NOT_AN_AGENT)
    period, phase = (round(float(x) * PER_SECOND) for x in (messages.period, messages.phase))
    arrives = phase + k * period + round(messages.delay * PER_SECOND)
    if jitter := round(messages.jitter * PER_SECOND):
        late = uniform(messages.seed, Purpose.JITTER, sender, receiver, k) * jitter
        arrives = arrives + np.rint(late).astype(np.int64)
    if messages.loss is None or messages.loss.ideal:
        return arrives
    return np.where(messages.loss.lost(messages.seed, sender, receiver, k), NEVER, arrives)


def arrivals_as_sent(sent: Sequence[Messages], since: Sequence[int], receiver: Indices, k: Instants) -> Instants:
    """When samples of leaders arrive where how they are sent was changed, in nanoseconds; `NEVER` where they are lost.

    Parameters
    ----------
    sent
        How they were sent, one setting after the other.
    since
        Number of the first sample of each setting but the first.
    receiver, k
        As for `arrivals_of_leaders`.
    """
    found, which = np.empty(len(k), dtype=np.int64), np.searchsorted(since, k, side="right")
    for number, messages in enumerate(sent):
        rows = which == number
        found[rows] = arrivals_of_leaders(messages, receiver[rows], k[rows])
    return found


def check_number_of_leaders(engine: str, before: int, law: Law) -> None:
    """Refuse a law with another number of leaders in place of one whose leaders send messages.

    Parameters
    ----------
    engine
        Name of the engine, for messages.
    before
        How many send them.
    law
        The law that is to act from now on.

    Raises
    ------
    UnsupportedLaw
        When it has another number.
    """
    if len(law.leaders) != before:
        raise UnsupportedLaw(
            f"engine={engine!r} keeps the number of leaders of a law, {before}, while their messages are under way, "
            f"and the law has {len(law.leaders)}. Start another run from run.state(-1)."
        )


class LeaderNews:
    """Samples of the leaders of a law, which are sent together.

    Which sample is the newest one at a time follows from the time and from what was changed: nothing else is stored.

    Parameters
    ----------
    leaders
        The leaders.
    messages
        How they are sent.
    base
        The scenario's time at the start.
    replaced
        Leaders that others have replaced, in order, and the number of the first sample of those that came after them;
        `replace` adds to it.
    """

    def __init__(
        self, leaders: Sequence[Leader], messages: Messages, base: float, replaced: list[Replaced] | None = None
    ) -> None:
        self.leaders, self._base = tuple(leaders), base
        self.replaced: list[Replaced] = [] if replaced is None else replaced
        self._sent, self._since = [messages], list[int]()
        self._predict = messages.predict
        self._period, self._phase = (round(float(x) * PER_SECOND) for x in (messages.period, messages.phase))

    def replace(self, leaders: Sequence[Leader], taken: int) -> None:
        """Let other leaders send what is sampled from now on; what was sampled before arrives all the same.

        Parameters
        ----------
        leaders
            As many, in the order of the terms of the new law. Nothing changes where they move as those before.
        taken
            How many samples have been taken.
        """
        given = tuple(leaders)
        alike = all(
            a.structure == b.structure and a.parameters == b.parameters
            for a, b in zip(self.leaders, given, strict=True)
        )
        if not alike:
            self.replaced.append(Replaced(taken, self.leaders))
        self.leaders = given

    def follow(self, knowledge: Knowledge) -> None:
        """Take up how samples were and are sent: as those of agents, which are taken at the same instants.

        Parameters
        ----------
        knowledge
            What agents know of each other.
        """
        self._sent, self._since = list(knowledge.settings), [int(first[0]) for first in knowledge.since]

    def newest(self, time: int, agents: Indices) -> Instants:
        """Number of the newest sample that has arrived at each of ``agents``, -1 for the state at the start.

        Parameters
        ----------
        time
            Now, in nanoseconds since the start.
        """
        least = min(round(messages.delay * PER_SECOND) for messages in self._sent)
        last = (time - least - self._phase) // self._period
        found = np.full(len(agents), max(last, START), dtype=np.int64)
        open_ = np.flatnonzero(found > START)
        while open_.size:
            missing = arrivals_as_sent(self._sent, self._since, agents[open_], found[open_]) > time
            found[open_[missing]] -= 1
            open_ = open_[missing & (found[open_] > START)]
        return found

    def motions(self, time: int, numbers: Instants) -> list[Array]:
        """Motion of each leader as receivers take it to be at a ``time``, shape (3, m, receivers) each.

        Parameters
        ----------
        time
            Now, in nanoseconds since the start.
        numbers
            Number of the newest sample of each receiver.
        """
        kinds, which = np.unique(numbers, return_inverse=True)
        taken = np.where(kinds == START, 0, self._phase + kinds * self._period)
        times = self._base + taken * NANOSECOND
        ages = ((time - taken) * NANOSECOND)[which]
        ends = [each.until for each in self.replaced]
        of = np.searchsorted(ends, kinds, side="right")
        groups = [*(each.leaders for each in self.replaced), self.leaders]
        found = []
        for number in range(len(self.leaders)):
            rows = np.empty((len(PARTS), len(kinds), self.leaders[number].dimension))
            for k in np.unique(of).tolist():
                rows[:, of == k] = groups[k][number].along(times[of == k])
            motion = rows[:, which].transpose(0, 2, 1)
            found.append(moved_on(motion, ages, predict=self._predict))
        return found


def check_new_leaders(engine: str, scenario: Scenario, news: LeaderNews | None) -> None:
    """Refuse a scenario that is to go on from a running one, whose leaders do not fit those that send messages.

    Parameters
    ----------
    engine
        Name of the engine, for messages.
    scenario
        The scenario, with the law that is to act from now on.
    news
        The leaders until now; None where they are known exactly.

    Raises
    ------
    InvalidInput, UnsupportedLaw
        When they do not.
    """
    if news is not None:
        check_leader_messages(engine, scenario)
        check_number_of_leaders(engine, len(news.leaders), scenario.law)


def leader_news(scenario: Scenario, replaced: list[Replaced] | None = None) -> LeaderNews | None:
    """What agents know of leaders by messages; None where leaders are known exactly.

    Parameters
    ----------
    scenario
        The scenario.
    replaced
        As for `LeaderNews`.
    """
    information = scenario.information
    if not isinstance(information, Messages) or not information.leader:
        return None
    return LeaderNews(scenario.law.leaders, information, scenario.start.t, replaced)


def with_leaders(entries: list[AnyArray], numbers: Instants | None) -> list[AnyArray]:
    """Entries of the log of messages of some agents, with those of the samples of leaders before them.

    Parameters
    ----------
    entries
        Entries of each, shape (entries, 3).
    numbers
        Numbers of the newest samples of leaders, shape (agents,); None where leaders are known exactly.
    """
    if numbers is None:
        return entries
    rows = [np.array([[LEADER, LEADER_SENDER, number]]) for number in numbers.tolist()]
    return [np.concatenate([row, each]) for row, each in zip(rows, entries, strict=True)]
