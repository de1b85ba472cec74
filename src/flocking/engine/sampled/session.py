"""A running simulation under held control: events in time order, and closed-form motion between them."""

from __future__ import annotations

import heapq
import math
import time as clock
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from flocking.arrays import Array, Indices, Links
from flocking.engine import interruption
from flocking.engine.protocol.session import Packed, Session, Stored
from flocking.engine.runs.fidelity import Approaches, Fidelity, LedgerRule
from flocking.engine.runs.recorder import Recorder
from flocking.engine.runs.run import Closest, LedgerRow, is_tangential
from flocking.engine.sampled.checkpoint import packed_memory, unpacked_memory
from flocking.engine.sampled.knowledge import Knowledge
from flocking.engine.sampled.law_in_force import SampledLaw
from flocking.engine.sampled.motion import Motion
from flocking.engine.sampled.pair_polynomials import ROUNDING, Paths, closest_pairs, pair_events, paths_in
from flocking.engine.sampled.powers import integrated
from flocking.engine.sampled.snapshot import NUMBERS, SampledMemory, link_rules
from flocking.errors import InvalidInput, NotFinite, SimulationError, UnsupportedLaw
from flocking.model.law import Law, Scenario
from flocking.model.state import State
from flocking.model.world.control import Held
from flocking.model.world.times import NANOSECOND, Instants, PeriodicTimes

NEVER = np.iinfo(np.int64).max
"""Nanosecond of an event that does not come."""


@dataclass(frozen=True)
class SampledOptions:
    """Options of the engine: there are none."""


