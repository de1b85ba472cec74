"""Every pair of agents has a delay of its own."""

from __future__ import annotations

from collections.abc import Mapping
from math import comb

import numpy as np

from flocking.arrays import Array, Indices, Links
from flocking.engine.adaptive_steps.integration_method import DEGREE
from flocking.engine.adaptive_steps.segment import Segment
from flocking.engine.adaptive_steps.state_vectors import place_of
from flocking.engine.delayed.breaking_points import PairPoints
from flocking.engine.delayed.delays import Delays, column_series, late_pieces
from flocking.engine.delayed.history import BINOMIALS, History, position_series
from flocking.engine.delayed.known_links import allowed_rows, with_cones
from flocking.engine.delayed.met_obstacles import PiecewisePaths
from flocking.engine.delayed.pair_past import Looks, Past, Pieces, fill_states, find_first_switches
from flocking.engine.delayed.state_jumps import StateJumps
from flocking.engine.imperfect.cone_switches import ConeView
from flocking.engine.imperfect.graph_views import GraphView
from flocking.engine.imperfect.link_rules import LinkRules
from flocking.engine.imperfect.pair_polynomials import conversion, too_many_images
from flocking.engine.imperfect.turning_views import TurningView
from flocking.engine.imperfect.view_switches import View
from flocking.engine.kernels.bernstein import all_rows
from flocking.model.graphs.views import VELOCITY
from flocking.model.space import Space

BY_DISTANCE = Looks(np.zeros((0, 1, 1, 1)), False, np.zeros(0), np.zeros(0))
"""Nobody looks anywhere: links follow distances."""

COMBINATIONS = np.array([[comb(a, k) for k in range(DEGREE + 1)] for a in range(DEGREE + 1)], dtype=np.float64)


