"""Links that a motion rules out whatever its error: pairs that are farther apart than any link reaches."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array
from flocking.model.graphs.connectivity import Links, is_connected
from flocking.study.evidence.basis import NotResolvable
from flocking.study.evidence.doubts import DoubtEvidence
from flocking.study.evidence.motion import MotionEvidence

MOST_AGENTS = 2_000
"""Largest group of which all pairs are compared at frames, a bound on time and memory."""


class FarthestLinkEvidence(DoubtEvidence, MotionEvidence):
    """What frames refute within the estimated error of the motion, see `flocking.study.evidence.repetitions`."""

    def apart_for_certain(self) -> float:
        """First frame at which the graph is disconnected whichever pairs may be linked; infinite if there is none.

        Raises
        ------
        NotResolvable
            When the error of the motion is not known, or there are no frames or too many agents for it.
        """
        errors = self._errors_at_frames()
        late = np.flatnonzero(self.t >= self.seen_disconnected).tolist()
        return next((float(self.t[k]) for k in late if not is_connected(self._linked_at_most(k, errors[k]))), np.inf)

    def lost_for_certain(self) -> int:
        """Number of links of the start, which is given, whose agents are out of reach at a frame.

        Raises
        ------
        NotResolvable
            As `apart_for_certain` does, and when frames have no links.
        """
        errors, links = self._errors_at_frames(), self.start_links
        kept = np.array(links)
        for k, error in enumerate(errors.tolist()):
            kept &= self._linked_at_most(k, error)
        return int((links & ~kept).sum()) // (1 if self.law.graph.directed else 2)

    def _errors_at_frames(self) -> Array:
        if not len(self.t):
            raise NotResolvable("repetitions are compared at frames, and the run has none")
        if self.run.n > MOST_AGENTS:
            raise NotResolvable(f"all pairs of {self.run.n} agents are too many to compare")
        return self.repetitions.position_errors(self.checked)

    def _linked_at_most(self, k: int, error: float) -> Links:
        """Pairs that may be linked at frame ``k`` by their distance, if each agent is off by up to ``error``."""
        q, graph = np.asarray(self.q[k], dtype=np.float64), self.law.graph
        leaves = np.broadcast_to(np.maximum(graph.appear_radius, graph.break_radius), len(q))
        reach = np.maximum(leaves[:, None], leaves[None, :]) + 2.0 * error
        offsets = self.run.scenario.space.displacement(q[None] - q[:, None])
        near = np.asarray(np.linalg.norm(offsets, axis=2) <= reach)
        np.fill_diagonal(near, False)
        return near
