"""What agents know by messages at every moment, and when links switch by it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from typing import NamedTuple, Self

import numpy as np

from flocking.arrays import Array, Indices, Links, Numbers
from flocking.engine.adaptive_steps.integration_method import DEGREE
from flocking.engine.adaptive_steps.segment import Segment
from flocking.engine.adaptive_steps.state_vectors import place_of
from flocking.engine.delayed.delays import Delays
from flocking.engine.delayed.history import History, position_series
from flocking.engine.delayed.messages.instants import MessageInstants
from flocking.engine.delayed.messages.leader_samples import LeaderSamples
from flocking.engine.delayed.messages.samples_in_use import InUse, put_sample
from flocking.engine.delayed.messages.turning_switches import turning_switches
from flocking.engine.delayed.met_obstacles import PiecewisePaths
from flocking.engine.delayed.state_jumps import StateJumps
from flocking.engine.imperfect.constant_views import add_view_changes
from flocking.engine.imperfect.graph_views import GraphView
from flocking.engine.imperfect.link_rules import LinkRules
from flocking.engine.imperfect.messages.knowledge import Knowledge
from flocking.engine.imperfect.pair_polynomials import (
    ROUNDING,
    Paths,
    conversion,
    nearest_offset,
    reach_within,
    too_many_images,
)
from flocking.engine.imperfect.pair_switches import TwoPaths, WatchedLink, add_switches
from flocking.engine.imperfect.turning_views import TurningView
from flocking.engine.imperfect.view_switches import Looking, View
from flocking.engine.kernels.bernstein import all_rows
from flocking.formula.native.functions import native_apart
from flocking.model.graphs.views import VELOCITY
from flocking.model.space import Space
from flocking.model.world.times import NANOSECOND


class Watched(NamedTuple):
    """When links of what agents know switch.

    Parameters
    ----------
    ways
        Of each graph: 0 where its links never change, `BY_VIEW` where they follow fields of view, else by distances;
        shape (graphs,).
    enter, leave
        Distances of each graph and sensing agent, shape (graphs, N).
    allowed
        Pairs that may be linked, shape (graphs, N, N).
    directions, cosines
        Unit vectors in which agents look, shape (graphs, N, m), and cosines of their half angles, shape (graphs, N).
    """

    ways: Numbers
    enter: Array
    leave: Array
    allowed: Links
    directions: Array
    cosines: Array


BY_VIEW = 3
"""Of a graph whose links follow fields of view, beside the numbers of
`flocking.engine.imperfect.link_rules.LinkRules.ways`."""


def watched(rules: LinkRules, views: Mapping[int, GraphView], n: int, m: int) -> Watched:
    """When links of what agents know switch, by distances, fields of view and cones.

    Parameters
    ----------
    rules, views
        When true links switch, and the fields of view and cones of graphs that have some, by number; those that turn
        are left out.
    n, m
        Number of agents and of axes.
    """
    graphs = len(rules.ways)
    found = Watched(
        rules.ways.copy(), rules.appear.copy(), rules.break_.copy(), np.ones((graphs, n, n), dtype=bool),
        np.zeros((graphs, n, m)), np.ones((graphs, n)),
    )  # fmt: skip
    for graph, view in views.items():
        if isinstance(view, TurningView):
            continue
        found.enter[graph] = found.leave[graph] = view.radii
        if isinstance(view, View):
            found.ways[graph], found.directions[graph], found.cosines[graph] = BY_VIEW, view.directions, view.cosines
        else:
            found.ways[graph], found.allowed[graph] = 1, view.allowed
    return found


@native_apart
def find_message_switches(
    own: Array, used: InUse, begin: float, span: float, lengths: Array, table: Array, links: Links, rules: Watched,
    size: float, found: Array,
) -> int:  # fmt: skip
    """Fill rows (time since the step began, i, j, graph) of the first switch of every link on a step.

    Parameters
    ----------
    own
        Taylor coefficients about the beginning of the step of the positions of agents as they know their own,
        shape (8, N, m).
    used
        What they know of others.
    begin, span
        When the step begins, in seconds from the start, and how long it is.
    lengths, table
        See `flocking.engine.imperfect.pair_polynomials.Paths`.
    links
        Links by what agents know, shape (graphs, N, N).
    rules
        When they switch.
    size
        Size of the coordinates, for rounding.
    found
        Takes the rows, shape (room, 4).

    Returns
    -------
    int
        How many rows there are, those included for which there was no room; -1 if a pair has too many images.
    """
    n, m = own.shape[1], own.shape[2]
    S, nearest, row = np.zeros((own.shape[0], 2, m)), np.empty(m), np.empty((1, 4))
    paths = Paths(S, lengths, table, begin)
    total = 0
    for i in range(n):
        for a in range(own.shape[0]):
            for k in range(m):
                S[a, 0, k] = own[a, i, k]
        for j in range(n):
            if i == j or not used.there[i, j]:
                continue
            put_sample(S, used, i, j, begin)
            distance, reach = nearest_offset(paths, 0, 1, nearest), reach_within(paths, 0, 1, span)
            two = TwoPaths(0, 1, span, distance, reach)
            for graph in range(links.shape[0]):
                if rules.ways[graph] == 0 or not rules.allowed[graph, i, j]:
                    continue
                close, far, linked = rules.enter[graph, i], rules.leave[graph, i], links[graph, i, j]
                if rules.ways[graph] == BY_VIEW:
                    look = Looking(i, j, far, rules.cosines[graph, i], ROUNDING * (far + size))
                    count = add_view_changes(paths, two, look, linked, rules.directions[graph, i], row, 0)
                else:
                    link = WatchedLink(linked, close, far, i, j, graph)
                    count = add_switches(paths, two, nearest, link, size, row, 0)
                if count < 0:
                    return -1
                if count > 0:
                    if total < found.shape[0]:
                        found[total, 0], found[total, 1], found[total, 2], found[total, 3] = row[0, 0], i, j, graph
                    total += 1
    return total


class MessageStates(Delays):
    """Agents know each other by the newest message of each, held or moved on with the velocity that it states.

    Parameters
    ----------
    knowledge
        What messages have stated; there are messages.
    history
        The past, which is not read.
    views
        The fields of view and cones of graphs that have some, by number.
    widths
        How many numbers an agent has in each further column, by name.
    leaders
        Samples of leaders; None where these are known exactly.
    """

    points: MessageInstants

    def __init__(
        self, knowledge: Knowledge, history: History, views: Mapping[int, GraphView],
        widths: Mapping[str, int],
        leaders: LeaderSamples | None = None,
    ) -> None:  # fmt: skip
        assert knowledge.messages is not None
        assert knowledge.schedule is not None
        self.knowledge, self.history, self.views, self._widths = knowledge, history, views, widths
        # Half a nanosecond more than the shortest period, so that rounding cuts no step of a whole one.
        self.least, self.largest = (float(knowledge.schedule.period.min()) + 0.5) * NANOSECOND, 0.0
        self.points = MessageInstants(knowledge, leaders)
        self.jumps = StateJumps(knowledge.n, lambda agents: np.zeros((knowledge.n, len(agents))))
        self._measured = knowledge.messages.self_known == "measured"
        self._rows = np.zeros((0, 2 * knowledge.m))
        self._begun: Array = np.zeros(0)
        self._own = knowledge.samples.start

    def copy(self) -> Self:
        """An independent copy of all that a replacement of the law or the state changes; samples are shared."""
        other = copy(self)
        other.knowledge, other.history, other.jumps = copy(self.knowledge), self.history.copy(), self.jumps.copy()
        other.points = self.points.of(other.knowledge)
        return other

    def known_at_once(self, agents: Links) -> Links:
        """Those of agents that know their own present; the others know of a jump by samples."""
        found = np.zeros((len(agents), len(agents)), dtype=bool)
        found[agents] = not self._measured
        return found

    def prepare(self, senders: Indices, sensed: Indices) -> None:
        """Take up what agents know from now on.

        Parameters
        ----------
        senders, sensed
            The agent of each pair that knows, and the one that is known.
        """
        knowledge, m = self.knowledge, self.knowledge.m
        numbers = knowledge.newest[senders, sensed]
        self._rows = knowledge.samples.of(sensed, numbers)
        self._begun = np.asarray(knowledge.begun(sensed, numbers) * NANOSECOND, dtype=np.float64)
        if self.points.leaders is not None:
            self.points.leaders.prepare()
        if self._measured:
            self._own = knowledge.samples.of(np.arange(knowledge.n), knowledge.taken - 1)
            if self.history.order == 1:
                self._own[:, m:] = 0.0

    def states(self, seconds: float, true: Array, senders: Indices, sensed: Indices) -> tuple[Array, Array]:
        """States of the samples that `prepare` has taken up for these pairs."""
        return self._own if self._measured else true, self._moved_on(seconds, self._rows, self._begun)

    @property
    def knows_present(self) -> bool:
        """Unless all know themselves by their own samples."""
        return not self._measured

    def own_paths(self, segment: Segment) -> PiecewisePaths:
        """The places of their samples, at which agents take themselves to stay."""
        places: Array = self._own[None, :, : self.knowledge.m]
        return [(np.arange(self.knowledge.n), [(segment.t0, segment.t1, places)])]

    def leaders(self, seconds: float) -> Sequence[Array]:
        """By the samples that `prepare` has taken up."""
        leaders = self.points.leaders
        return () if leaders is None else leaders.motions(seconds)

    def all_states(self, seconds: float, true: Array) -> tuple[Array, Array]:
        """States of the samples in use of all pairs."""
        knowledge = self.knowledge
        everybody = np.broadcast_to(np.arange(knowledge.n), knowledge.newest.shape).ravel()
        numbers = knowledge.newest.ravel()
        begun = np.asarray(knowledge.begun(everybody, numbers) * NANOSECOND, dtype=np.float64)
        known = self._moved_on(seconds, knowledge.samples.of(everybody, numbers), begun)
        return self._own if self._measured else true, known.reshape(knowledge.n, knowledge.n, -1)

    def _moved_on(self, seconds: float, rows: Array, begun: Array) -> Array:
        """Samples, shape (pairs, 2 m), as they are used at a time; ``begun`` is when they were taken."""
        m = self.knowledge.m
        if self.knowledge.degree:
            rows = rows.copy()
            rows[:, :m] += (seconds - begun)[:, None] * rows[:, m:]
        if self.history.order == 1:
            rows = np.concatenate([rows[:, :m], np.zeros_like(rows[:, m:])], axis=1)
        return rows

    def switches(self, space: Space, segment: Segment, base: float, links: Links, rules: LinkRules) -> Array:
        """The first one of every link."""
        knowledge, begin, (n, m) = self.knowledge, segment.t0, (self.knowledge.n, self.knowledge.m)
        assert knowledge.schedule is not None
        own = position_series(segment, n, m, begin)
        if self._measured:
            own[0], own[1:] = self._own[:, :m], 0.0
        lengths = np.array(space.lengths or (np.inf,) * m, dtype=np.float64)
        used = InUse(
            knowledge.samples.rows, knowledge.samples.start, knowledge.newest, self.points.there,
            knowledge.schedule.phase, knowledge.schedule.period, knowledge.degree,
        )  # fmt: skip
        size = max(float(np.abs(own[0]).max()), float(np.abs(used.rows[..., :m]).max()))

        by = watched(rules, self.views, n, m)

        def rows_in(found: Array) -> int:
            count = int(find_message_switches(
                own, used, begin, segment.t1 - begin, lengths, conversion(DEGREE), links, by, size, found
            ))  # fmt: skip
            if count < 0:
                raise too_many_images(base + begin)
            return count

        rows = all_rows(rows_in, 4)
        turning = {graph: view for graph, view in self.views.items() if isinstance(view, TurningView)}
        if turning:
            paths, span = Paths(own, lengths, conversion(DEGREE), begin), segment.t1 - begin
            rows = np.concatenate([rows, *(
                turning_switches(paths, used, span, links[k], k, view.along(self._looks(segment, view.column)), size)
                for k, view in turning.items()
            )])  # fmt: skip
        return rows[np.lexsort(rows.T[::-1])]

    def _looks(self, segment: Segment, column: str) -> Array:
        """Taylor coefficients of the vectors along which agents look about the beginning of a step, (terms, N, m).

        Their velocities are those that they know to be their own, directions of their bodies what these are.
        """
        n, m = self.knowledge.n, self.knowledge.m
        if column == VELOCITY and self._measured:
            return self._own[None, :, m:]
        first = place_of(column, self.history.order, n, m, self._widths)
        return position_series(segment, n, m, segment.t0, first)
