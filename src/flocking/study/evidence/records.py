"""Whether frames and records of a run fit each other: what one of them shows may not be in the other."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from flocking.arrays import Array
from flocking.model.observables import closest_pair
from flocking.model.state import State
from flocking.study.evidence.approach import ApproachEvidence
from flocking.study.evidence.basis import NotMeasurable, NotResolvable

CLOSER = 1e-6
"""Share of a recorded closest approach by which a frame may be below it: far above rounding, and of no consequence."""

MOST_COMPARED = 200_000
"""Agents in all frames that are compared, a bound on time: about a second. Of longer runs evenly chosen frames are."""


class RecordEvidence(ApproachEvidence):
    """Frames held against the closest approaches and the switches that a run records.

    Conclusions rest on these records between frames. Where agents are closer at a frame than they ever were, or have a
    link to which the switches do not lead, the run was changed after it was computed, its records are wrong, or its law
    was replaced while it went on, which changes links at once.
    """

    @property
    def _compared(self) -> list[int]:
        frames = len(self.run.t)
        count = max(2, min(frames, MOST_COMPARED // self.run.n))
        return [int(k) for k in np.unique(np.linspace(0, frames - 1, count).round())]

    @cached_property
    def foreign_approach(self) -> str:
        """What contradicts the recorded closest approach at a frame; empty when nothing does."""
        near = self.fidelity.approaches
        if self.sampled or near.looked or not self._records_all_pairs:
            return ""
        try:
            found = self.closest
        except (NotMeasurable, NotResolvable):
            return ""
        if not np.isfinite(found.distance):
            return ""
        # Frames and records are of the computed motion: what the exact one may differ by counts where it is known.
        late = float(np.nan_to_num(found.error)) + (near.error or 0.0)
        size = float(np.abs(self.q).max()) * float(np.finfo(self.run.q.dtype).eps) * 2 * np.sqrt(self.q.shape[2])
        least = found.distance * (1 - CLOSER) - late - size
        for k in self._compared:
            distance, (i, j) = closest_pair(State(self.q[k]), self.run.scenario.space)
            if distance < least:
                return (
                    f"agents {i} and {j} are {distance:.4g} apart at the frame of t = {self.when(self.t[k])}, and the "
                    f"run records {found.distance:.4g} as the closest approach of all"
                )
        return ""

    @cached_property
    def foreign_switches(self) -> str:
        """What contradicts the recorded switches at a frame; empty when nothing does."""
        shape = (len(self.run.t), self.run.n, self.run.n)
        if self.sampled or not self.switches_known or not self.law.graph.moves or self.run.links.shape != shape:
            return ""
        history, rows = self.link_history, self.link_switches
        begins = np.array([time for time, _ in history])
        at: Array = rows["time"]
        errors: Array = rows["time_error"]
        late = np.nan_to_num(errors) + 2 * np.spacing(np.abs(at))
        for k in self._compared:
            t = float(self.t[k])
            wrong = self.frame_links[k] != history[int(np.searchsorted(begins, t, side="right")) - 1][1]
            for row in rows[np.abs(rows["time"] - t) <= late]:
                wrong[row["i"], row["j"]] = wrong[row["j"], row["i"]] = False
            if wrong.any():
                i, j = (int(agent) for agent in np.argwhere(wrong)[0])
                what = "are linked" if self.frame_links[k, i, j] else "are not linked"
                return (
                    f"agents {i} and {j} {what} at the frame of t = {self.when(t)}, to which the recorded switches do "
                    "not lead"
                )
        return ""
