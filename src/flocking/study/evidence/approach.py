"""How close agents came to each other."""

from __future__ import annotations

import numpy as np

from flocking.engine.run import Closest
from flocking.study.evidence.basis import NotMeasurable
from flocking.study.evidence.motion import MotionEvidence


class ApproachEvidence(MotionEvidence):
    """Closest approaches, between frames too where the engine looked there."""

    @property
    def approach_error(self) -> float:
        """How much closer than recorded two agents may have come."""
        if self.sampled:
            return float(self.run.provenance["gap"])
        if "farthest" in self.run.provenance:
            return float(self.run.provenance["farthest"])
        if "closest" in self.run.provenance:
            raise NotMeasurable(f"agents' distances were looked at only {self.run.provenance['closest']}")
        return 10 * self.run.scenario.tolerance * max(1.0, float(self.diameter[0]))

    @property
    def closest_linked(self) -> Closest:
        """Closest approach ever of two linked agents; infinitely far where there was never a link."""
        found = self.run.closest_linked
        if not np.isfinite(found.distance) and self.run.links.any():
            raise NotMeasurable(f"the engine {self.run.provenance['engine']} did not look at linked agents' distances")
        return found

    @property
    def closest(self) -> Closest:
        """Closest approach ever of any two agents.

        Where an engine looks at linked pairs alone, all others are out of reach of each other, unless the graph
        is fixed.
        """
        if "farthest" not in self.run.provenance:
            return self.run.closest
        if not self.law.graph.moves:
            raise NotMeasurable(f"the engine {self.run.provenance['engine']} looks at linked agents' distances alone")
        reach = float(np.min(np.asarray(self.law.graph.appear_radius)))
        return min(self.closest_linked, Closest(reach), key=lambda c: c.distance)
