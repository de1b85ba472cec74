"""The energy ledger of a run: its residual, and how large it may be."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from flocking.engine.step_checks import RESIDUAL
from flocking.model.graphs import pair_distances
from flocking.study.evidence.basis import NotMeasurable, RunEvidence

LEDGER_FACTOR = 100.0
"""The ledger must close to this many tolerances times the total energy moved."""

SLACK = 1e-6
"""Share of a radius within which a pair may be linked or not."""


class LedgerEvidence(RunEvidence):
    """Whether the declared law explains the energy of the motion."""

    @cached_property
    def step_residual(self) -> float:
        """Largest part of a single step's energy that the ledger does not explain, with rounding."""
        size = float(np.abs(self.run.trace["energy"]).max(initial=0.0))
        return float(np.abs(np.diff(self.run.residual)).max(initial=0.0)) + 1e-12 * size

    @cached_property
    def ledger_bound(self) -> float:
        """How large the ledger's residual may be: 100 tolerances times the energy moved, plus rounding.

        Between samples of a motion from elsewhere the powers are interpolated, and their error takes its place. A
        fixed step is held to what its engine holds it to, a share of the energy moved.
        """
        if self.fixed_step and len(self.run.trace):
            kinetic = self.run.trace["kinetic"]
            moved = self.run.turnover + float(np.abs(np.diff(self.run.trace["jumped"])).sum())
            return RESIDUAL * (moved + float(kinetic[0] + kinetic[-1])) + 1e-14
        if self.sampled:
            size = float(np.abs(self.run.trace["energy"]).max(initial=0.0))
            return 3 * float(self.run.provenance["ledger_error"]) + 1e-9 * size
        tolerance = float(self.run.provenance.get("tolerance", self.run.scenario.tolerance))
        size = float(np.abs(self.run.trace["energy"]).max(initial=0.0))
        return LEDGER_FACTOR * tolerance * self.run.turnover + 1e-12 * size + 1e-14

    @cached_property
    def residual(self) -> float:
        """Largest absolute residual of the energy ledger over the run."""
        if not len(self.run.trace):
            raise NotMeasurable("the run has no ledger to vouch for its motion")
        return float(np.abs(self.run.residual).max(initial=0.0))

    @cached_property
    def foreign_link(self) -> str:
        """What contradicts the declared graph at the last frame: a link too long, or one that is missing.

        The ledger of an engine adds over the links that were at work, whoever made them. Earlier frames may belong
        to a law that was replaced on the way.
        """
        graph, state = self.law.graph, self.run.state(-1) if len(self.run.t) else None
        if state is None or state.links is None or graph.sees_headings or not self.switches_known:
            return ""
        distance = pair_distances(state.q)
        if graph.moves:
            leaves, enters = (np.asarray(r)[..., None] for r in (graph.break_radius, graph.appear_radius))
            wrong = state.links & (distance > leaves * (1 + SLACK)) | ~state.links & (distance < enters * (1 - SLACK))
        else:
            wrong = state.links != graph.initial(state.q)
        if not wrong.any():
            return ""
        i, j = (int(k) for k in np.argwhere(wrong)[0])
        what = "are linked" if state.links[i, j] else "are not linked"
        return f"agents {i} and {j}, {distance[i, j]:.4g} apart, {what} at the end, against the declared graph"

    @property
    def ledger_closes(self) -> bool:
        """Whether the declared law explains the energy of the computed motion."""
        return self.residual <= self.ledger_bound and not self.foreign_link

    @property
    def ledger_note(self) -> str:
        """The residual and its bound in words."""
        share = f" ({100 * RESIDUAL:g} % of the energy moved, for a fixed step)" if self.fixed_step else ""
        return f"ledger residual {self.residual:.2e}, allowed {self.ledger_bound:.2e}{share}"
