"""What agents know of leaders by messages: the newest sample that has arrived at each agent."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flocking.arrays import AnyArray, Array, Indices
from flocking.engine.imperfect.messages.knowledge import NEVER
from flocking.engine.imperfect.messages.samples import START
from flocking.engine.runs.message_log import LEADER, LEADER_SENDER
from flocking.errors import InvalidInput, UnsupportedLaw
from flocking.model.known_leaders import moved_on
from flocking.model.law import Scenario
from flocking.model.leaders_and_obstacles.leaders import Leader
from flocking.model.world.information import Messages
from flocking.model.world.random_numbers import NOT_AN_AGENT, Purpose, uniform
from flocking.model.world.times import NANOSECOND, PER_SECOND, Instants


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


class LeaderNews:
    """Samples of the leaders of a law, which are sent together.

    Which sample is the newest one at a time follows from the time alone: nothing is stored.

    Parameters
    ----------
    leaders
        The leaders.
    messages
        How they are sent.
    base
        The scenario's time at the start.
    """

    def __init__(self, leaders: Sequence[Leader], messages: Messages, base: float) -> None:
        self._leaders, self._messages, self._base = leaders, messages, base
        self._period, self._phase = (round(float(x) * PER_SECOND) for x in (messages.period, messages.phase))
        self._delay = round(messages.delay * PER_SECOND)

    def newest(self, time: int, agents: Indices) -> Instants:
        """Number of the newest sample that has arrived at each of ``agents``, -1 for the state at the start.

        Parameters
        ----------
        time
            Now, in nanoseconds since the start.
        """
        last = (time - self._delay - self._phase) // self._period
        found = np.full(len(agents), max(last, START), dtype=np.int64)
        open_ = np.flatnonzero(found > START)
        while open_.size:
            missing = arrivals_of_leaders(self._messages, agents[open_], found[open_]) > time
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
        found = []
        for leader in self._leaders:
            motion = np.array(leader.along(times))[:, which].transpose(0, 2, 1)
            found.append(moved_on(motion, ages, predict=self._messages.predict))
        return found


def leader_news(scenario: Scenario) -> LeaderNews | None:
    """What agents know of leaders by messages; None where leaders are known exactly.

    Parameters
    ----------
    scenario
        The scenario.
    """
    information = scenario.information
    if not isinstance(information, Messages) or not information.leader:
        return None
    return LeaderNews(scenario.law.leaders, information, scenario.start.t)


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
