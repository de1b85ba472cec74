"""A running simulation under held control: events in time order, and closed-form motion between them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from flocking.arrays import Array, Indices, Links
from flocking.engine.imperfect.powers import Powers
from flocking.engine.imperfect.session import ImperfectSession
from flocking.engine.protocol.session import Packed, Stored
from flocking.engine.sampled.actuation import Actuation, without_limits
from flocking.engine.sampled.checkpoint import packed_memory, unpacked_memory
from flocking.engine.sampled.knowledge import Knowledge, Known
from flocking.engine.sampled.law_in_force import SampledLaw
from flocking.engine.sampled.motion import Motion
from flocking.engine.sampled.safety import ForceFilter
from flocking.engine.sampled.snapshot import SampledMemory
from flocking.model.law import Scenario
from flocking.model.world.control import Held
from flocking.model.world.safety_filters import SafetyFilter
from flocking.model.world.times import NANOSECOND, Instants, PeriodicTimes

NEVER = np.iinfo(np.int64).max
"""Nanosecond of an event that does not come."""


@dataclass(frozen=True)
class SampledOptions:
    """Options of the engine: there are none."""


class SampledSession(ImperfectSession):
    """Held control on what agents know, with true links located in closed form.

    Parameters
    ----------
    scenario
        What is simulated; its control is held.
    """

    engine = "sampled"
    keeps_log = True

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(scenario)
        self.options = SampledOptions()
        assert isinstance(scenario.control, Held)
        start = scenario.start
        self._ticks: PeriodicTimes = scenario.control.schedule(self.n)
        self._latency = scenario.control.latency_in_nanoseconds
        self.ticked = np.zeros(self.n, dtype=np.int64)
        self.applied = np.zeros(self.n, dtype=np.int64)
        self.waiting: list[tuple[int, Indices, Array]] = []
        self.actuation = Actuation(scenario.agents, self.n)
        self.motion = Motion(start.q, start.p, scenario.agents)
        # Agents of order 1 stand still before the start, whatever velocities it names.
        sent = start.p if scenario.agents.order == 2 else np.zeros_like(start.p)
        self.knowledge = Knowledge(scenario.information, start.q, sent, self.links, scenario.space)
        self._sampled_law = SampledLaw(without_limits(scenario), self.knowledge.degree)
        control = scenario.control
        self.filter: ForceFilter | None = None
        if isinstance(control, SafetyFilter):
            self.filter = ForceFilter(control, np.asarray(scenario.agents.masses), start.q, scenario.space)
        self._instant = 0
        self.begin()
        self._watch_pieces(0, np.ones(self.n, dtype=bool))
        self._record_frames(0.0)

    @property
    def _law(self) -> SampledLaw:
        return self._sampled_law

    def motion_at(self, seconds: float, agents: Indices | slice = slice(None)) -> tuple[Array, Array]:
        """Positions and velocities of ``agents`` at ``seconds`` from the start."""
        return self.motion.at(seconds, agents)

    def _series(self, seconds: float) -> Array:
        return self.motion.shifted(seconds)

    def _powers(self, seconds: float) -> Powers:
        return self._law.powers(self._base + seconds, self._series(seconds), self.motion.force, self._pairs)

    # Events.

    def _since_start(self, t: float) -> float:
        """Whole nanoseconds, as all times of this engine: gains change before controls of the same instant."""
        return round((t - self._base) / NANOSECOND) * NANOSECOND

    def _next_change(self) -> float:
        """When anybody measures, acts, or changes its force or its polynomial."""
        found = min(int(self._next_tick().min()), int(self.motion.ends().min()))
        if self.waiting:
            found = min(found, self.waiting[0][0])
        if self.knowledge.schedule is not None:
            found = min(found, int(self.knowledge.next_sample.min()))
        self._instant = found
        return found * NANOSECOND if found < NEVER else float("inf")

    def _next_tick(self) -> Instants:
        return self._ticks.at(np.arange(self.n), self.ticked)

    def _change(self) -> None:
        """What falls on an instant: samples, what arrives, links, controls, and forces that begin to act."""
        instant = self._instant
        seconds = instant * NANOSECOND
        knowledge, motion = self.knowledge, self.motion
        if knowledge.schedule is not None:
            measuring = np.flatnonzero(knowledge.next_sample == instant)
            if measuring.size:
                self._measure(measuring, seconds)
        acting = np.flatnonzero(self._next_tick() == instant)
        changed = np.zeros(self.n, dtype=bool)
        if acting.size:
            knowledge.hear(instant, acting)
            known = knowledge.known(instant, acting, *motion.at(seconds))
            knowledge.relink(known, self._rules)
            pairs = knowledge.pairs(known)
            force = self._wanted(instant, known, pairs)
            self._check_forces(force, seconds, acting)
            if self.filter is not None:
                force = self.filter.filtered(instant, known, force)
            assert self.records.log is not None
            self.records.log.act(instant, acting, force, knowledge.used(acting, pairs))
            self.ticked[acting] += 1
            self.steps += 1
            self.waiting.append((instant + self._latency, acting, force))
        renewed = np.flatnonzero(motion.ends() == instant)
        begun = []
        while self.waiting and self.waiting[0][0] == instant:
            begun.append(self.waiting.pop(0)[1:])
        if not begun and not renewed.size:
            return
        self._account(seconds)
        motion.exert(instant, renewed)
        changed[renewed] = True
        for agents, force in begun:
            motion.exert(instant, agents, self.actuation.exerted(agents, force))
            self.applied[agents] += 1
            changed[agents] = True
        self._record_row(seconds)
        self._watch_pieces(instant, changed)

    def _measure(self, measuring: Indices, seconds: float) -> None:
        """Let agents take a sample."""
        everyone = self.motion.at(seconds)[0] if self.knowledge.reads_distances else None
        self.knowledge.measure(measuring, *self.motion.at(seconds, measuring), everyone)

    def _wanted(self, instant: int, known: Known, pairs: tuple[Indices, Indices, Indices]) -> Array:
        """Forces that the law wants of the agents that act, shape (agents, m)."""
        return self._law.forces(self._base + instant * NANOSECOND, known, pairs)

    def _watch_pieces(self, instant: int, changed: Links) -> None:
        """Find the switches of the pairs of changed agents until a piece ends."""
        applies = self._ticks.at(np.arange(self.n), self.applied) + self._latency
        ends = np.minimum(applies, self.motion.ends())
        self._watch(instant * NANOSECOND, (ends - instant) * NANOSECOND, changed)

    # What others ask.

    @property
    def known_links(self) -> Links:
        """Links by what agents know, shape (graphs, N, N)."""
        return self.knowledge.links.copy()

    def accelerations(self) -> Array:
        """Rates of change of the velocities now, shape (N, m); of agents of order 1 their velocities."""
        S = self.motion.shifted(self.time - self._base)
        return np.asarray(S[1] if self.motion.order == 1 else 2.0 * S[2])

    @property
    def _memory(self) -> SampledMemory:
        """What the session goes on from."""
        memory = None if self.filter is None else self.filter.memory
        return SampledMemory(self.truth, self.motion, self.knowledge, self.ticked, self.applied, self.waiting, memory)

    @property
    def about(self) -> dict[str, object]:
        """Provenance of the records, with what a safety filter did."""
        found = super().about
        if self.filter is not None:
            memory = self.filter.memory
            found |= {"forces changed by the safety filter": memory.changed, "its conditions relaxed": memory.relaxed}
            if memory.relaxed:
                found["first relaxed at"] = self._base + memory.first_relaxed * NANOSECOND
        return found

    def pack(self) -> Packed:
        """All that another session needs to go on bit for bit, but its scenario and its records."""
        return packed_memory(self._memory)

    @classmethod
    def unpack(cls, packed: Packed, stored: Stored, changes: Mapping[str, object]) -> SampledSession:
        """The session that was packed."""
        session = cls(stored.scenario)
        memory = session._memory
        unpacked_memory(memory, packed, stored.scenario)
        session.ticked, session.applied = memory.ticked, memory.applied
        session.recall(memory.truth, stored)
        return session
