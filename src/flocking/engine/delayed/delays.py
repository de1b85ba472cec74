"""How late agents know each other: what a session of delayed knowledge reads of the past."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from flocking.arrays import Array, Indices, Links
from flocking.engine.adaptive_steps.segment import Segment
from flocking.engine.delayed.breaking_points import BreakingPoints, OneDelayPoints
from flocking.engine.delayed.history import History, position_series
from flocking.engine.delayed.known_links import known_switches
from flocking.engine.imperfect.link_rules import LinkRules
from flocking.engine.imperfect.taylor_series import shifted
from flocking.model.space import Space


class Delays(ABC):
    """How late agents know each other.

    Attributes
    ----------
    least, largest
        The least delay that is not zero, no step is longer; and the largest, the past is kept as long.
    history
        The past.
    points
        Where steps must end.
    """

    least: float
    largest: float
    history: History
    points: BreakingPoints

    @abstractmethod
    def states(self, seconds: float, true: Array, senders: Indices, sensed: Indices) -> tuple[Array, Array]:
        """States that agents know of themselves, shape (N, 2 m), and of their neighbours, shape (pairs, 2 m).

        Parameters
        ----------
        seconds
            Now, since the start.
        true
            The true states now, shape (N, 2 m).
        senders, sensed
            The agent of each pair that knows, and the one that is known.
        """

    @abstractmethod
    def at_start(self) -> tuple[Array, Array]:
        """States that agents know at the start of themselves, shape (N, 2 m), and of all others, shape (N, N, 2 m)."""

    @abstractmethod
    def switches(self, space: Space, segment: Segment, base: float, links: Links, rules: LinkRules) -> Array:
        """The first switches of known links on a step: rows (time since it began, i, j, graph), in order of time.

        Parameters
        ----------
        space
            Space of the agents.
        segment
            The step, which is not part of the past yet.
        base
            The scenario's time at the start, for messages.
        links, rules
            Links by what agents know, shape (graphs, N, N), and when they switch.
        """


class OneDelay(Delays):
    """Everybody is known the same time ago.

    Parameters
    ----------
    tau
        The delay.
    self_delayed
        Whether agents know themselves as late.
    history
        The past.
    """

    def __init__(self, tau: float, self_delayed: bool, history: History) -> None:
        self.least = self.largest = tau
        self._self_delayed = self_delayed
        self.history = history
        self.points = OneDelayPoints(tau)

    def states(self, seconds: float, true: Array, senders: Indices, sensed: Indices) -> tuple[Array, Array]:
        """States of one moment."""
        known = self.history.at(seconds - self.largest)
        return known if self._self_delayed else true, known[sensed]

    def at_start(self) -> tuple[Array, Array]:
        """States of one moment before the start."""
        known = self.history.at(-self.largest)
        own = known if self._self_delayed else self.history.at(0.0)
        return own, known[None, :, :]

    def switches(self, space: Space, segment: Segment, base: float, links: Links, rules: LinkRules) -> Array:
        """Those on the first piece of the past that has any."""
        begin, end, tau, history = segment.t0, segment.t1, self.largest, self.history
        positions = position_series(segment, history.n, history.m, begin)
        for first, last, known in history.pieces(begin - tau, end - tau):
            since = max(first + tau - begin, 0.0)
            span = min(last + tau, end) - (begin + since)
            if span <= 0.0:
                continue
            own = known if self._self_delayed else shifted(positions, since)
            rows = known_switches(space, own, known, span, base + begin + since, links, rules)
            if len(rows):
                rows[:, 0] += since
                return rows
        return np.zeros((0, 4))
