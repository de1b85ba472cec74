"""A running simulation of delayed knowledge: how it is replaced, saved and resumed."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from flocking.arrays import Array, Links
from flocking.engine.adaptive_steps.segment import Segment
from flocking.engine.archives.data_checks import Table
from flocking.engine.delayed.checkpoint import DelayedMemory, packed_memory, unpacked_memory
from flocking.engine.delayed.replacement import Replacement, replacement, same_law
from flocking.engine.delayed.stepping import DelayedSteps
from flocking.engine.imperfect.checkpoint_form import NEAR, must
from flocking.engine.imperfect.graph_views import views_of
from flocking.engine.imperfect.link_rules import known_rules, link_rules
from flocking.engine.protocol.session import Packed, Stored
from flocking.engine.runs.fidelity import Fidelity
from flocking.engine.runs.message_log import CHANGED, DELAYED, GRAPHS_CHANGED, NO_LOG
from flocking.errors import InvalidInput, SimulationError
from flocking.model.graphs.seen_headings import links_at_state
from flocking.model.law import Law, Scenario
from flocking.model.state import State
from flocking.model.world.times import PER_SECOND

CLOCK = 4.0 * float(np.finfo(np.float64).eps)
"""Rounding of a time since the start, as a share of the scenario's times of which it is the difference: two of these,
each rounded by half a unit, and the difference."""


OFF_LAW = 1e4
"""Largest difference of the slope of a stored step from that of the law, in tolerances over the length of the step: of
steps of the default tolerance in the tests it was 125 at most. At a tolerance of 1e-9 and steps of 0.1 that is a force
of 1e-4."""

WITHIN = (0.25, 0.5, 0.75)
"""Where on the last step it is compared: at its ends what agents know may jump."""


@dataclass(frozen=True)
class DelayedOptions:
    """Options of the engine: there are none."""


class DelayedSession(DelayedSteps):
    """Continuous control on delayed knowledge, with known and true links located.

    Parameters
    ----------
    scenario, longest_step
        As for `flocking.engine.delayed.stepping.DelayedSteps`.

    Attributes
    ----------
    replaced_at
        When the law or the state was replaced, in the scenario's time.
    graphs_changed
        When graphs were replaced last, in the scenario's time; None where they were not.
    """

    keeps_log = True

    def __init__(self, scenario: Scenario, longest_step: float = 1.0) -> None:
        self.options = DelayedOptions()
        self.replaced_at: list[float] = []
        super().__init__(scenario, longest_step)

    def _prepare(self, scenario: Scenario, longest_step: float) -> None:
        super()._prepare(scenario, longest_step)
        self.graphs_changed: float | None = None
        self._logged_links: Links | None = None
        """Links by what agents know as they are logged; None where those from now on are logged anyway."""

    # The log.

    def _note(self, seconds: float) -> None:
        """Log whom agents use from now on, where these are others than before."""
        log, known, before = self.records.log, self.known_links, self._logged_links
        if log is None:
            return
        changed = self._everybody if before is None else np.flatnonzero((known != before).any(axis=(0, 2)))
        if not changed.size:
            return
        self._logged_links = known.copy()
        receivers, senders = self._law.linked
        graphs = np.repeat(np.arange(len(known)), np.diff(self._law.offsets))
        rows = np.stack([graphs, senders, np.full(len(senders), DELAYED)], axis=1)
        force = self._force(seconds, np.array(self._segment.coefficients[-1]))
        log.act(int(seconds * PER_SECOND), changed, force[changed], [rows[receivers == agent] for agent in changed])

    # Replacement.

    def replace(self, *, law: Law | None = None, state: State | None = None) -> None:
        """Replace the law or the state from the session's time on; the past stays what it was.

        The present step ends, the forces jump, and the change of energy counts as a jump of the ledger. Graphs that a
        new law shares with the one before keep links and what agents know of them; under others both are those of a
        start. Agents know of another state when its delay has passed. A state with links sets those of the law's
        graph, and between agents that it does not move also what these know of them. An equal law changes nothing.

        Raises
        ------
        InvalidInput
            When law, state and agents disagree, or the new energy or a force is not finite; the session then goes on
            as it was.
        UnsupportedLaw
            When this engine cannot run the law.
        """
        law = None if law is None or same_law(law, self.scenario.law) else law
        if law is None and state is None:
            return
        new = replacement(self.engine, self.scenario, law, state, self.state, self._law)
        seconds = self._now()
        before = self._segment.at(seconds)
        while self._next_gains() <= seconds:
            self._change_gains()
        if seconds == self._segment.t1:
            self._end_step(seconds)
        saved, rows = dict(vars(self)), len(self.records.trace)
        self._part_from_what_is_saved()
        try:
            self._go_on_with(new, seconds, before)
        except (InvalidInput, SimulationError) as error:
            vars(self).update(saved)
            del self.records.trace[rows:]
            if isinstance(error, InvalidInput):
                raise
            raise InvalidInput(
                "DelayedSession", "law" if state is None else "state",
                "must give finite forces by the states that agents have and know",
                f"{error}", "Keep agents apart where the potential has a pole.",
            ) from None  # fmt: skip
        self.replaced_at = [*self.replaced_at, self.time]

    def _now(self) -> float:
        """The session's time in seconds from the start, within the last step, after what is accounted for."""
        segment, now = self._segment, max(self.time - self._base, self.accounted)
        rounding = self.delays.points.rounding(now) + CLOCK * (abs(self._base) + abs(self.time))
        if now >= segment.t1 - rounding:
            return segment.t1
        return segment.t0 if now <= segment.t0 + rounding and self.accounted <= segment.t0 else now

    def _part_from_what_is_saved(self) -> None:
        """Replace by copies what changes in place."""
        self.delays = self.delays.copy()
        self.history = self.delays.history
        self.links, self.known_links = self.links.copy(), self.known_links.copy()
        self.sums, self.errors, self.crossings = self.sums.copy(), self.errors.copy(), list(self.crossings)

    def _go_on_with(self, new: Replacement, seconds: float, before: Array) -> None:
        """Go on from a time with what is replaced.

        Parameters
        ----------
        new
            What is in force from then on.
        seconds, before
            The time since the start, and the state vector then.
        """
        self._account(seconds)
        self._record_row(seconds)
        energy, y = self.energy, before if new.state is None else new.law.joined(new.state)
        moved = new.jumping(before, y)
        self.scenario, self._delayed_law, self._segment = new.scenario, new.law, Segment.resting(seconds, y)
        terms = new.scenario.law.body_terms
        self._schedule = sorted({s for term in terms for s in term.switch_times(self._base, math.inf)})
        self.gains_changed = sum(self._since_start(t) <= seconds for t in self._schedule)
        self._take_gains()
        self._rules = link_rules(new.scenario.law.graphs, self.n)
        self._known_rules = known_rules(self._rules, new.scenario.law.graphs)
        self._views = views_of(new.scenario.law.graphs, new.scenario.agents.headings, new.scenario.start.q)
        self.delays.views = self._views
        self.history.end_at(seconds)
        self.delays.jumps.add(seconds, moved)
        self.delays.begin_step(seconds)
        self._logged_links = None
        if not new.keeps_graphs:
            self.graphs_changed = self.time
        if not new.keeps_links:
            self._renew_links(new, seconds, y, moved)
        # What was found on the rest of the step that has ended does not take place.
        self.obstacles = self._obstacles_at(seconds, y)
        self.crossings, self.pending = [], self.pending[:0]
        self.relink()
        self._relink_known()
        self.delays.points.jump(seconds, self._everybody, self.known_links)
        self._stepper = self._new_stepper(self._stepper.memory.step)
        self._change_bodies(seconds)
        self._check_slope()
        self.energy, self.kinetic = self._energy(seconds)
        if self._base + seconds <= self.ledger_ends:
            if not np.isfinite(self.energy):
                raise InvalidInput(
                    "DelayedSession", "law" if new.state is None else "state", "must have a finite energy",
                    self.energy, "Two neighbours are where the potential is infinite.",
                )  # fmt: skip
            self.jumped += self.energy - energy
        self.ledger_ends = min(self.ledger_ends, self._law.ledger_end(self._base + seconds))
        self._record_row(seconds)

    def _renew_links(self, new: Replacement, seconds: float, y: Array, moved: Links) -> None:
        """Take links of a new state or of other graphs, and what agents know of them.

        Parameters
        ----------
        new, seconds
            What is in force from a time on.
        y, moved
            The state vector, and the agents whose state jumps, shape (N,).
        """
        scenario, before, state = new.scenario, self.links, new.state or self.state
        headings = scenario.agents.headings
        self.links = np.array([links_at_state(g, scenario.space, state, headings) for g in scenario.law.graphs])
        if new.state is not None and new.state.links is not None:
            self.links[0] = new.state.links
        known = self.known_links
        if not new.keeps_graphs or new.state is None:
            kept = new.kept if new.state is None else []
            for graph, was in kept:
                self.links[graph] = before[was]
            self.known_links = self.links_by_known_distances(self.links.copy(), seconds, y)
            for graph, was in kept:
                self.known_links[graph] = known[was]
            return
        if new.state.links is not None:
            # Links that are cut or made without a move; of moves agents know when their delays have passed.
            known = np.where((self.links != before) & ~(moved | moved[:, None]), self.links, known)
        self.known_links = self.links_by_known_distances(known, seconds, y, self.delays.known_at_once(moved), moved)

    @property
    def about(self) -> dict[str, object]:
        """Provenance of the records, with the times of replacements, and why there is no log where there is none."""
        changed = {CHANGED: list(self.replaced_at)} if self.replaced_at else {}
        graphs = {} if self.graphs_changed is None else {GRAPHS_CHANGED: self.graphs_changed}
        none = {} if self.records.log is not None else {NO_LOG: "an earlier version, which kept none, began it"}
        return super().about | changed | graphs | none

    @property
    def fidelity(self) -> Fidelity:
        """As of all engines of adaptive steps, and whether law or state were replaced."""
        return dataclasses.replace(super().fidelity, changed=bool(self.replaced_at))

    # Saving.

    @property
    def _memory(self) -> DelayedMemory:
        """What the session goes on from."""
        return DelayedMemory(
            self.truth, self.history, self._segment, self.known_links, self.pending, self.delays, self._law.held,
            self.obstacles, self.replaced_at,
        )  # fmt: skip

    def _recall_changes(self, packed: Packed) -> Packed:
        """Take from what was packed how the session was changed, and return the rest."""
        numbers, arrays = packed
        if "graphs_changed" in arrays:
            Table("f8", (1,)).check(arrays["graphs_changed"], "graphs_changed")
            self.graphs_changed = float(arrays["graphs_changed"][0])
            times = arrays.get("replaced_at", np.zeros(0))
            must(bool((times == self.graphs_changed).any()), "graphs_changed", "be when a law was replaced")
        return numbers, {name: array for name, array in arrays.items() if name != "graphs_changed"}

    def _recall_log(self, stored: Stored) -> None:
        """Go on with the log of a stored run, or without where it has none though steps were made."""
        begun = bool(stored.counts.get("tick"))
        if self.steps and not begun:
            self.records.log = None
        # No step has been made since a replacement: what is used from then on has not been logged.
        if begun and self._segment.t1 > self._segment.t0:
            self._logged_links = self.known_links.copy()

    def pack(self) -> Packed:
        """All that another session needs to go on bit for bit, but its scenario and its records."""
        memory = self._memory
        memory.truth.numbers |= {"step": self._stepper.memory.step, "short_steps": float(self._short_steps)}
        numbers, arrays = packed_memory(memory)
        if self.graphs_changed is not None:
            arrays = {**arrays, "graphs_changed": np.array([self.graphs_changed])}
        return numbers, arrays

    @classmethod
    def unpack(cls, packed: Packed, stored: Stored, changes: Mapping[str, object]) -> DelayedSession:
        """The session that was packed."""
        session = cls.__new__(cls)
        session.options, session.replaced_at = DelayedOptions(), []
        session._prepare(stored.scenario, 1.0)
        session.energy = session.kinetic = math.nan
        memory = session._memory
        unpacked_memory(memory, session._recall_changes(packed), stored.scenario)
        session.known_links, session.pending = memory.known_links, memory.pending
        session.replaced_at = memory.replaced_at
        session._short_steps, session._segment = int(memory.truth.numbers["short_steps"]), memory.segment
        session.delays.begin_step(session._segment.t0)
        session.recall(memory.truth, stored)
        session._recall_log(stored)
        session._relink_known()
        session._check_known_obstacles()
        session._law.held.draw(session._segment.t0)
        session._law.put_held()
        session._gust_ends = stored.scenario.agents.drawn_until(session._segment.t0)
        session._stepper = session._new_stepper(memory.truth.numbers["step"])
        session._check_last_step()
        return session

    def _check_last_step(self) -> None:
        """Refuse what was unpacked if the last step is not a motion under the law on what agents know."""
        segment = self._segment
        length = segment.t1 - segment.t0
        # A step that is accounted for may have ended: gains, and what agents know, are those after it then.
        if not length > 0.0 or self.accounted >= segment.t1:
            return
        allowed = self._law.tolerances(self.scenario.start) * OFF_LAW / length
        for place in WITHIN:
            t = segment.t0 + place * length
            y, found = segment.with_slope(t)
            slope = self._slope(t, y)
            fits = np.abs(found - slope) <= allowed + NEAR * (1.0 + np.abs(slope))
            must(bool(fits.all()), "coefficients", "be those of a motion under the law")

    def _check_known_obstacles(self) -> None:
        """Refuse what was unpacked if agents do not take themselves to be within range of obstacles as it states."""
        if self.obstacles.late:
            end = self._segment.t1
            own = self.delays.own(end, self._true(np.array(self._segment.coefficients[-1])))
            self.obstacles.check_known(self._base + end, own[:, : self.m])