class PairDelays(Delays):
    """Agent i knows agent j as it was tau[i, j] ago.

    Parameters
    ----------
    tau
        The delays, shape (N, N), at least one of them positive; on the diagonal how late agents know themselves.
    history, views, widths
        As for `flocking.engine.delayed.delays.OneDelay`.
    """

    def __init__(
        self, tau: Array, history: History, views: Mapping[int, GraphView], widths: Mapping[str, int]
    ) -> None:  # fmt: skip
        self.tau, self.views, self._widths = np.ascontiguousarray(tau), views, widths
        positive = tau[tau > 0.0]
        self.least, self.largest = float(positive.min()), float(positive.max())
        self.history = history
        self.points = PairPoints(self.tau)
        self.jumps = StateJumps(len(tau), lambda agents: self.tau[:, agents])
        self._own = np.ascontiguousarray(tau.diagonal())
        self._agents = np.arange(len(tau))
        self._past = self._stacked([])
        self._stored: list[Segment] = []
        self._series: list[Array] = []

    def _stacked(self, segments: list[Segment]) -> Past:
        """Steps of the past as arrays."""
        begins, ends = (np.array([getattr(x, name) for x in segments], dtype=np.float64) for name in ("t0", "t1"))
        tables = np.array([x.coefficients for x in segments]) if segments else np.zeros((0, DEGREE + 1, 0))
        return Past(begins, ends, tables, BINOMIALS, self.history.start, self.history.order)

    def _look_back(self) -> None:
        """Take the steps that the past has now."""
        now, before = self.history.segments, self._stored
        if len(now) == len(before) and (not now or (now[-1] is before[-1] and now[0] is before[0])):
            return
        known = {id(segment): series for segment, series in zip(before, self._series, strict=True)}
        n, m = self.history.n, self.history.m
        self._series = [
            known[id(x)] if id(x) in known else position_series(x, n, m, x.t0) for x in now
        ]  # fmt: skip
        self._past, self._stored = self._stacked(now), list(now)

    def _states(self, seconds: float, true: Array, senders: Indices, sensed: Indices) -> Array:
        self._look_back()
        found, windows = np.empty((len(sensed), 2 * self.history.m)), self.windows().of(senders, sensed)
        fill_states(self._past, true, seconds, sensed, self.tau[senders, sensed], *windows, found)
        return found

    def states(self, seconds: float, true: Array, senders: Indices, sensed: Indices) -> tuple[Array, Array]:
        """States, each of a moment of its own."""
        own = self._states(seconds, true, self._agents, self._agents) if self._own.any() else true
        return own, self._states(seconds, true, senders, sensed)

    @property
    def knows_present(self) -> bool:
        """Unless one knows itself late."""
        return not self._own.any()

    def own_paths(self, segment: Segment) -> PiecewisePaths:
        """The true paths, each a delay of its own before."""
        begin, n, m = segment.t0, self.history.n, self.history.m
        windows, tau = self.windows().of(self._agents, self._agents), self._own
        limits = np.stack(windows, axis=1) if windows.first.size else np.zeros((n, 0), dtype=np.int64)
        found: list[tuple[Indices, list[tuple[float, float, Array]]]] = []
        present = np.flatnonzero(tau == 0.0)
        if present.size:
            found.append((present, [(begin, segment.t1, position_series(segment, n, m, begin))]))
        alike = np.column_stack([tau, limits])
        for late, *window in np.unique(alike[tau > 0.0], axis=0).tolist():
            pieces = late_pieces(self.history, segment, late, *map(int, window))
            agents = np.flatnonzero((alike == [late, *window]).all(axis=1))
            found.append((agents, [(begin + at, begin + at + span, known) for at, span, known in pieces]))
        return found

    def all_states(self, seconds: float, true: Array) -> tuple[Array, Array]:
        """States, each of a moment of its own."""
        n = len(self.tau)
        own, known = self.states(seconds, true, np.repeat(self._agents, n), np.tile(self._agents, n))
        return own, known.reshape(n, n, -1)

    def switches(self, space: Space, segment: Segment, base: float, links: Links, rules: LinkRules) -> Array:
        """The first one of every link, on the overlaid pieces of its two agents."""
        self._look_back()
        n, m = self.history.n, self.history.m
        segments = [*self.history.segments, segment]
        begins, ends = ([getattr(x, name) for x in segments] for name in ("t0", "t1"))
        series = [*self._series, position_series(segment, n, m, segment.t0)]
        windows, before = self.windows(), int(begins[0] <= 0.0)
        if before:
            line = np.zeros((DEGREE + 1, n, m))
            line[:2] = self.history.start[:, :m], self.history.start[:, m:]
            # The line before the start is a piece about the time 0, at which it ends.
            begins, ends, series = [0.0, *begins], [0.0, *ends], [line, *series]
        steps = np.array(begins), np.array(ends), np.array(series)
        pieces = Pieces(*steps, COMBINATIONS, windows.first + before, windows.last + before)
        lengths = np.array(space.lengths or (np.inf,) * m, dtype=np.float64)
        size = float(np.abs(pieces.series[:, 0]).max())

        def rows_of(table: Array, links: Links, rules: LinkRules, looks: Looks) -> Array:
            def rows_in(found: Array) -> int:
                count = int(find_first_switches(
                    pieces, self.tau, segment.t0, segment.t1, lengths, table, links, rules, looks, size, found
                ))  # fmt: skip
                if count < 0:
                    raise too_many_images(base + segment.t0)
                return count

            return all_rows(rows_in, 4)

        by_distance, allowed = with_cones(rules, self.views)
        rows = allowed_rows(rows_of(conversion(DEGREE), links, by_distance, BY_DISTANCE), allowed)
        for graph, view in self.views.items():
            if isinstance(view, ConeView):
                continue
            looks, one = self._looks(view, segment, before), slice(graph, graph + 1)
            by_view = LinkRules(np.ones(1, np.int64), rules.appear[one], rules.break_[one])
            seen = rows_of(conversion(DEGREE + looks.series.shape[1] - 1), links[one], by_view, looks)
            seen[:, 3] = graph
            rows = np.concatenate([rows, seen])
        return rows[np.lexsort(rows.T[::-1])]

    def _looks(self, view: View | TurningView, segment: Segment, before: int) -> Looks:
        """How agents look under a graph on a step, as they know themselves.

        Parameters
        ----------
        view, segment
            The fields of view, and the step.
        before
            1 where the line before the start is among the pieces that are read, else 0.
        """
        if isinstance(view, View):
            return Looks(view.directions[None, None], False, view.cosines, view.radii)
        last = column_series(segment, self.history, view.column, self._widths)
        if view.column != VELOCITY or self.knows_present:
            return Looks(last[None], False, view.cosines, view.radii)
        n, m, order = self.history.n, self.history.m, self.history.order
        place = place_of(VELOCITY, order, n, m, self._widths)
        line = np.zeros((before, DEGREE + 1, n, m))
        line[:, 0] = self.history.start[:, m:]
        steps = [position_series(x, n, m, x.t0, place) for x in self.history.segments]
        return Looks(np.concatenate([line, np.array([*steps, last])]), True, view.cosines, view.radii)
