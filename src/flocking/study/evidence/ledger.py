"""The energy ledger of a run: its residual, and how large it may be."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flocking.engine.fixed_step.step_checks import ENERGY_ROUNDING, RESIDUAL
from flocking.engine.reference.control import evaluate_each
from flocking.engine.runs.message_log import changed_times
from flocking.formula.safe_digits import compared_texts
from flocking.model.checks import Array
from flocking.model.state import State
from flocking.study.evidence.basis import NotResolvable, stated
from flocking.study.evidence.energy_sizes import energy_size
from flocking.study.evidence.links import LinkEvidence

LEDGER_FACTOR = 100.0
"""The ledger must close to this many tolerances times the total energy moved."""

EXPLAINED = 4.0
"""Where the integration error is known, the residual may be this many times as large as the error explains."""

MOST_EXPLAINED = 1e-3
"""Share of the energy moved beyond which a residual is inconclusive although the integration error explains it."""

DOUBT = 3.0
"""Factor by which the error of a ledger of samples may exceed its estimate."""

SLACK = 1e-6
"""Share of a radius within which a pair may be linked or not."""

MOST_PAIRS = 20_000_000
"""Pairs in all frames whose links are compared, a bound on time: about a second."""

MOST_COMPARED = 2_000
"""Agents of which the energy of the last frame is computed again, a bound on time: all pairs are visited."""

ROUNDING, INTERPOLATION_ROUNDING = 1e-12, 1e-9
"""Rounding of a computed ledger and of one integrated over samples, as shares of the largest energy."""

CLOSE = 0.5
"""Share of its bound from which a residual is near it: a rise of the energy is at most twice the residual."""

RESTING = 16.0
"""Largest change of a coordinate that is rounding alone, in units of the rounding of the largest one."""

CANCELLED = 1e-14
"""Rounding of an energy in double precision as a share of the terms that cancel in it, see `energy_size`: fifty units
of rounding."""

TOO_SMALL = "energies in which larger terms cancel decide nothing where rounding is as large as they are"
"""Why a difference of energies is inconclusive."""


class LedgerEvidence(LinkEvidence):
    """Whether the declared law explains the energy of the motion."""

    @property
    def residuals(self) -> Array:
        """Residual at each row of the ledger; raises as `trace` does."""
        return self.run.residual if len(self.trace) else np.zeros(0)

    def changes(self, name: str) -> Array:
        """Change of the column ``name`` of the ledger from each row to the next; raises as `trace` does."""
        column: Array = self.trace[name]
        return np.diff(column)

    @cached_property
    def step_residual(self) -> float:
        """Largest change of the residual in a step, plus rounding."""
        return float(np.abs(np.diff(self.residuals)).max(initial=0.0)) + ROUNDING * self._largest_energy

    @property
    def _largest_energy(self) -> float:
        return float(np.abs(self.trace["energy"]).max(initial=0.0))

    @cached_property
    def cancelled(self) -> float:
        """Rounding of energies in which larger terms cancel, as the potential of a link near its length of rest."""
        share = max(CANCELLED, RESTING * float(np.finfo(self.run.q.dtype).eps))
        return share * energy_size(self.run)

    @cached_property
    def ledger_bound(self) -> float:
        """Bound of the residual: 100 tolerances times the energy moved, plus rounding.

        It rises to what the integration error explains, where that is known, up to a small share of the energy moved.
        For samples it is the error of the interpolated powers; for a fixed step the share of the energy moved that its
        engine states. Rounding of terms that cancel is added where a residual comes near to the rest.
        """
        bound = self._resolved_bound
        near = self.fidelity.ledger.kind != "estimate" and self.residual > CLOSE * bound
        return bound + self.cancelled if near else bound

    @cached_property
    def _resolved_bound(self) -> float:
        """The bound without the rounding of terms that cancel."""
        rule = self.fidelity.ledger
        if rule.kind == "unknown":
            raise NotResolvable(f"the run does not state the bound of its ledger{self.why_no_ledger}")
        size = stated(rule.size, "the bound of its ledger")
        if rule.kind == "share":
            rounding = ENERGY_ROUNDING * float(np.finfo(self.run.q.dtype).eps) * self._largest_energy
            return size * (self.energy_moved + rounding)
        if rule.kind == "estimate":
            switch_error = stated(rule.switch_error, "what switches add to its ledger")
            return DOUBT * size + switch_error + INTERPOLATION_ROUNDING * self._largest_energy
        explained = min(self.explained_residual, MOST_EXPLAINED * self.energy_moved)
        return max(LEDGER_FACTOR * size * self.run.turnover, explained) + ROUNDING * self._largest_energy

    @property
    def explained_residual(self) -> float:
        """Residual that the integration error explains; 0 where that is unknown."""
        accuracy = self.run.accuracy
        if accuracy is None or "ledger" not in accuracy.largest:
            return 0.0
        return EXPLAINED * accuracy.largest["ledger"].value

    @cached_property
    def energy_moved(self) -> float:
        """Energy worked, dissipated, supplied and jumped over the run, with the kinetic energy at both ends."""
        kinetic, size = self.trace["kinetic"], self.run.turnover
        return size + float(np.abs(self.changes("jumped")).sum() + kinetic[0] + kinetic[-1])

    @cached_property
    def ledger_doubt(self) -> str:
        """Why the ledger is inconclusive; empty when it is not.

        The integration error may explain the residual but be too large for a verdict; samples may be too far apart; a
        residual may come from a link that samples leave uncertain.
        """
        if not self.sampled:
            if self.ledger_bound < self.residual <= self.explained_residual:
                return f"{self._ledger_sizes}, and the integration error explains {self.explained_residual:.1e}"
            if self.ledger_bound < self.residual <= 2.0 * self.fidelity.ledger.rounding:
                return f"{self._ledger_sizes}, and rounding of distances may explain it: agents hardly move"
            return self._tiny_energies
        if not self.ledger_bound <= RESIDUAL * self.energy_moved:
            return (
                f"samples too far apart for a ledger: {self.ledger_bound:.1e} may be missing of the "
                f"{self.energy_moved:.1e} moved"
            )
        if self.residual > self.ledger_bound and (world := self.run.scenario.imperfections):
            return f"samples do not show whether the law moved the agents: {world}"
        if self.residual > self.ledger_bound and self.uncertain_links.any():
            return f"{self._ledger_sizes}, but samples leave some links uncertain"
        if self.ledger_bound < self.residual <= DOUBT * self.ledger_bound:
            return f"{self._ledger_sizes}, and the bound is only an estimate for samples this far apart"
        return ""

    @property
    def _tiny_energies(self) -> str:
        """Why a residual is inconclusive that only rounding of terms that cancel lets pass; else empty."""
        if self.fidelity.ledger.kind not in ("tolerance", "share"):
            return ""
        size = self._largest_energy + self.energy_moved
        if not self._resolved_bound < self.residual <= self.ledger_bound:
            return ""
        if self.residual <= MOST_EXPLAINED * size or self._at_rest:
            return ""
        return f"ledger residual {self.residual:.1e} of energies of {size:.1e}: {TOO_SMALL}"

    @cached_property
    def residual(self) -> float:
        """Largest absolute residual of the energy ledger over the run."""
        return float(np.abs(self.residuals).max(initial=0.0))

    @cached_property
    def foreign_link(self) -> str:
        """What contradicts the declared graph at a frame: a link too long, or one that is missing.

        The ledger of an engine sums over the links it used, right or wrong. Earlier frames may belong to a law that was
        replaced during the run, and pairs whose links a start states against its distances keep them for a while.
        """
        graph = self.law.graph
        if not len(self.run.t) or graph.sees_headings or not self.switches_known:
            return ""
        start = self.run.scenario.start
        stated = None if start.links is None else self._against_graph(start)
        for frame in self._linked_frames:
            state = self.state(frame)
            if state.links is None:
                return ""
            wrong = self._against_graph(state)
            if stated is not None:
                wrong &= ~stated
            if wrong.any():
                i, j = (int(k) for k in np.argwhere(wrong)[0])
                what = "are linked" if state.links[i, j] else "are not linked"
                apart = float(self.distances(state.q)[i, j])
                when = "the end" if frame == len(self.run.t) - 1 else f"t = {self.when(state.t)}"
                return f"agents {i} and {j}, {apart:.4g} apart, {what} at {when}, against the declared graph"
        return ""

    @property
    def _linked_frames(self) -> list[int]:
        """Frames whose links are compared, the last one first, which is alone where a law or state was replaced."""
        frames, count = len(self.run.t), max(2, MOST_PAIRS // self.run.n**2)
        if changed_times(self.run.provenance):
            return [frames - 1]
        chosen = np.unique(np.linspace(0, frames - 1, min(count, frames)).round())
        return [frames - 1, *(int(k) for k in chosen if k < frames - 1)]

    def _against_graph(self, state: State) -> NDArray[np.bool_]:
        """Which pairs have a link that is too long, or none although they are near; shape (N, N)."""
        graph, links = self.law.graph, np.asarray(state.links)
        if not graph.moves:
            return np.asarray(links != graph.initial(state.q))
        distance, m = self.distances(state.q), state.q.shape[1]
        # Far from the origin frames are rounded by more than that; engines compute near the agents.
        rounded = float(np.sqrt(m) * np.finfo(self.run.q.dtype).eps * np.abs(state.q).max(initial=0.0))
        leaves, enters = (np.asarray(r)[..., None] for r in (graph.break_radius, graph.appear_radius))
        farther, nearer = distance > leaves * (1 + SLACK) + rounded, distance < enters * (1 - SLACK) - rounded
        return np.asarray(links & farther | ~links & nearer)

    @cached_property
    def foreign_motion(self) -> str:
        """What contradicts the ledger at the last frame: another energy of its positions and velocities.

        The ledger is of the motion that was computed; frames that were changed since are not. Where forces follow what
        agents knew, the kinetic energy alone is compared. Engines with a fixed step keep frames in fewer digits, and
        of very large groups the energy takes long: theirs are not compared.
        """
        kind, scenario = self.fidelity.ledger.kind, self.run.scenario
        if self.sampled or kind not in ("tolerance", "estimate") or self.run.n > MOST_COMPARED or not len(self.t):
            return ""
        rows = self.trace[self.trace["time"] == self.t[-1]]
        if not len(rows):
            return ""
        found = evaluate_each(scenario, [self.state(-1)])[0]
        compared = {"kinetic energy": (found.kinetic, rows["kinetic"])}
        links = self.state(-1).links
        # Far from the origin frames are rounded to a share of the group's size, and the energy of distances with them.
        q = self.q[-1]
        coarse = float(np.spacing(np.abs(q).max(initial=0.0))) > SLACK * float(np.ptp(q, axis=0).max(initial=0.0))
        if kind == "tolerance" and not coarse and not scenario.imperfections and links is not None:
            apart = (self.run.n * (self.run.n - 1) - int(np.count_nonzero(links))) / 2
            compared["energy"] = found.storage + found.kinetic + apart * scenario.energy.unlinked, rows["energy"]
        size = self._largest_energy + float(self.trace["kinetic"].max()) + self.energy_moved
        for name, (energy, recorded) in compared.items():
            gap = float(np.abs(recorded - energy).min())
            if gap <= SLACK * size or (self._at_rest and gap <= self.cancelled):
                continue
            said = f"the last frame has the {name} {energy:.9g}, and the ledger records {recorded[-1]:.9g} there"
            return said if not gap <= self.cancelled else f"{said}; {TOO_SMALL}"
        return ""

    @property
    def _at_rest(self) -> bool:
        """Whether agents stay where they are but for rounding, so that their energies are rounding as well."""
        if not len(self.q):
            return False
        rounding = max(ROUNDING, RESTING * float(np.finfo(self.run.q.dtype).eps))
        return bool(np.abs(self.q - self.q[0]).max() <= rounding * np.abs(self.q).max())

    @property
    def foreign_force(self) -> str:
        """What contradicts the declared law among the forces and powers of an engine that were compared with it.

        The ledger of a fixed step closes to the error of the step, which hides a gain that is wrong by one per cent;
        forces agree to rounding.
        """
        law = self.fidelity.law
        if law is None:
            return ""
        gap, allowed = (stated(value, "the difference of its forces from its law") for value in (law.gap, law.allowed))
        if gap <= allowed:
            return ""
        found, explained = compared_texts(100 * gap, 100 * allowed)
        return f"a force or power differs from the declared law's by {found} %; rounding explains {explained} %"

    @property
    def ledger_closes(self) -> bool:
        """Whether the declared law explains the energy of the computed motion, or in discrete time its forces."""
        if self.fidelity.ledger.kind == "forces":
            return self.fidelity.law is not None and self.fidelity.law.checks > 0 and not self.foreign_force
        broken = self.foreign_link or self.foreign_motion or self.foreign_force or self.ledger_doubt
        return self.residual <= self.ledger_bound and not broken

    @property
    def ledger_note(self) -> str:
        """The residual and its bound in words, or why the ledger does not close."""
        if self.fidelity.ledger.kind == "forces":
            return self.foreign_force or self._forces_compared
        broken = self.foreign_link or self.foreign_motion or self.foreign_force
        return broken or self.ledger_doubt or self._ledger_sizes

    @property
    def _forces_compared(self) -> str:
        """How often forces were compared with the law, in words."""
        law = self.fidelity.law
        if law is None or not law.checks:
            return "forces were never compared with the declared law"
        return f"no ledger in discrete time; forces are those of the law in {law.checks} comparisons"

    @property
    def _ledger_sizes(self) -> str:
        rule, law = self.fidelity.ledger, self.fidelity.law
        share = f" ({100 * rule.size:g} % of the energy moved, for a fixed step)" if rule.kind == "share" else ""
        if law is not None and law.checks:
            gap = stated(law.gap, "the difference of its forces from its law")
            share += f"; forces are those of the law to {gap:.0e} of their parts in {law.checks} comparisons"
        residual, allowed = compared_texts(self.residual, self.ledger_bound)
        return f"ledger residual {residual}, allowed {allowed}{share}"
