"""A running simulation under held control: events in time order, and closed-form motion between them."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from flocking.arrays import Array, Indices, Links
from flocking.engine.imperfect.messages.interventions import (
    Interventions,
    check_information,
    check_law_change,
    no_energy,
    packed_changes,
    unpacked_changes,
)
from flocking.engine.imperfect.messages.knowledge import NEVER, Knowledge, Known
from flocking.engine.imperfect.messages.leader_news import check_new_leaders, leader_news, with_leaders
from flocking.engine.imperfect.powers import POWERS, integrate_powers
from flocking.engine.imperfect.range_crossings import ObstacleRanges
from flocking.engine.imperfect.session import NUMBERS, ImperfectSession
from flocking.engine.imperfect.true_law import check_forces
from flocking.engine.protocol.body_chains import of_points
from flocking.engine.protocol.session import Packed, Stored
from flocking.engine.protocol.waiting_forces import Waiting, put
from flocking.engine.runs.fidelity import Fidelity
from flocking.engine.runs.message_log import CHANGED
from flocking.engine.sampled.actuation import Actuation
from flocking.engine.sampled.blocks.block import EventBlocks, Settings
from flocking.engine.sampled.checkpoint import packed_memory, unpacked_memory
from flocking.engine.sampled.law_in_force import SampledLaw
from flocking.engine.sampled.motion import Motion
from flocking.engine.sampled.safety import ForceFilter, filter_counts
from flocking.engine.sampled.snapshot import SampledMemory
from flocking.engine.sampled.supported_laws import check_sampled_law
from flocking.model.bodies.actuators import APPLIED
from flocking.model.bodies.unicycles import HEADING
from flocking.model.law import Law, Scenario
from flocking.model.state import State
from flocking.model.world.control import Held
from flocking.model.world.information import Information, Messages
from flocking.model.world.safety_filters import SafetyFilter
from flocking.model.world.times import NANOSECOND, Instants, PeriodicTimes


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
    in_blocks: ClassVar[bool] = True
    """Whether the native loop takes the events that it supports; it gives the same bits."""

    def __init_subclass__(cls) -> None:
        """Leave the native loop off in a subclass, whose events may be others, unless it declares `in_blocks`."""
        super().__init_subclass__()
        cls.in_blocks = bool(vars(cls).get("in_blocks", False))

    def __init__(self, scenario: Scenario) -> None:
        self._prepare(scenario)
        self.begin()
        self._watch_pieces(0, np.ones(self.n, dtype=bool))
        self._record_frames(0.0)

    def _prepare(self, scenario: Scenario) -> None:
        """Set all but the energy at the start: a law that has replaced another may have none there."""
        super().__init__(scenario)
        self.options = SampledOptions()
        assert isinstance(scenario.control, Held)
        start = scenario.start
        self._ticks: PeriodicTimes = scenario.control.schedule(self.n)
        self._latency = scenario.control.latencies(self.n)
        self.ticked = np.zeros(self.n, dtype=np.int64)
        self.applied = np.zeros(self.n, dtype=np.int64)
        self.waiting: Waiting = []
        self.desired = np.zeros((self.n, self.m))
        """The forces that agents computed last and that have begun to act, shape (N, m)."""
        periods = np.asarray(self._ticks.period * NANOSECOND, dtype=np.float64)
        self.actuation, self.motion = self._new_motion(scenario, periods)
        # Agents of order 1 stand still before the start, whatever velocities it gives.
        sent = start.p if scenario.agents.order == 2 else np.zeros_like(start.p)
        self.knowledge = Knowledge(scenario.information, start.q, sent, self.links, scenario.space)
        self._sampled_law = SampledLaw(of_points(scenario), self.knowledge.degree)
        self.obstacle_ranges = ObstacleRanges(scenario.law, start.q, start.t)
        self.interventions = Interventions()
        self._leader_news = leader_news(scenario, self.interventions.leaders)
        control = scenario.control
        self.filter: ForceFilter | None = None
        if isinstance(control, SafetyFilter):
            masses = np.asarray(scenario.agents.masses)
            self.filter = ForceFilter(control, masses, start.q, scenario.space, start.t)
        self._instant, self._meets = 0, False
        self._ticking = self._sampling = self._next_tick()
        """When each agent acts and measures next, as `_next_change` found it."""
        self._blocks = EventBlocks()

    def _new_motion(self, scenario: Scenario, periods: Array) -> tuple[Actuation, Motion]:
        """What becomes of forces, and the motion from the start on; ``periods`` is how long each force is held."""
        start, columns = scenario.start, scenario.start.columns
        found = Actuation(scenario.agents, self.n, self.m, periods)
        lag, heading = columns.get(APPLIED), columns.get(HEADING)
        return found, Motion(start.q, start.p, scenario.agents, found, lag, heading, start.t)

    @property
    def _law(self) -> SampledLaw:
        return self._sampled_law

    def motion_at(self, seconds: float, agents: Indices | slice = slice(None)) -> tuple[Array, Array]:
        """Positions and velocities of ``agents`` at ``seconds`` from the start."""
        return self.motion.at(seconds, agents)

    def _series(self, seconds: float) -> Array:
        return self.motion.shifted(seconds)

    def _integrated(self, length: float) -> tuple[Array, Array, float]:
        begin, found = self.accounted, np.zeros((2, len(POWERS)))
        forces = np.ascontiguousarray(self.motion.acting_from(begin))
        largest = integrate_powers(
            self._law.in_force(self._pairs), self._base + begin, self._series(begin), forces, length,
            self.scenario.tolerance, self.largest_power, self.rule, found,
        )  # fmt: skip
        return found[0], found[1], float(largest)

    def _columns_at(self, seconds: float) -> dict[str, Array]:
        """Further columns of the agents at ``seconds`` from the start, shape (N, width) each, by name."""
        found = {APPLIED: self.motion.lagged_at(seconds), HEADING: self.motion.heading_at(seconds)}
        every = {name: values for name, values in found.items() if values is not None}
        return {column.name: every[column.name] for column in self.scenario.agents.columns}

    def relink(self) -> None:
        """Set true links and obstacles within range from the present state."""
        self._pairs = self._law.pairs(self.links, self.obstacle_ranges.pairs)
        self._linked = int(self.links[0].sum())

    # Events.

    def _since_start(self, t: float) -> float:
        """Whole nanoseconds, as all times of this engine: gains change before controls of the same instant."""
        return round((t - self._base) / NANOSECOND) * NANOSECOND

    def _next_change(self) -> float:
        """The next time at which an agent measures, acts, or changes its force or its polynomial."""
        self._ticking = self._next_tick()
        found = min(int(self._ticking.min()), int(self.motion.ends().min()))
        if self.waiting:
            found = min(found, self.waiting[0][0])
        if (gust := self.actuation.next_gust()) is not None:
            found = min(found, gust)
        if self.knowledge.schedule is not None:
            self._sampling = self.knowledge.next_sample
            found = min(found, int(self._sampling.min()))
        self._instant = found
        next_ = found * NANOSECOND if found < NEVER else math.inf
        due = self.obstacle_ranges.due
        self._meets = bool(due) and due[0].seconds <= next_
        return due[0].seconds if self._meets else next_

    def _next_tick(self) -> Instants:
        return self._ticks.at(np.arange(self.n), self.ticked)

    def _change(self) -> None:
        """What falls on an instant: samples, what arrives, links, controls, and forces that begin to act."""
        if self._meets:
            self._cross_range()
            return
        instant = self._instant
        seconds = instant * NANOSECOND
        knowledge, motion = self.knowledge, self.motion
        if knowledge.schedule is not None:
            measuring = np.flatnonzero(self._sampling == instant)
            if measuring.size:
                self._measure(measuring, seconds)
        acting = np.flatnonzero(self._ticking == instant)
        changed = np.zeros(self.n, dtype=bool)
        if acting.size:
            knowledge.hear(instant, acting)
            known = knowledge.known(instant, acting, *motion.at(seconds))
            knowledge.relink(known, self._known_rules, self._views_at(seconds))
            pairs = knowledge.pairs(known)
            leaders = None if self._leader_news is None else self._leader_news.newest(instant, acting)
            force = self._desired(instant, known, pairs, leaders)
            check_forces(force, self._base + seconds, acting, self.scenario)
            if self.filter is not None:
                force = self.filter.filtered(instant, known, force)
            assert self.records.log is not None
            self.records.log.act(instant, acting, force, with_leaders(knowledge.used(acting, pairs), leaders))
            self.ticked[acting] += 1
            self.steps += 1
            late = self._latency[acting]
            for latency in np.unique(late).tolist():
                put(self.waiting, instant + latency, acting[late == latency], force[late == latency])
        renewed = motion.renewed(instant)
        begun = []
        while self.waiting and self.waiting[0][0] == instant:
            begun.append(self.waiting.pop(0)[1:])
        gusty = self.actuation.begin_gusts(instant)
        if not begun and not renewed.size and not gusty:
            return
        self._account(seconds)
        motion.exert(instant, renewed)
        changed[renewed] = True
        for agents, computed in begun:
            self.desired[agents] = computed
            self.applied[agents] += 1
            changed[agents] = True
            if not gusty:
                self._exert(instant, agents)
        if gusty:
            changed[:] = True
            self._exert(instant, np.arange(self.n))
        self._record_row(seconds)
        self._watch_pieces(instant, changed)

    def _take_block(self, bound: float, earliest: float) -> int:
        if not (self.in_blocks and earliest < bound) or self._meets or self._views or self._leader_news:
            return 0
        memory = self._memory
        if not self._blocks.can(memory):
            return 0
        how = Settings(self.scenario, self._law, self._ticks, self._latency, self._rules, self._known_rules, self.rule)
        taken = self._blocks.take(memory, how, self.records, bound)
        truth = memory.truth
        self.crossings, self.closest, self.sums, self.errors = truth.crossings, truth.closest, truth.sums, truth.errors
        for name in NUMBERS:
            if name not in ("steps", "gains_changed"):
                setattr(self, name, truth.numbers[name])
        self.steps = int(truth.numbers["steps"])
        self.relink()
        if taken.unwatched is not None:
            self._watch_pieces(taken.unwatched, taken.changed)
        if not taken.events:
            # Of an event that Python goes on with samples may have been taken: it still is the next one.
            self._next_change()
        return taken.events

    def _exert(self, instant: int, agents: Indices) -> None:
        """Let the forces that ``agents`` computed last act on their bodies from an ``instant`` on."""
        p = self.motion.at(instant * NANOSECOND, agents)[1]
        given = self.actuation.exerted(agents, self.desired[agents], p)
        self.motion.exert(instant, agents, given, self.actuation.beside(agents))

    def _cross_range(self) -> None:
        """Let an agent come within range of an obstacle, or leave it."""
        seconds = self.obstacle_ranges.due[0].seconds
        self._account(seconds)
        self._record_row(seconds)
        found = self.obstacle_ranges.cross(self._base, self._series(seconds))
        self.relink()
        (q,), (p,) = self.motion_at(seconds, np.array([found.agent]))
        row = self.obstacle_ranges.record(self._base + seconds, found.agent, found.group, found.obstacle, (q, p))
        self.records.switches.append(row)
        self._record_row(seconds)

    def _measure(self, measuring: Indices, seconds: float) -> None:
        """Take a sample of agents."""
        q, p = self.motion.at(seconds, measuring)
        p = p if self.motion.order == 2 or seconds else np.zeros_like(p)  # Those of order 1 stand still before.
        self.knowledge.measure(measuring, q, p, self.motion.at(seconds)[0] if self.knowledge.reads_distances else None)

    def _desired(
        self, instant: int, known: Known, pairs: tuple[Indices, Indices, Indices], leaders: Instants | None
    ) -> Array:
        """Forces of the law on the agents that act, shape (agents, m)."""
        t = self._base + instant * NANOSECOND
        met = self.obstacle_ranges.within_range_by(known.own[:, : self.m], t, known.agents)
        motions = () if leaders is None or self._leader_news is None else self._leader_news.motions(instant, leaders)
        return self._law.forces(t, known, pairs, met, motions)

    def _watch_pieces(self, instant: int, changed: Links) -> None:
        """Find the switches of the pairs of changed agents until a piece ends."""
        applies = self._ticks.at(np.arange(self.n), self.applied) + self._latency
        ends = np.minimum(applies, self.motion.ends())
        if (gust := self.actuation.next_gust()) is not None:
            ends = np.minimum(ends, gust)
        seconds = instant * NANOSECOND
        self.obstacle_ranges.ends = ends * NANOSECOND
        self.obstacle_ranges.watch(self._base, seconds, self.motion.shifted(seconds), np.flatnonzero(changed))
        self._watch(instant * NANOSECOND, (ends - instant) * NANOSECOND, changed)

    # Queries.

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
        return SampledMemory(
            self.truth, self.motion, self.knowledge, self.ticked, self.applied, self.waiting, self.desired,
            self.actuation, self.obstacle_ranges, memory,
        )  # fmt: skip

    @property
    def about(self) -> dict[str, object]:
        """Provenance of the records, with what a safety filter did, and when the session was changed."""
        changed = {CHANGED: list(self.interventions.times)} if self.interventions.times else {}
        return super().about | filter_counts(self.filter, self._base) | changed

    @property
    def fidelity(self) -> Fidelity:
        """As of all engines of imperfect worlds, and whether the session was changed."""
        return dataclasses.replace(super().fidelity, changed=bool(self.interventions.times))

    # Interventions.

    def replace_information(self, information: Information) -> None:
        """Send messages in another way from now on: samples on their way arrive, or not, as before."""
        scenario = check_information(self.engine, self.scenario, information)
        assert isinstance(information, Messages)
        self.scenario = scenario
        self.knowledge.change(information)
        if self._leader_news is not None:
            self._leader_news.follow(self.knowledge)
        self.interventions.times.append(self.time)

    def replace(self, *, law: Law | None = None, state: State | None = None) -> None:
        """Let another law of the same graphs act from now on: agents compute their next forces by it.

        Where leaders are known by messages, agents follow those of the new law, in the order of its terms, by the
        samples of those before until one arrives that was taken later.

        Raises
        ------
        InvalidInput
            When the law does not fit the scenario, or has no finite energy now; the session is then unchanged.
        UnsupportedLaw
            When its graphs are others, or the number of leaders that send messages, when a safety filter acts, and for
            another state.
        """
        if state is not None or law is None or self.filter is not None:
            return super().replace(law=law, state=state)
        scenario = check_law_change(self.scenario, law)
        check_new_leaders(self.engine, scenario, self._leader_news)
        check_sampled_law(self.engine, scenario, None)
        points = of_points(scenario)
        new = self._sampled_law.renumbered(points) or SampledLaw(points, self.knowledge.degree)
        new.take_parameters(self.time)
        seconds = self.time - self._base
        q, p = self.motion_at(seconds)
        ranges, goes_on = ObstacleRanges(law, q, self.time), self._base + seconds <= self.ledger_ends
        pairs = new.pairs(self.links, ranges.pairs)  # links of agents are those of before: the graphs are
        energy, _ = new.energy(self.time, q, p, pairs, self._linked)
        if goes_on and not np.isfinite(energy):
            raise no_energy(energy)
        self._account(seconds)
        self._record_row(seconds)
        ends, before = self.obstacle_ranges.ends, self.energy
        self._sampled_law, self.obstacle_ranges, self._pairs = new, ranges, pairs
        self.scenario = scenario
        if self._leader_news is not None:
            self._leader_news.replace(law.leaders, int(self.knowledge.taken[0]))
        self._schedule = sorted({s for term in law.body_terms for s in term.switch_times(self._base, math.inf)})
        self.gains_changed = sum(self._since_start(t) <= seconds for t in self._schedule)
        self.ledger_ends = min(self.ledger_ends, new.ledger_end(self.time))
        self.obstacle_ranges.ends = ends
        self.obstacle_ranges.watch(self._base, seconds, self.motion.shifted(seconds), np.arange(self.n))
        self.energy, self.kinetic = self._energy(seconds)
        if goes_on:
            self.jumped += self.energy - before
        self._record_row(seconds)
        self.interventions.times.append(self.time)
        return None

    def pack(self) -> Packed:
        """All that another session needs to go on bit for bit, but its scenario and its records."""
        (numbers, arrays), (more, rows) = (
            packed_memory(self._memory),
            packed_changes(self.interventions, self.knowledge),
        )
        return numbers | more, arrays | rows

    @classmethod
    def _unbegun(cls, scenario: Scenario) -> Self:
        """A session that has recorded nothing, for a checkpoint to fill."""
        session = cls.__new__(cls)
        session._prepare(scenario)
        session.energy = session.kinetic = math.nan
        return session

    @classmethod
    def unpack(cls, packed: Packed, stored: Stored, changes: Mapping[str, object]) -> SampledSession:
        """The session that was packed."""
        session = cls._unbegun(stored.scenario)
        memory = session._memory
        rest = unpacked_changes(packed, session.interventions, session.knowledge)
        unpacked_memory(memory, rest, stored.scenario)
        session.take_back(memory, stored)
        return session

    def take_back(self, memory: SampledMemory, stored: Stored) -> None:
        """Go on from a ``memory``, with the records that were ``stored``."""
        self.ticked, self.applied, self.desired = memory.ticked, memory.applied, memory.desired
        self.obstacle_ranges = memory.obstacle_ranges
        if self._leader_news is not None:
            self._leader_news.follow(self.knowledge)
        self.recall(memory.truth, stored)
