"""A running simulation in discrete time: velocities change at ticks, and motion between them is straight."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from flocking.arrays import Array, Indices, Links, Mask
from flocking.engine import interruption
from flocking.engine.discrete.checkpoint import DiscreteMemory, packed_memory, unpacked_memory
from flocking.engine.discrete.heading_updates import HeadingUpdates, heading_updates
from flocking.engine.discrete.law_in_force import DiscreteLaw, Known
from flocking.engine.discrete.linked_pairs import Neighbours
from flocking.engine.fixed_step.law_gaps import LawGaps, is_due
from flocking.engine.fixed_step.threads import check_threads
from flocking.engine.protocol.session import Packed, Session, Stored, end_of_slice, time_to_reach
from flocking.engine.runs.fidelity import Fidelity, LedgerRule
from flocking.engine.runs.recorder import MOST_LINKED, Recorder
from flocking.errors import NotFinite, SimulationError, UnsupportedLaw
from flocking.model.bodies.discrete_bodies import DiscreteBody
from flocking.model.bodies.velocity_units import VelocityUnit
from flocking.model.law import Law, Scenario
from flocking.model.state import State
from flocking.model.world.control import Held
from flocking.model.world.satellite_fixes import Fixes
from flocking.model.world.times import NANOSECOND

COMPARED_IN_TURN = 16
"""Number of agents whose forces are compared with the declared law at a tick, where they act one after another."""


@dataclass(frozen=True)
class DiscreteOptions:
    """Options of the engine for bodies in discrete time.

    Parameters
    ----------
    threads
        Number of threads of `flocking.engine.discrete.heading_updates.HeadingUpdates`; other groups have one. By
        default all processors for groups of more than `FEW_AGENTS`. Results do not depend on it.

    Raises
    ------
    InvalidInput
        If it is out of range.
    """

    threads: int | None = None

    def __post_init__(self) -> None:
        if self.threads is not None:
            check_threads("DiscreteOptions", self.threads)


class DiscreteSession(Session):
    """Agents that set their velocity at ticks.

    At an instant at which agents tick, in this order: velocities set a period before are taken (``update="backward"``),
    frames that are due show the state, links follow the positions, and the agents that tick compute their force on the
    present state and set their velocity. Agents that tick at one instant act on the same state, unless the body states
    that they act one after another.

    Parameters
    ----------
    scenario
        What is simulated; its bodies are in discrete time, its control is held.
    options
        Number of threads.

    Attributes
    ----------
    neighbours
        Linked pairs of each graph at the last instant.
    """

    engine = "discrete"
    saves_when_interrupted = True

    def __init__(self, scenario: Scenario, options: DiscreteOptions | None = None) -> None:
        assert isinstance(scenario.control, Held)
        assert isinstance(scenario.agents, DiscreteBody)
        self.scenario, self.plant, self.options = scenario, None, options or DiscreteOptions()
        self._body: DiscreteBody = scenario.agents
        start = scenario.start
        self.n, self.m = start.q.shape
        self._base = start.t
        self.time, self.steps = start.t, 0
        self.records = Recorder(scenario)
        self._ticks = scenario.control.schedule(self.n)
        self._period: Array = np.asarray(self._ticks.period * NANOSECOND, dtype=np.float64)
        self._law = DiscreteLaw(scenario)
        self.law_gaps = LawGaps()
        self._memory = DiscreteMemory(
            np.array(start.q, dtype=np.float64), np.array(start.p, dtype=np.float64),
            np.zeros((self.n, self.m)), np.zeros(self.n, dtype=np.int64),
        )  # fmt: skip
        if self._body.moves_itself:
            self._memory.ahead = self._memory.q.copy()
        if isinstance(scenario.information, Fixes):
            exact = np.concatenate([self._memory.q, self._memory.p], axis=1)
            self._memory.heard = np.repeat(exact[None], scenario.information.late + 1, axis=0)
            self._memory.errors = np.zeros_like(exact)
        graphs = scenario.law.graphs
        self.neighbours = [
            Neighbours(graph, scenario.space, start.q, start.links if k == 0 else None)
            for k, graph in enumerate(graphs)
        ]
        self._together = np.ones(self.n, dtype=bool) if self._ticks.alike else None
        self._headings = heading_updates(scenario, self.neighbours[0], start.links, self.options.threads)
        self._newer = False
        self._take_memory()
        self._record_frames(0)

    @property
    def memory(self) -> DiscreteMemory:
        """What the session goes on from."""
        if self._headings is not None and self._newer:
            self._headings.write(self._memory)
            self._newer = False
        return self._memory

    def _take_memory(self) -> None:
        if self._headings is not None:
            self._headings.take(self._memory.q, self._memory.p, self._memory.waiting)

    # Times, in nanoseconds from the start.

    def _instant(self, t: float) -> int:
        return round((t - self._base) / NANOSECOND)

    def _positions(self, t: float) -> Array:
        """Positions at a time of the scenario, from the last instant on, shape (N, m)."""
        memory = self.memory
        since = 0.0 if self._instant(t) == memory.instant else (t - self._base) - memory.instant * NANOSECOND
        if memory.ahead is not None and memory.ticked[0] and since:
            # What lies between ticks is not kept: frames there are on the straight line.
            return np.asarray(memory.q + (since / float(self._period[0])) * (memory.ahead - memory.q))
        return np.asarray(memory.q + since * memory.p)

    def advance(self, to: float, seconds: float = math.inf) -> None:
        """Go on until time ``to``, or for ``seconds`` of wall time."""
        to = time_to_reach("DiscreteSession", to, self.time)
        stop, end = end_of_slice("DiscreteSession", seconds), self._instant(to)
        try:
            while True:
                interruption.check()
                at, ticking = self._next_tick()
                if at > end:
                    break
                self._record_frames(at - 1)
                self._come_to(at, ticking)
                self._record_frames(at)
                if at >= end:
                    break
                self._tick(ticking)
                if self.time < to and clock.monotonic() >= stop:
                    return
            self._record_frames(end)
            self.time = to
        except SimulationError as error:
            error.run = self.run(str(error))
            raise

    def _next_tick(self) -> tuple[int, Mask]:
        """The next instant at which agents tick, and which do."""
        ticked = self._memory.ticked
        if self._together is not None:
            return int(self._ticks.of_one.at(np.zeros(1, dtype=np.int64), ticked[:1])[0]), self._together
        ticks = self._ticks.at(np.arange(self.n), ticked)
        at = int(ticks.min())
        return at, ticks == at

    def _come_to(self, at: int, ticking: Mask) -> None:
        """Move all agents to an instant, and let those that tick at it take the velocities they set before."""
        memory = self._memory
        if memory.instant == at:
            return
        if self._headings is not None:
            turned = self._body.update == "backward" and memory.ticked[0] > 0
            self._headings.move((at - memory.instant) * NANOSECOND, turned=bool(turned))
            memory.instant, self.time, self._newer = at, self._base + at * NANOSECOND, True
            return
        with np.errstate(all="ignore"):
            q = memory.q + ((at - memory.instant) * NANOSECOND) * memory.p
        if memory.ahead is not None:
            q, memory.p = memory.ahead.copy(), memory.waiting.copy()
            self._check_finite("A velocity", memory.p, np.arange(self.n))
        self._check_finite("A position", q, np.arange(self.n))
        if self._body.update == "backward":
            taking = ticking & (memory.ticked > 0)
            memory.p = np.where(taking[:, None], memory.waiting, memory.p)
        memory.q, memory.instant = q, at
        self.time = self._base + at * NANOSECOND

    def _tick(self, ticking: Mask) -> None:
        """Let agents set their velocity at the present instant."""
        if self._headings is not None:
            self._turn_headings(self._headings)
            return
        memory, t = self.memory, self.time
        agents = np.flatnonzero(ticking)
        step, state = self.steps + 1, (memory.q, memory.p)
        at_start = not memory.instant
        judged = self._law.judged(step, self.neighbours, memory.q, at_start=at_start) if is_due(step) else None
        if not at_start:
            # At the start links are those that a start has, which may differ at the radius itself.
            for each in self.neighbours:
                each.move(memory.q)
        if self._body.in_turn:
            self._act_in_turn(judged is not None)
            return
        if memory.heard is not None:
            self._take_fixes()
        known = Known(memory.heard, self._range) if memory.heard is not None else None
        u = self._law.forces(t, *state, self.neighbours, known)
        self._check_finite("A force", u, np.arange(self.n))
        if judged is not None:
            self._law.compare(judged, t, state, u, self.law_gaps, known)
        with np.errstate(all="ignore"):
            found = self._body.updated(memory.p[agents], u[agents], self._period[agents], agents, memory.ticked[agents])
        self._check_finite("A velocity", found, agents)
        if isinstance(self._body, VelocityUnit):
            error = np.zeros_like(found) if memory.errors is None else memory.errors[:, self.m :]
            tick, period = int(memory.ticked[0]), float(self._period[0])
            memory.ahead, memory.waiting = self._body.moved(memory.q, memory.p, found, error, period, tick)
        elif self._body.update == "backward":
            memory.waiting[agents] = found
        else:
            memory.p = memory.p.copy()
            memory.p[agents] = found
        memory.ticked[agents] += 1
        self.steps += 1

    def _turn_headings(self, headings: HeadingUpdates) -> None:
        """Let all agents set their heading, and compare some with the law where that is due."""
        ticked, step = int(self._memory.ticked[0]), self.steps + 1
        due = is_due(step)
        means = headings.turn(ticked, keep=due)
        if means is not None:
            state = headings.positions, headings.velocities
            self._law.compare_headings(step, self.neighbours, self.time, state, (means, headings.waiting), ticked,
                                       self.law_gaps)  # fmt: skip
        if self._body.update == "forward":
            headings.accept()
        self._memory.ticked += 1
        self.steps, self._newer = step, True

    def _take_fixes(self) -> None:
        """Let all agents measure themselves, and receive the fixes that have been on their way for the delay."""
        memory, fixes = self.memory, self.scenario.information
        assert isinstance(fixes, Fixes)
        assert memory.heard is not None
        assert memory.errors is not None
        memory.errors = fixes.next_errors(memory.errors, int(memory.ticked[0]))
        newest = np.concatenate([memory.q, memory.p], axis=1) + memory.errors
        memory.heard = np.concatenate([newest[None], memory.heard[:-1]])

    @property
    def _range(self) -> float:
        fixes = self.scenario.information
        assert isinstance(fixes, Fixes)
        return math.inf if fixes.range is None else fixes.range

    def _act_in_turn(self, judged: bool) -> None:
        """Let all agents set their velocity one after another, each on the state that those before it leave."""
        memory, body, period = self.memory, self._body, self._period
        q, p = memory.q.copy(), memory.p.copy()
        order = body.turns(self.n, int(memory.ticked[0]))
        for turn, agent in enumerate(order):
            one = order[turn : turn + 1]
            u = self._law.forces_in_turn(q, p, int(agent))[None]
            self._check_finite("A force", u, one)
            if judged and turn < COMPARED_IN_TURN:
                self._law.compare_in_turn(self.time, (q, p), int(agent), u[0], self.law_gaps)
            with np.errstate(all="ignore"):
                found = body.updated(p[one], u, period[one], one, memory.ticked[one])
            self._check_finite("A velocity", found, one)
            p[one] = found
            q[one] += period[one][:, None] * found
        memory.p = p
        memory.ticked += 1
        self.steps += 1

    def _check_finite(self, what: str, values: Array, agents: Indices) -> None:
        """Refuse to go on with ``values`` of ``agents``, shape (agents, m), that are infinite or NaN."""
        if not np.isfinite(values).all():
            bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
            raise NotFinite(f"{what} is infinite or NaN.", time=self.time, agents=(int(agents[bad[0]]),))

    def _record_frames(self, until: int) -> None:
        """Frames that are due until an instant, that instant included."""
        records = self.records
        while records.count < len(records.frame_times):
            t = float(records.frame_times[records.count])
            if self._instant(t) > until:
                return
            q = self._positions(t)
            records.frame(t, q, self.memory.p, self._links(t, q) if records.with_links else None)

    def _links(self, t: float, q: Array) -> Links:
        """Links of the law's graph at a time with agents at ``q``, shape (N, m), from those of the last instant."""
        first = self.neighbours[0]
        # Sorted agents keep no pairs; theirs at the start are those by distance.
        stated = self._instant(t) == 0 and self._headings is None
        return first.matrix(first.pairs if stated else first.after(q))

    # What others ask.

    @property
    def state(self) -> State:
        """State at the session's time; with links of up to 2,000 agents."""
        q = self._positions(self.time)
        return State(q, self.memory.p.copy(), self.time, self._links(self.time, q) if self.n <= MOST_LINKED else None)

    def accelerations(self) -> Array:
        """Zeros, shape (N, m): velocities change at ticks alone."""
        return np.zeros((self.n, self.m))

    @property
    def about(self) -> dict[str, object]:
        """Provenance of the run, with what is not ideal and how forces were compared with the law."""
        return super().about | {"world": self.scenario.imperfections} | self.law_gaps.about

    @property
    def fidelity(self) -> Fidelity:
        """There is no ledger: forces of some agents are compared with the declared law at some ticks."""
        return Fidelity(self.engine, ledger=LedgerRule("forces"), law=self.law_gaps.agreement)

    def replace(self, *, law: Law | None = None, state: State | None = None) -> None:
        """Not possible yet.

        Raises
        ------
        UnsupportedLaw
            Always.
        """
        raise UnsupportedLaw(
            "engine='discrete' replaces neither law nor state while a run goes on. Start another run from "
            "run.state(-1)."
        )

    def pack(self) -> Packed:
        """All that another session needs to go on bit for bit, but its scenario and its records."""
        none = np.zeros(0, dtype=np.int64)
        # Sorted agents find their neighbours from places alone.
        pairs = [(none, none) if self._headings is not None else x.pairs for x in self.neighbours]
        return packed_memory(self.memory, self.time, self.steps, pairs, self.law_gaps)

    @classmethod
    def unpack(cls, packed: Packed, stored: Stored, changes: Mapping[str, object]) -> DiscreteSession:
        """The session that was packed."""
        threads = changes.get("threads")
        session = cls(stored.scenario, DiscreteOptions(threads if isinstance(threads, int) else None))
        read = unpacked_memory(session.memory, packed, stored.scenario)
        session._take_memory()
        session.time, session.steps, session.law_gaps = read.time, read.steps, read.gaps
        for each, pairs in zip(session.neighbours, read.pairs, strict=True):
            each.pairs = pairs
        session.records = Recorder(stored.scenario)
        session.records.recall(stored.counts, stored.read)
        return session
