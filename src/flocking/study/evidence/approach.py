"""Closest approaches of agents."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property

import numpy as np

from flocking.engine.runs.run import Closest
from flocking.model.observables import closest_pair
from flocking.model.state import State
from flocking.study.evidence.basis import NotMeasurable, NotResolvable, stated
from flocking.study.evidence.doubts import DoubtEvidence
from flocking.study.evidence.motion import MotionEvidence


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

    def beyond_radius(self, frames: Iterable[int]) -> float:
        """By how much the closest agents at some frames are further apart than any distance at which links appear.

        Negative where headings or the past alone keep a pair apart; infinite for one agent.

        Parameters
        ----------
        frames
            Numbers of the frames.
        """
        space, reach = self.run.scenario.space, float(np.max(np.asarray(self.law.graph.appear_radius)))
        found = (closest_pair(State(self.q[k], self.q[k]), space)[0] for k in frames)
        return min(found, default=np.inf) - reach

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
