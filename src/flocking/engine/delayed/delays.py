"""How late agents know each other: what a session of delayed knowledge reads of the past."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from functools import partial
from typing import Self

import numpy as np

from flocking.arrays import Array, Indices, Links
from flocking.engine.adaptive_steps.segment import Segment
from flocking.engine.adaptive_steps.state_vectors import place_of
from flocking.engine.delayed.breaking_points import BreakingPoints, OneDelayPoints
from flocking.engine.delayed.history import History, position_series
from flocking.engine.delayed.known_links import allowed_rows, known_switches, known_view_switches, with_cones
from flocking.engine.delayed.met_obstacles import PiecewisePaths
from flocking.engine.delayed.state_jumps import EVERYTHING, StateJumps, Windows
from flocking.engine.imperfect.graph_views import GraphView, view_from
from flocking.engine.imperfect.link_rules import LinkRules
from flocking.engine.imperfect.taylor_series import shifted
from flocking.engine.imperfect.turning_views import TurningView
from flocking.model.graphs.views import VELOCITY
from flocking.model.space import Space

NONE: Indices = np.zeros(0, dtype=np.int64)
"""No agents."""


def late_pieces(
    history: History, segment: Segment, tau: float, first: int = -1, last: int | None = None, *,
    velocities: bool = False,
) -> Iterator[tuple[float, float, Array]]:  # fmt: skip
    """The past that is known on a step, piece by piece.

    Parameters
    ----------
    history
        The past.
    segment
        The step, which is no longer than the delay.
    tau
        How late the past is known.
    first, last
        Numbers of the steps that may be read, see `History.at`.
    velocities
        Whether velocities are known instead of positions.

    Yields
    ------
    tuple
        Time since the step began, how long the piece is known, and Taylor coefficients of positions about its
        beginning, shape (8, N, m).
    """
    begin, end = segment.t0, segment.t1
    for since, until, known in history.pieces(begin - tau, end - tau, first, last, velocities=velocities):
        at = max(since + tau - begin, 0.0)
        span = min(until + tau, end) - (begin + at)
        if span > 0.0:
            yield at, span, known


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
    jumps
        Replaced states that somebody does not know of yet.
    views
        Fields of view and cones of the law's graphs, by number.
    begin
        When the step begins whose states are read, in seconds from the start.
    """

    least: float
    largest: float
    history: History
    points: BreakingPoints
    jumps: StateJumps
    views: Mapping[int, GraphView]
    begin: float = 0.0
    _found: tuple[object, Windows] | None = None

    def copy(self) -> Self:
        """An independent copy."""
        other = copy(self)
        other.history, other.points, other.jumps = self.history.copy(), self.points.copy(), self.jumps.copy()
        return other

    def begin_step(self, seconds: float) -> None:
        """Read from now on states of a step that begins at a time.

        Parameters
        ----------
        seconds
            The time, in seconds from the start.
        """
        self.begin = seconds
        self.jumps.forget(seconds, self.points.rounding(seconds), self.largest)

    def windows(self) -> Windows:
        """The steps of the past that may be read on the present step."""
        jumps, steps = self.jumps, self.history.segments
        if not len(jumps.times):
            return EVERYTHING
        ends = (steps[0].t0, steps[-1].t1, len(steps)) if steps else ()
        key = (self.begin, ends, tuple(jumps.times.tolist()), int(jumps.agents.sum()))
        if self._found is None or self._found[0] != key:
            self._found = key, jumps.windows(self.history, self.begin, self.points.rounding(self.begin))
        return self._found[1]

    def known_at_once(self, agents: Links) -> Links:
        """Pairs whose distance, as the first one knows it, jumps as soon as states do, shape (N, N).

        Parameters
        ----------
        agents
            Whose state jumps, shape (N,).
        """
        return self.jumps.at_once(agents)

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

    def own(self, seconds: float, true: Array) -> Array:
        """States that agents know of themselves, shape (N, 2 m).

        Parameters
        ----------
        seconds, true
            As for `states`.
        """
        return self.states(seconds, true, NONE, NONE)[0]

    @property
    @abstractmethod
    def knows_present(self) -> bool:
        """Whether all agents know their own present."""

    @abstractmethod
    def own_paths(self, segment: Segment) -> PiecewisePaths:
        """PiecewisePaths of all agents on a step as each knows its own, where not all know their present.

        Parameters
        ----------
        segment
            The step, which is not part of the past yet.
        """

    def leaders(self, seconds: float) -> Sequence[Array]:
        """Motion of each leader as every agent knows it by messages, shape (3, m, N); empty where known exactly.

        Parameters
        ----------
        seconds
            Now, since the start.
        """
        return ()

    @abstractmethod
    def all_states(self, seconds: float, true: Array) -> tuple[Array, Array]:
        """States that agents know of themselves, shape (N, 2 m), and of all others, shape (N or 1, N, 2 m).

        Parameters
        ----------
        seconds, true
            As for `states`.
        """

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


