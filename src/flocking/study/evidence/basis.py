"""What every kind of evidence starts from: the run, and how much of it was recorded."""

from __future__ import annotations

import numpy as np

from flocking.engine.run import Run
from flocking.model.checks import Array
from flocking.model.law import Law

MOST_DENSE = 4000
"""Largest group whose pairs are all looked at at once."""


class NotMeasurable(Exception):  # noqa: N818  a verdict, not a fault
    """A quantity that this run does not let one compute; a claim that needs it is not applicable."""


class RunEvidence:
    """A run and how it was made.

    Parameters
    ----------
    run
        The run.
    """

    def __init__(self, run: Run) -> None:
        self.run = run

    @property
    def law(self) -> Law:
        """The declared law."""
        return self.run.scenario.law

    @property
    def sampled(self) -> bool:
        """Whether the run is made of samples from elsewhere: nothing is known between them."""
        return self.run.provenance.get("engine") == "samples"

    @property
    def switches_known(self) -> bool:
        """Whether every switch of a link is recorded; else only the frames say who was linked."""
        return not self.sampled and self.run.provenance.get("switches") != "not recorded"

    @property
    def masses(self) -> Array:
        """Mass of each agent, shape (N,)."""
        return np.broadcast_to(np.asarray(self.run.scenario.agents.masses, dtype=np.float64), self.run.n)

    @property
    def fixed_step(self) -> bool:
        """Whether the engine took fixed steps: its ledger closes to the order of its scheme, not to a tolerance."""
        return "scheme" in self.run.provenance

    def _need_frames(self) -> None:
        if not len(self.run.t):
            raise NotMeasurable("the run keeps no frames")

    def _need_all_pairs(self) -> None:
        self._need_frames()
        if self.run.n > MOST_DENSE:
            raise NotMeasurable(f"{self.run.n} agents have too many pairs")
