"""The energy ledger of a run: its residual, and how large it may be."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from flocking.engine.fixed_step.step_checks import RESIDUAL
from flocking.model.checks import Array
from flocking.study.evidence.basis import NotResolvable, stated
from flocking.study.evidence.links import LinkEvidence

LEDGER_FACTOR = 100.0
"""The ledger must close to this many tolerances times the total energy moved."""

EXPLAINED = 4.0
"""The ledger of a run that knows its integration error may stay open by this many times what that error explains."""

MOST_EXPLAINED = 1e-3
"""Share of the energy moved beyond which an open ledger shows nothing, though the integration error explains it."""

DOUBT = 3.0
"""How much larger than estimated the error of a ledger of samples may be."""

SLACK = 1e-6
"""Share of a radius within which a pair may be linked or not."""


class LedgerEvidence(LinkEvidence):
    """Whether the declared law explains the energy of the motion."""

    @property
    def residuals(self) -> Array:
        """What the ledger leaves unexplained at each of its rows; raises as `trace` does."""
        return self.run.residual if len(self.trace) else np.zeros(0)

    @cached_property
    def step_residual(self) -> float:
        """Largest part of a single step's energy that the ledger does not explain, with rounding."""
        size = float(np.abs(self.trace["energy"]).max(initial=0.0))
        return float(np.abs(np.diff(self.residuals)).max(initial=0.0)) + 1e-12 * size

    @cached_property
    def ledger_bound(self) -> float:
        """How large the ledger's residual may be: 100 tolerances times the energy moved, plus rounding.

        Where the run knows what its integration error leaves unexplained, as much as that, up to a small share of the
        energy moved.

        Between samples of a motion from elsewhere the powers are interpolated, and their error takes its place. A
        fixed step is held to what its engine holds it to, a share of the energy moved.
        """
        rule = self.fidelity.ledger
        if rule.kind == "unknown":
            raise NotResolvable("the run does not tell what its ledger is held to")
        held_to = stated(rule.size, "what its ledger is held to")
        if rule.kind == "share":
            return held_to * self.energy_moved + 1e-14
        if rule.kind == "estimate":
            size = float(np.abs(self.trace["energy"]).max(initial=0.0))
            return 3 * held_to + stated(rule.switch_error, "what switches add to its ledger") + 1e-9 * size
        size = float(np.abs(self.trace["energy"]).max(initial=0.0))
        explained = min(self.explained_residual, MOST_EXPLAINED * self.energy_moved)
        return max(LEDGER_FACTOR * held_to * self.run.turnover, explained) + 1e-12 * size + 1e-14

    @property
    def explained_residual(self) -> float:
        """How large a residual the integration error explains; 0 where it is not known to explain any."""
        accuracy = self.run.accuracy
        if accuracy is None or "ledger" not in accuracy.largest:
            return 0.0
        return EXPLAINED * accuracy.largest["ledger"].value

    @cached_property
    def energy_moved(self) -> float:
        """Energy worked, dissipated, supplied and jumped over the run, with the kinetic energy at both ends."""
        kinetic, size = self.trace["kinetic"], self.run.turnover
        return size + float(np.abs(np.diff(self.trace["jumped"])).sum() + kinetic[0] + kinetic[-1])

    @cached_property
    def ledger_doubt(self) -> str:
        """Why a ledger can neither close nor stay open; empty when it can.

        The integration error of a computed motion may explain what is missing, and be too large to show anything.
        Too few samples leave open how much was dissipated between them. A link of which samples do not tell whether it
        is there leaves open what it stores; a ledger that closes shows that it was guessed right.
        """
        if not self.sampled:
            if self.ledger_bound < self.residual <= self.explained_residual:
                return f"{self._ledger_sizes}, and the integration error explains {self.explained_residual:.1e}"
            return ""
        if not self.ledger_bound <= RESIDUAL * self.energy_moved:
            return (
                f"samples too far apart for a ledger: {self.ledger_bound:.1e} may be missing of the "
                f"{self.energy_moved:.1e} moved"
            )
        if self.residual > self.ledger_bound and self.unsure_links.any():
            return f"{self._ledger_sizes}, but samples do not tell of each link whether it is there"
        if self.ledger_bound < self.residual <= DOUBT * self.ledger_bound:
            return f"{self._ledger_sizes}, and that is only an estimate of what samples this far apart may miss"
        return ""

    @cached_property
    def residual(self) -> float:
        """Largest absolute residual of the energy ledger over the run."""
        return float(np.abs(self.residuals).max(initial=0.0))

    @cached_property
    def foreign_link(self) -> str:
        """What contradicts the declared graph at the last frame: a link too long, or one that is missing.

        The ledger of an engine adds over the links that were at work, whoever made them. Earlier frames may belong
        to a law that was replaced on the way.
        """
        graph, state = self.law.graph, self.state(-1) if len(self.run.t) else None
        if state is None or state.links is None or graph.sees_headings or not self.switches_known:
            return ""
        distance = self.distances(state.q)
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
    def foreign_force(self) -> str:
        """What contradicts the declared law among the forces and powers of an engine that were held against it.

        A fixed step's ledger closes to the error of the step, which hides a gain that is off by a per cent; forces
        themselves agree to rounding.
        """
        law = self.fidelity.law
        if law is None:
            return ""
        gap, allowed = (stated(value, "how far forces are from its law") for value in (law.gap, law.allowed))
        if gap <= allowed:
            return ""
        return (
            f"a force or power is off the declared law's by {100 * gap:.3g} %, rounding explains {100 * allowed:.2g} %"
        )

    @property
    def ledger_closes(self) -> bool:
        """Whether the declared law explains the energy of the computed motion."""
        broken = self.foreign_link or self.foreign_force or self.ledger_doubt
        return self.residual <= self.ledger_bound and not broken

    @property
    def ledger_note(self) -> str:
        """The residual and its bound in words, or what else keeps the ledger from closing."""
        return self.foreign_link or self.foreign_force or self.ledger_doubt or self._ledger_sizes

    @property
    def _ledger_sizes(self) -> str:
        rule, law = self.fidelity.ledger, self.fidelity.law
        share = f" ({100 * rule.size:g} % of the energy moved, for a fixed step)" if rule.kind == "share" else ""
        if law is not None and law.checks:
            gap = stated(law.gap, "how far forces are from its law")
            share += f"; forces are those of the law to {gap:.0e} of their parts, looked at {law.checks} times"
        return f"ledger residual {self.residual:.2e}, allowed {self.ledger_bound:.2e}{share}"