def column_series(
    segment: Segment, history: History, column: str, widths: Mapping[str, int], since: float = 0.0
) -> Array:  # fmt: skip
    """Taylor coefficients of a column of vectors about a time on a step, shape (8, N, m).

    Parameters
    ----------
    segment, history
        The step, and the past before it.
    column, widths
        Name of the column, and how many numbers those of the bodies have.
    since
        The time since the step began.
    """
    n, m = history.n, history.m
    return position_series(segment, n, m, segment.t0 + since, place_of(column, history.order, n, m, widths))


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
    views, widths
        Fields of view and cones of graphs by number, and how many numbers the columns of the bodies have, by name.
    """

    def __init__(
        self, tau: float, self_delayed: bool, history: History, views: Mapping[int, GraphView],
        widths: Mapping[str, int],
    ) -> None:  # fmt: skip
        self.least = self.largest = tau
        self._self_delayed = self_delayed
        self.history, self.views, self._widths = history, views, widths
        self.points = OneDelayPoints(tau)
        self.jumps = StateJumps(len(history.start), self._delays_of)

    def _delays_of(self, agents: Indices) -> Array:
        found = np.full((len(self.history.start), len(agents)), self.largest)
        if not self._self_delayed:
            found[agents, np.arange(len(agents))] = 0.0
        return found

    def _window(self) -> tuple[int, int | None]:
        """The first and the last step of the past that may be read now, of all agents."""
        windows = self.windows()
        return (int(windows.first.max()), int(windows.last.min())) if windows.first.size else (-1, None)

    def states(self, seconds: float, true: Array, senders: Indices, sensed: Indices) -> tuple[Array, Array]:
        """States of one moment."""
        known = self.history.at(seconds - self.largest, *self._window())
        return known if self._self_delayed else true, known[sensed]

    @property
    def knows_present(self) -> bool:
        """Unless all know themselves as late as others."""
        return not self._self_delayed

    def own_paths(self, segment: Segment) -> PiecewisePaths:
        """The true paths, a delay before."""
        begin, pieces = segment.t0, late_pieces(self.history, segment, self.largest, *self._window())
        return [(np.arange(self.history.n), ((begin + at, begin + at + span, known) for at, span, known in pieces))]

    def all_states(self, seconds: float, true: Array) -> tuple[Array, Array]:
        """States of one moment."""
        known = self.history.at(seconds - self.largest, *self._window())
        return known if self._self_delayed else true, known[None, :, :]

    def switches(self, space: Space, segment: Segment, base: float, links: Links, rules: LinkRules) -> Array:
        """Those on the first piece of the past that has any."""
        positions = position_series(segment, self.history.n, self.history.m, segment.t0)
        by_distance, allowed = with_cones(rules, self.views)
        velocities: Iterator[tuple[float, float, Array]] = iter(())
        if self._self_delayed and any(isinstance(x, TurningView) and x.column == VELOCITY for x in self.views.values()):
            velocities = late_pieces(self.history, segment, self.largest, *self._window(), velocities=True)
        for since, span, known in late_pieces(self.history, segment, self.largest, *self._window()):
            own, now = known if self._self_delayed else shifted(positions, since), base + segment.t0 + since
            rows = allowed_rows(known_switches(space, own, known, span, now, links, by_distance), allowed)
            *_, past = next(velocities, (None,))
            looks = partial(self._looks, segment, since, past)
            seen = [
                known_view_switches(space, own, known, span, now, links[graph], graph, view_from(view, looks))
                for graph, view in self.views.items()
            ]  # fmt: skip
            rows = np.concatenate([rows, *seen])
            if len(rows):
                rows[:, 0] += since
                return rows[np.lexsort(rows.T[::-1])]
        return np.zeros((0, 4))

    def _looks(self, segment: Segment, since: float, past: Array | None, column: str) -> Array:
        """Taylor coefficients of the vectors along which agents look, about a time on a step, shape (8, N, m).

        Parameters
        ----------
        segment, since
            The step, and the time since it began.
        past
            Those of the velocities that agents take to be their own, where these are not the true ones.
        column
            Name of the column.
        """
        if column == VELOCITY and past is not None:
            return past
        return column_series(segment, self.history, column, self._widths, since)
