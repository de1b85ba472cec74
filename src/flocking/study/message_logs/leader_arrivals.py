"""Which sample of leaders each agent had, and what it took their motion to be, from the declared world alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import Array
from flocking.engine.runs.message_log import AT_START
from flocking.errors import InvalidInput
from flocking.model.known_leaders import law_as_known
from flocking.model.law import Law, Scenario
from flocking.model.world.information import Messages
from flocking.model.world.random_numbers import NOT_AN_AGENT, Purpose, uniform
from flocking.model.world.times import NANOSECOND, PER_SECOND


class LeaderArrivals:
    """Samples of the leaders of a run, and when they arrive.

    Parameters
    ----------
    scenario
        Its information are messages, by which leaders are known.
    last
        Nanosecond after which nothing is looked up.
    """

    def __init__(self, scenario: Scenario, last: int) -> None:
        assert isinstance(scenario.information, Messages)
        self._scenario, self._messages = scenario, scenario.information
        self._period, self._phase = (
            int(np.rint(float(x) * PER_SECOND)) for x in (self._messages.period, self._messages.phase)
        )
        self._count = max(0, (last - self._phase) // self._period + 1)
        self._times: dict[int, NDArray[np.int64]] = {}
        self.late: dict[int, NDArray[np.int64]] = {}
        """When each sample would reach a receiver if none were lost, once `arrivals` has been asked for."""
        self._moving: dict[int, list[Array]] = {}

    def taken(self, k: int) -> int:
        """Nanosecond at which sample ``k`` was taken."""
        return 0 if k == AT_START else self._phase + k * self._period

    def newest(self, receiver: int, instant: int, *, lossless: bool = False) -> int:
        """Number of the newest sample that has arrived at a ``receiver`` by an ``instant``, in nanoseconds.

        Parameters
        ----------
        lossless
            As if nothing were ever lost.
        """
        times = self.arrivals(receiver)
        there = np.flatnonzero((self.late[receiver] if lossless else times) <= instant)
        return int(there[-1]) if len(there) else AT_START

    def is_there(self, k: int, instant: int) -> bool:
        """Whether leaders had taken a sample ``k`` by an ``instant``, in nanoseconds, or it is the start's."""
        return AT_START <= k < self._count and self.taken(k) <= instant

    def arrivals(self, receiver: int) -> NDArray[np.int64]:
        """When each sample reaches a receiver, in nanoseconds; at no time where it is lost."""
        if receiver not in self._times:
            world, k = self._messages, np.arange(self._count, dtype=np.int64)
            words = np.full(len(k), NOT_AN_AGENT), np.full(len(k), receiver), k
            times = self._phase + k * self._period + round(world.delay * PER_SECOND)
            if world.jitter:
                late = uniform(world.seed, Purpose.JITTER, *words) * round(world.jitter * PER_SECOND)
                times = times + np.rint(late).astype(np.int64)
            self.late[receiver] = times
            if world.loss is not None and not world.loss.ideal:
                times = np.where(world.loss.lost(world.seed, *words), np.iinfo(np.int64).max, times)
            self._times[receiver] = times
        return self._times[receiver]

    def law(self, k: int, instant: float) -> Law:
        """The law with leaders as who has their sample ``k`` takes them to be at an ``instant``.

        Raises
        ------
        InvalidInput
            When there is no such sample.
        """
        if not AT_START <= k < self._count:
            raise InvalidInput("run", "log", "must name samples that leaders sent", k, "The log was changed.")
        motions = self.motions(k, instant)
        return law_as_known(self._scenario.law, motions)

    def true_law(self, instant: float) -> Law:
        """The law with leaders as they are at an ``instant``, computed as `law` is."""
        return law_as_known(self._scenario.law, self.true_motions(instant))

    def true_motions(self, instant: float) -> list[Array]:
        """Position, velocity and acceleration of each leader at an ``instant``, in nanoseconds, shape (3, m) each."""
        t = self._scenario.start.t + instant * NANOSECOND
        return [np.array(leader.at(t)) for leader in self._scenario.law.leaders]

    def motions(self, k: int, instant: float) -> list[Array]:
        """What who has sample ``k`` takes leaders to do at an ``instant``: `true_motions` held or moved on."""
        taken = self.taken(k)
        if k not in self._moving:
            self._moving[k] = self.true_motions(taken)
        s = (instant - taken) * NANOSECOND if self._messages.predict else 0.0
        return [np.array([q + s * p + 0.5 * s * s * a, p + s * a, a]) for q, p, a in self._moving[k]]


def leader_arrivals(scenario: Scenario, last: int) -> LeaderArrivals | None:
    """Samples of leaders; None where they are known exactly.

    Parameters
    ----------
    scenario, last
        As for `LeaderArrivals`.
    """
    information = scenario.information
    sent = isinstance(information, Messages) and information.leader
    return LeaderArrivals(scenario, last) if sent else None
