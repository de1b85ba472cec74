"""Closest approaches of agents."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from flocking.engine.runs.run import Closest
from flocking.model.leaders_and_obstacles.obstacles import Ball
from flocking.model.observables import closest_pair
from flocking.model.position_tree import tree_of
from flocking.model.state import State
from flocking.study.curve_distances import RESOLVED, searched_curves
from flocking.study.evidence.basis import NotMeasurable, NotResolvable, stated
from flocking.study.evidence.doubts import DoubtEvidence
from flocking.study.evidence.motion import MotionEvidence
from flocking.study.message_logs.recorded_motion import RecordedMotion

CONTROL_POINTS = (
    np.array([[6.0, 0.0, 0.0, 0.0], [-5.0, 18.0, -9.0, 2.0], [2.0, -9.0, 18.0, -5.0], [0.0, 0.0, 0.0, 6.0]]) / 6.0
)
"""Control points of a cubic in Bernstein's basis by its places at 0, 1/3, 2/3 and 1, a row for each."""

MOST_PLACES = 10**7
"""Places of agents at frames, and pairs that may come near between two of them, that are looked at at most."""


class ApproachEvidence(DoubtEvidence, MotionEvidence):
    """Closest approaches, between frames too where the engine recorded them."""

    def error_of(self, found: Closest) -> float:
        """How much closer than recorded two agents may have come.

        Parameters
        ----------
        found
            The closest approach that was recorded.
        """
        near = self.fidelity.approaches
        if near.looked:
            raise NotMeasurable(f"agents' distances were recorded only {near.looked}")
        if near.error is not None:
            return stated(near.error, "how close its agents came between two samples")
        self.accuracy  # noqa: B018
        if np.isnan(found.error) and np.isfinite(found.distance):
            raise NotResolvable("the error of the closest approach is unknown")
        return found.error if np.isfinite(found.distance) else 0.0

    @property
    def closest_linked(self) -> Closest:
        """Closest approach ever of two linked agents; infinitely far where there was never a link."""
        found = self._checked(self.run.closest_linked)
        if not np.isfinite(found.distance) and self.run.links.any():
            raise NotMeasurable(f"the engine {self.fidelity.engine} recorded no distances of linked agents")
        return found

    @property
    def closest_unlinked(self) -> Closest:
        """Closest approach ever of two agents that are not linked; infinitely far where all were linked.

        Raises
        ------
        NotResolvable
            When the engine does not record it.
        """
        found = self._checked(self.run.closest_unlinked)
        if not np.isfinite(found.distance) and self.run.n > 1 and not self._records_all_pairs:
            raise NotResolvable(f"the engine {self.fidelity.engine} records distances of linked agents only")
        return found

    @property
    def closest(self) -> Closest:
        """Closest approach ever of any two agents.

        Where an engine records linked pairs only, all others are further apart than the radius, unless the graph is
        fixed or agents have fields of view.
        """
        if self._records_all_pairs:
            return min(self._checked(self.run.closest_unlinked), self.closest_linked, key=lambda c: c.distance)
        if not self.law.graph.moves or self.law.graph.sees_headings:
            raise NotMeasurable(f"the engine {self.fidelity.engine} records distances of linked agents only")
        reach = float(np.min(np.asarray(self.law.graph.appear_radius)))
        return min(self.closest_linked, Closest(reach), key=lambda c: c.distance)

    @property
    def _reach(self) -> float:
        """Largest distance at which links appear."""
        return float(np.max(np.asarray(self.law.graph.appear_radius)))

    def beyond_radius_at_end(self) -> float:
        """By how much the closest agents at the end are further apart than any distance at which links appear.

        Negative where headings or the past alone keep a pair apart; infinite for one agent.
        """
        return closest_pair(State(self.q[-1], self.q[-1]), self.run.scenario.space)[0] - self._reach

    def beyond_radius(self) -> float:
        """By how much agents stayed further apart than any distance at which links appear, at least.

        Where the engine records how near unlinked agents came, by that, else by the frames and the curves between them,
        less what agents may be off these. Minus infinity where frames are too few or lack, or agents too many, to know;
        negative where headings or the past alone may have kept a pair apart; infinite for one agent.
        """
        n, reach, space = self.run.n, self._reach, self.run.scenario.space
        if n < 2:
            return np.inf
        if self._records_all_pairs and np.isfinite(self.closest_unlinked.distance):
            return self.closest_unlinked.distance - reach
        complete = len(self.t) > 2 and self.t[0] <= self.run.scenario.start.t
        if not complete or n * len(self.t) > MOST_PLACES or not np.isfinite(reach):
            return -np.inf
        lowest = min(closest_pair(State(q, q), space)[0] for q in self.q) - reach
        motion, agents = RecordedMotion(self.run), np.arange(n)
        body = Ball(np.zeros(self.run.scenario.start.dimension), reach)
        for k in range(len(self.t) - 1):
            shares = np.array([[1.0 / 3.0], [0.5], [2.0 / 3.0]])
            times = self.t[k] - self.run.scenario.start.t + shares * (self.t[k + 1] - self.t[k])
            between = motion.at(np.broadcast_to(times, (3, n)), np.broadcast_to(agents, (3, n)))
            off = between.off_q[1]
            if not np.isfinite(off).all():
                return -np.inf
            # A cubic lies in the hull of its control points.
            places = np.stack([self.q[k], between.q[0], between.q[2], self.q[k + 1]], axis=1)
            points = np.einsum("pk,ikm->ipm", CONTROL_POINTS, places)
            centres = points.mean(axis=1)
            size = float((np.linalg.norm(points - centres[:, None], axis=2).max(axis=1) + off).max())
            if not space.is_open:
                # Another image of an agent than the nearest one to the middle of its curve.
                lowest = min(lowest, 0.5 * min(space.lengths) - 2.0 * size - reach)
            tree = tree_of(centres, space)
            most = max(lowest, 0.0) + reach + 2.0 * size
            if tree.count_neighbors(tree, most) > MOST_PLACES:
                return -np.inf
            i, j = tree.query_pairs(most, output_type="ndarray").T
            if not len(i):
                continue
            apart = centres[i] - centres[j]
            curves = points[i] - points[j] + (space.displacement(apart) - apart)[:, None]
            tolerance = RESOLVED * float(np.abs(points).max())
            _, found, hidden = searched_curves(body, 0.0, curves, off[i] + off[j], lowest, lowest, tolerance)
            lowest = min(lowest, found, hidden)
            if lowest <= 0.0:
                return lowest
        return lowest

    @property
    def _records_all_pairs(self) -> bool:
        return self.fidelity.approaches.pairs == "all"

    def _checked(self, found: Closest) -> Closest:
        inside = all(-1 <= agent < self.run.n for agent in found.pair)
        if np.isnan(found.distance) or found.distance < 0 or not inside:
            raise NotResolvable("the recorded closest approach is invalid")
        return found

    @cached_property
    def coincidences(self) -> list[tuple[float, tuple[int, int]]]:
        """Times and pairs of agents that are given at one point: at the start, or at a sample.

        Positions that are measured with an error show none. Later frames carry the error of the computation, and a part
        of a running run may begin later than its scenario.
        """
        if self.is_running:
            return []
        if not self.sampled:
            start = self.run.scenario.start
            return [(start.t, pair) for pair in _coincident(self.wrapped(start.q))]
        if self.position_error > 0:
            return []
        return [(float(t), pair) for t, q in zip(self.t, self.q, strict=True) for pair in _coincident(self.wrapped(q))]

    def linked_together(self, time: float, pair: tuple[int, int]) -> bool:
        """Whether a pair of `coincidences` is linked: agents at one point are within any radius."""
        graph = self.law.graph
        if graph.moves and not graph.sees_headings:
            return bool(np.min(np.asarray(graph.appear_radius)) > 0)
        links = self.frame_links[int(np.argmin(np.abs(self.t - time)))]
        return bool(links[pair] or links[pair[::-1]])


def _coincident(q: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> list[tuple[int, int]]:
    """Pairs of agents with equal positions ``q``, shape (N, m), that are neighbours in lexicographic order."""
    ranks = np.lexsort(q.T)
    same = (q[ranks[1:]] == q[ranks[:-1]]).all(axis=1)
    return [(int(min(a, b)), int(max(a, b))) for a, b in zip(ranks[:-1][same], ranks[1:][same], strict=True)]