class SampledSession(Session):
    """Held control on what agents know, with true links located in closed form.

    Parameters
    ----------
    scenario
        What is simulated; its control is held.
    """

    engine = "sampled"

    def __init__(self, scenario: Scenario) -> None:
        self.scenario, self.plant, self.options = scenario, None, SampledOptions()
        assert isinstance(scenario.control, Held)
        start = scenario.start
        self.n, self.m = start.q.shape
        self._base = start.t
        self.time, self.steps = start.t, 0
        self.records = Recorder(scenario)
        self._ticks: PeriodicTimes = scenario.control.schedule(self.n)
        self._latency = scenario.control.latency_in_nanoseconds
        self.ticked = np.zeros(self.n, dtype=np.int64)
        self.applied = np.zeros(self.n, dtype=np.int64)
        self.waiting: list[tuple[int, Indices, Array]] = []
        self.motion = Motion(start.q, start.p, scenario.agents)
        graphs = scenario.law.graphs
        self.links: Links = np.array([g.links_in(scenario.space, start.q, scenario.agents.headings) for g in graphs])
        if start.links is not None:
            self.links[0] = start.links
        self.knowledge = Knowledge(scenario.information, start.q, start.p, self.links, scenario.space)
        self._prepare()
        self.crossings: list[tuple[float, int, int, int]] = []
        self.closest = np.array([[np.inf, np.nan, -1.0, -1.0]] * 2)
        self.accounted = 0.0
        self.sums, self.errors = np.zeros(4), np.zeros(4)
        self.jumped, self.largest_power, self.ledger_ends = 0.0, 0.0, math.inf
        self.relink()
        self.energy, self.kinetic = self._energy(0.0)
        if not np.isfinite(self.energy):
            raise InvalidInput(
                "Scenario", "start", "must have a finite energy", self.energy,
                "Two agents sit where the potential is infinite; move them apart or inside its range.",
            )  # fmt: skip
        self._record_row(0.0)
        self._watch(0, np.ones(self.n, dtype=bool))
        self._record_frames(0.0)

    def _prepare(self) -> None:
        """What depends on the law."""
        self._law = SampledLaw(self.scenario, self.knowledge.degree)
        graphs = self.scenario.law.graphs
        self._rules = link_rules(graphs, self.n)

    def relink(self) -> None:
        """Take the true links as they are now."""
        self._pairs = self._law.pairs(self.links)
        self._linked = int(self.links[0].sum())

    def _energy(self, seconds: float) -> tuple[float, float]:
        q, p = self.motion.at(seconds)
        return self._law.energy(self._base + seconds, q, p, self._pairs, self._linked)

    def _paths(self, seconds: float) -> Paths:
        """How agents move from a time on."""
        return paths_in(self.scenario.space, self.motion.shifted(seconds), self._base + seconds)

    # Events.

    def advance(self, to: float, seconds: float = math.inf) -> None:
        """Go on until time ``to``, or for ``seconds`` of wall time."""
        if not to >= self.time:
            raise InvalidInput("SampledSession", "to", f"must not be before the session's time, {self.time:g}", to)
        stop = clock.monotonic() + seconds
        end = to - self._base
        last = self.scenario.t_end - self._base
        try:
            while True:
                interruption.check()
                instant = self._next_instant()
                at = instant * NANOSECOND if instant < NEVER else math.inf
                crossing = self.crossings[0][0] if self.crossings else math.inf
                if self.accounted < last <= min(at, crossing) and last <= end:
                    self._record_frames(last)
                    self._account(last)
                    self._record_row(last)
                    self.time = self._base + last
                    continue
                if min(at, crossing) >= end:
                    break
                self._record_frames(min(at, crossing))
                self.time = self._base + min(at, crossing)
                if crossing <= at:
                    self._switch()
                else:
                    self._act(instant)
                if clock.monotonic() >= stop:
                    return
            self.time = to
            self._record_frames(end)
        except SimulationError as error:
            error.run = self.run(str(error))
            raise

    def _next_instant(self) -> int:
        """The next instant at which anybody measures, acts, or changes its force or its polynomial."""
        found = min(int(self._next_tick().min()), int(self.motion.ends().min()))
        if self.waiting:
            found = min(found, self.waiting[0][0])
        if self.knowledge.schedule is not None:
            found = min(found, int(self.knowledge.next_sample.min()))
        return found

    def _next_tick(self) -> Instants:
        return self._ticks.at(np.arange(self.n), self.ticked)

    def _act(self, instant: int) -> None:
        """What falls on an instant: samples, what arrives, links, controls, and forces that begin to act."""
        seconds = instant * NANOSECOND
        knowledge, motion = self.knowledge, self.motion
        if knowledge.schedule is not None:
            measuring = np.flatnonzero(knowledge.next_sample == instant)
            if measuring.size:
                everyone = motion.at(seconds)[0] if knowledge.reads_distances else None
                knowledge.measure(measuring, *motion.at(seconds, measuring), everyone)
        acting = np.flatnonzero(self._next_tick() == instant)
        changed = np.zeros(self.n, dtype=bool)
        if acting.size:
            knowledge.hear(instant, acting)
            known = knowledge.known(instant, acting, *motion.at(seconds))
            knowledge.relink(known, self._rules.ways > 0, self._rules[1:])
            force = self._law.forces(self._base + seconds, known, knowledge)
            if not np.isfinite(force).all():
                bad = int(acting[np.flatnonzero(~np.isfinite(force).all(axis=1))[0]])
                raise NotFinite("A force is infinite or NaN.", time=self._base + seconds, agents=(bad,))
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
            motion.exert(instant, agents, force)
            self.applied[agents] += 1
            changed[agents] = True
        self._record_row(seconds)
        self._watch(instant, changed)

    def _watch(self, instant: int, changed: Links) -> None:
        """Find the switches and the closest approaches of the pairs of changed agents, until a piece ends."""
        seconds = instant * NANOSECOND
        applies = self._ticks.at(np.arange(self.n), self.applied) + self._latency
        ends = np.minimum(applies, self.motion.ends())
        length = (ends - instant) * NANOSECOND
        paths = self._paths(seconds)
        size = float(np.abs(paths.S[0]).max())
        rows = pair_events(paths, length, changed, self.links, self._rules.ways, self._rules[1:], size)
        for s, i, j, graph in rows:
            heapq.heappush(self.crossings, (float(seconds + s), int(i), int(j), int(graph)))

    def _switch(self) -> None:
        """Switch a true link that crosses its distance."""
        seconds, i, j, graph = heapq.heappop(self.crossings)
        (q, r), (p, v) = self.motion.at(seconds, np.array([i, j]))
        d, w = self.scenario.space.displacement(r - q), v - p
        distance = float(np.linalg.norm(d))
        speed = float(d @ w / distance) if distance else 0.0
        breaks = bool(self.links[graph, i, j])
        if breaks and self._law.barriers[graph]:
            self.ledger_ends = min(self.ledger_ends, self._base + self.accounted)
        self._account(seconds)
        self._record_row(seconds)
        self.links[graph, i, j] = not breaks
        if self._rules.ways[graph] == 1:
            self.links[graph, j, i] = not breaks
        self.relink()
        before = self.energy
        self.energy, self.kinetic = self._energy(seconds)
        if np.isfinite(self.energy) and np.isfinite(before):
            self.jumped += self.energy - before
        else:
            self.ledger_ends = min(self.ledger_ends, self._base + self.accounted)
        slow = is_tangential(speed, w)
        kind = "break" if breaks else "appear"
        self.records.switches.append((self._base + seconds, i, j, kind, graph, speed, slow, math.nan, math.nan))
        self._record_row(seconds)

    # Records.

    def _account(self, seconds: float) -> None:
        """Bring the ledger and the closest approaches up to a time; nothing switched since the last one."""
        length = seconds - self.accounted
        if length <= 0.0:
            return
        paths = self._paths(self.accounted)
        S = paths.S
        self.closest = closest_pairs(paths, length, self.links[0], self.accounted, self.closest)
        if self._base + self.accounted < self.ledger_ends:
            powers = self._law.powers(self._base + self.accounted, S, self.motion.force, self._pairs)
            sums, errors, self.largest_power = integrated(powers, length, self.scenario.tolerance, self.largest_power)
            self.sums += sums
            self.errors += errors
        self.accounted = seconds
        self.energy, self.kinetic = self._energy(seconds)

    def _row(self, seconds: float) -> LedgerRow:
        work, lost, supplied, departed = map(float, self.sums)
        return LedgerRow(self._base + seconds, self.energy, self.kinetic, work, lost, supplied, self.jumped, departed)

    def _record_row(self, seconds: float) -> None:
        if self._base + seconds <= self.ledger_ends:
            self.records.trace.append(self._row(seconds))

    def _record_frames(self, until: float) -> None:
        """Frames that are due before an event, or at the time reached."""
        records = self.records
        while records.count < len(records.frame_times):
            t = float(records.frame_times[records.count])
            if t - self._base > until:
                return
            q, p = self.motion.at(t - self._base)
            records.frame(t, q, p if self.motion.order == 2 else np.zeros_like(p), self.links[0])

    # What others ask.

    @property
    def state(self) -> State:
        """State at the session's time, with the true links."""
        q, p = self.motion.at(self.time - self._base)
        p = p if self.motion.order == 2 else np.zeros_like(p)
        return State(q, p, self.time, self.links[0].copy())

    @property
    def known_links(self) -> Links:
        """Links by what agents know, shape (graphs, N, N)."""
        return self.knowledge.links.copy()

    def accelerations(self) -> Array:
        """Rates of change of the velocities now, shape (N, m); of agents of order 1 their velocities."""
        S = self.motion.shifted(self.time - self._base)
        return np.asarray(S[1] if self.motion.order == 1 else 2.0 * S[2])

    @property
    def known(self) -> tuple[tuple[Closest, Closest], None]:
        """The closest linked and unlinked pair until now, with errors of rounding; no others are known."""
        length, found = self.time - self._base - self.accounted, self.closest
        paths = self._paths(self.accounted)
        if length > 0.0:
            found = closest_pairs(paths, length, self.links[0], self.accounted, found)
        size = ROUNDING * float(np.abs(paths.S[0]).max())
        linked, free = (
            Closest(math.sqrt(d), self._base + t, (int(i), int(j)), size) if np.isfinite(d) else Closest()
            for d, t, i, j in found.tolist()
        )
        return (linked, free), None

    @property
    def about(self) -> dict[str, object]:
        """Where the results come from, what is not ideal, and where the ledger ended if it did."""
        found = super().about | {"world": self.scenario.imperfections}
        if math.isfinite(self.ledger_ends):
            found["ledger ends"] = self.ledger_ends
        return found

    @property
    def fidelity(self) -> Fidelity:
        """Switches are located, and the ledger is held to the estimated error of its integrals."""
        rule = LedgerRule("estimate", float(self.errors.sum()))
        return Fidelity(self.engine, switches_located=True, approaches=Approaches("all", None), ledger=rule)

    def replace(self, *, law: Law | None = None, state: State | None = None) -> None:
        """Not possible: what agents know of each other belongs to the past of this run.

        Raises
        ------
        UnsupportedLaw
            Always.
        """
        raise UnsupportedLaw(
            "engine='sampled' replaces neither law nor state while a run goes on. Start another run from run.state(-1)."
        )

    @property
    def _memory(self) -> SampledMemory:
        """What the session goes on from."""
        numbers = {name: float(getattr(self, name)) for name in NUMBERS}
        return SampledMemory(
            self.motion, self.knowledge, self.ticked, self.applied, self.waiting, self.links, self.crossings,
            self.closest, self.sums, self.errors, numbers,
        )  # fmt: skip

    def pack(self) -> Packed:
        """All that another session needs to go on bit for bit, but its scenario and its records."""
        return packed_memory(self._memory)

    @classmethod
    def unpack(cls, packed: Packed, stored: Stored, changes: Mapping[str, object]) -> SampledSession:
        """The session that was packed."""
        session = cls(stored.scenario)
        memory = session._memory
        unpacked_memory(memory, packed, stored.scenario)
        for name in ("ticked", "applied", "links", "crossings", "closest", "sums", "errors"):
            setattr(session, name, getattr(memory, name))
        for name in NUMBERS:
            setattr(session, name, float(memory.numbers[name]))
        session.steps = int(memory.numbers["steps"])
        session.relink()
        session.records = Recorder(stored.scenario)
        session.records.recall(stored.counts, stored.read)
        return session
