"""A block of events of a session: the arguments of the native loop, and its results."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flocking.arrays import Array, Mask
from flocking.engine.imperfect.link_rules import LinkRules
from flocking.engine.imperfect.pair_polynomials import conversion
from flocking.engine.imperfect.powers import Rule
from flocking.engine.kernels.law_kernels import Pairs
from flocking.engine.kernels.pieces import FREE
from flocking.engine.runs.message_log import TICK_PARTS, USE_PARTS
from flocking.engine.runs.recorder import Recorder
from flocking.engine.runs.run import LedgerRow, SwitchRow, is_tangential
from flocking.engine.sampled.blocks.arrays import (
    ACCOUNTED,
    ACTS,
    BERNOULLI,
    COUNTS,
    CROSSINGS,
    DISTANCE,
    ENDS,
    ENERGY,
    FRAMES,
    GILBERT_ELLIOTT,
    JUMPED,
    KINETIC,
    LARGEST,
    NONE,
    PROGRESS,
    ROWS,
    STEPS,
    SWITCHES,
    TABLES,
    TIME,
    USES,
    WAITING,
    Acts,
    Bounds,
    KnownLaw,
    Memory,
    Movement,
    Records,
    Schedules,
    Sending,
    Truth,
    Work,
)
from flocking.engine.sampled.blocks.loop import UNWATCHED, event_block
from flocking.engine.sampled.law_in_force import SampledLaw
from flocking.engine.sampled.motion import Motion
from flocking.engine.sampled.piece_series import binomials
from flocking.engine.sampled.snapshot import SampledMemory
from flocking.model.law import Scenario
from flocking.model.world.information import Messages
from flocking.model.world.losses import Bernoulli, DistanceLoss, GilbertElliott, Loss
from flocking.model.world.noises import OrnsteinUhlenbeck, WhiteNoise
from flocking.model.world.times import PER_SECOND, Instants, PeriodicTimes

MOST_EVENTS = 1000
"""Most events of one native call."""

WORK = 20_000
"""Approximate work of one native call, in pairs looked at an event: some milliseconds. Ctrl-C and clocks wait for its
end."""

MOST_FRAMES = 256
"""Most frames of one native call."""

MOST_LINKS = 4_000_000
"""Most bytes of the link matrices of these frames."""

ROOM = 256
"""Least room for crossings, switches and neighbours: beyond it room grows with what has been met."""

MOST_USES = 65_536
"""Room for entries of the log, above which those of one act of everybody get more."""

DRAWN = 256
"""Samples of each agent whose errors are drawn at once."""

NUMBERS = {
    "time": TIME, "jumped": JUMPED, "accounted": ACCOUNTED, "energy": ENERGY, "kinetic": KINETIC,
    "largest_power": LARGEST, "ledger_ends": ENDS,
}  # fmt: skip
"""Places in ``Truth.progress`` of the numbers of a session."""

LOSSES: dict[type[Loss], int] = {Bernoulli: BERNOULLI, GilbertElliott: GILBERT_ELLIOTT, DistanceLoss: DISTANCE}
"""Losses that the native loop draws."""


class Settings(NamedTuple):
    """What does not change while a session goes on, but by interventions.

    Parameters
    ----------
    scenario, law
        The scenario, and its law.
    ticks, latency
        When agents act, and for how many nanoseconds their forces wait, shape (N,).
    rules, known_rules
        When true links switch, and those that agents know.
    rule
        How powers are integrated.
    """

    scenario: Scenario
    law: SampledLaw
    ticks: PeriodicTimes
    latency: Instants
    rules: LinkRules
    known_rules: LinkRules
    rule: Rule


class Taken(NamedTuple):
    """What a block has done.

    Parameters
    ----------
    events
        How many events took place.
    unwatched
        The nanosecond of the last one where Python must still look for the switches after it; None where not.
    changed
        Whose motion changed then, shape (N,).
    """

    events: int
    unwatched: int | None
    changed: Mask


class EventBlocks:
    """Blocks of events of one session."""

    def __init__(self) -> None:
        self._room = ROOM
        self._drawn: tuple[Messages, Array, Instants] | None = None

    @staticmethod
    def can(memory: SampledMemory) -> bool:
        """Whether the native loop supports all of a session.

        It moves point masses and single integrators, limited or not, without obstacles, filters or changes.

        Parameters
        ----------
        memory
            What the session goes on from.
        """
        motion, messages = memory.motion, memory.knowledge.messages
        plain = type(motion) is Motion and motion.lag is None and motion.heading is None
        actuation, obstacles = memory.actuation, memory.obstacle_ranges.groups
        alone = actuation.one_chain and not actuation.gusts and not obstacles and memory.filter is None
        if messages is None:
            return plain and alone
        loss, noise = messages.loss, messages.noise
        drawn = (loss is None or loss.ideal or type(loss) in LOSSES) and (
            noise is None or noise.ideal or type(noise) in (WhiteNoise, OrnsteinUhlenbeck)
        )
        return plain and alone and drawn and not memory.knowledge.since

    def take(self, memory: SampledMemory, settings: Settings, records: Recorder, end: float) -> Taken:
        """Let events take place that come before ``end``, in seconds from the start.

        Parameters
        ----------
        memory
            What the session goes on from; what changes is put there.
        settings
            What does not change.
        records
            Takes what is recorded.
        """
        n = len(memory.ticked)
        truth, acts = self._truth(memory, settings), self._acts(memory, settings)
        native_records = self._records(records, n, len(truth.links))
        motion, work = _movement(memory), _work(memory.motion.coefficients.shape, len(truth.crossings))
        most = max(1, min(MOST_EVENTS, WORK // n**2))
        scenario = settings.scenario
        bounds = Bounds(scenario.start.t, end, most, scenario.tolerance, settings.rule)
        events, outcome, instant = event_block(
            _schedules(memory, settings), self._sending(memory), motion, acts, _known(memory),
            self._known_law(memory, settings.law), truth, native_records, bounds, work,
        )  # fmt: skip
        self._put_back(memory, truth, acts)
        _put_on_record(records, native_records)
        met = (truth.counts[CROSSINGS], native_records.counts[SWITCHES], int(truth.law.pairs.offsets[-1]))
        if 2 * max(*map(int, met), int(memory.knowledge.links.sum())) > self._room or outcome == UNWATCHED:
            self._room *= 2
        return Taken(events, instant if outcome == UNWATCHED else None, work.changed)

    # What the native loop takes.

    def _pairs(self, graphs: int) -> Pairs:
        room = self._room
        return Pairs(
            np.zeros(room, dtype=np.int64), np.zeros(room, dtype=np.int64), np.zeros(graphs + 1, dtype=np.int64),
            np.zeros(room, dtype=np.int32), np.array([FREE]),
        )  # fmt: skip

    def _truth(self, memory: SampledMemory, settings: Settings) -> Truth:
        truth, law, scenario = memory.truth, settings.law, settings.scenario
        while 2 * max(int(truth.links.sum()), len(truth.crossings), int(memory.knowledge.links.sum())) > self._room:
            self._room *= 2
        m = memory.motion.force.shape[1]
        progress, counts = np.empty(PROGRESS), np.zeros(COUNTS, dtype=np.int64)
        for name, place in NUMBERS.items():
            progress[place] = truth.numbers[name]
        counts[STEPS], counts[CROSSINGS] = int(truth.numbers["steps"]), len(truth.crossings)
        counts[WAITING] = sum(len(agents) for _, agents, _ in memory.waiting)
        crossings = np.zeros((self._room, 4))
        if truth.crossings:
            crossings[: len(truth.crossings)] = truth.crossings
        lengths = np.array(scenario.space.lengths or (np.inf,) * m, dtype=np.float64)
        pairs = self._pairs(len(truth.links))._replace(spans=law.spans)
        return Truth(
            law.in_force(pairs), law.energies_address, float(scenario.energy.unlinked), settings.rules,
            settings.known_rules, np.array(law.barriers, dtype=bool), law.rows, lengths,
            conversion(memory.motion.degree), truth.links, crossings, truth.closest.copy(),
            np.array([truth.sums, truth.errors]), progress, counts,
        )  # fmt: skip

    def _acts(self, memory: SampledMemory, settings: Settings) -> Acts:
        n, m = memory.desired.shape
        rounds = 2 + int((settings.latency // settings.ticks.period).max())
        room = min(n * rounds, max(self._room, 2 * n))
        room = max(room, n + sum(len(agents) for _, agents, _ in memory.waiting))
        when, who = np.zeros(room, dtype=np.int64), np.zeros(room, dtype=np.int64)
        what, row = np.zeros((room, m)), 0
        for time, agents, force in memory.waiting:
            rows = slice(row, row + len(agents))
            when[rows], who[rows], what[rows] = time, agents, force
            row += len(agents)
        return Acts(memory.ticked, memory.applied, memory.desired, when, who, what)

    def _records(self, records: Recorder, n: int, graphs: int) -> Records:
        most = max(1, min(MOST_EVENTS, WORK // n**2))
        frames = max(1, min(MOST_FRAMES, MOST_LINKS // n**2))
        times = np.array(records.frame_times[records.count : records.count + frames + 1], dtype=np.float64)
        frames, m = min(frames, len(times)), records.m
        uses = max(MOST_USES, n + min(2 * self._room, graphs * n * n))
        return Records(
            np.zeros(TABLES, dtype=np.int64), np.empty((2 * most + 2, 8)), np.empty((most + 1, 7)), times,
            np.empty((frames, n, m)), np.empty((frames, n, m)), np.empty((frames, n, n), dtype=bool),
            np.empty((n * min(most, 2 + uses // n), len(TICK_PARTS)), dtype=np.int64),
            np.empty((n * min(most, 2 + uses // n), m)), np.empty((uses, len(USE_PARTS)), dtype=np.int64),
        )  # fmt: skip

    def _known_law(self, memory: SampledMemory, law: SampledLaw) -> KnownLaw:
        degree, m = memory.knowledge.degree, memory.knowledge.m
        room = self._room
        pairs = self._pairs(len(memory.knowledge.links))
        return KnownLaw(law.known_address, degree, pairs, np.zeros(room), np.zeros((room, degree + 1, 2 * m)))

    def _sending(self, memory: SampledMemory) -> Sending:
        knowledge, none = memory.knowledge, np.zeros(0)
        messages, n, m = knowledge.messages, knowledge.n, knowledge.m
        no_normals, no_first = np.zeros((0, n, 2 * m)), np.zeros(n, dtype=np.int64)
        if messages is None:
            return Sending(
                0, 0, -1, False, False, 0.0, 0.0, 0, NONE, False, none, False, np.zeros(2), none, no_normals, no_first
            )
        expires, noise, loss = messages.expires_in_nanoseconds, messages.noise, messages.loss
        noisy = noise is not None and not noise.ideal
        normals, first = self._normals(memory, messages) if noisy else (no_normals, no_first)
        kind = NONE if loss is None or loss.ideal else LOSSES[type(loss)]
        deviations = np.zeros(2) if noise is None else np.array([noise.position, noise.velocity])
        return Sending(
            round(messages.delay * PER_SECOND), round(messages.jitter * PER_SECOND), -1 if expires is None else expires,
            messages.predict, messages.self_known == "measured", messages.resolution, messages.velocity_resolution,
            messages.seed, kind, bool(getattr(loss, "paired", False)), _chances(loss), noisy, deviations,
            knowledge.memory_of_errors, normals, first,
        )  # fmt: skip

    def _normals(self, memory: SampledMemory, messages: Messages) -> tuple[Array, Instants]:
        """Normal numbers of the next samples of everyone, and the numbers of the first of these samples."""
        knowledge = memory.knowledge
        if self._drawn is not None and self._drawn[0] is messages:
            _, before, began = self._drawn
            passed = knowledge.taken - began
            if (passed >= 0).all() and (2 * passed < DRAWN).all():
                return before, began
        n, m, first = knowledge.n, knowledge.m, knowledge.taken.copy()
        assert messages.noise is not None
        samples = (first + np.arange(DRAWN)[:, None]).ravel()
        found = messages.noise.normals(messages.seed, np.tile(np.arange(n), DRAWN), samples, m)
        normals = np.concatenate(found, axis=1).reshape(DRAWN, n, 2 * m)
        self._drawn = (messages, normals, first)
        return normals, first

    # What it gives.

    def _put_back(self, memory: SampledMemory, truth: Truth, acts: Acts) -> None:
        found, counts = memory.truth, truth.counts
        for name, place in NUMBERS.items():
            found.numbers[name] = float(truth.progress[place])
        found.numbers["steps"] = float(counts[STEPS])
        rows = truth.crossings[: counts[CROSSINGS]]
        # A sorted list is a heap.
        found.crossings = sorted((t, int(i), int(j), int(g)) for t, i, j, g in rows.tolist())
        found.closest, (found.sums, found.errors) = truth.closest, truth.sums.copy()
        memory.waiting.clear()
        when = acts.when[: counts[WAITING]]
        for time in np.unique(when).tolist():
            rows_then = np.flatnonzero(when == time)
            memory.waiting.append((time, acts.who[rows_then], acts.what[rows_then]))
        memory.motion.forget()


def _known(memory: SampledMemory) -> Memory:
    knowledge = memory.knowledge
    if knowledge.errors is None and knowledge.draws_errors:
        knowledge.errors = np.zeros((knowledge.n, 2 * knowledge.m))
    errors = np.zeros((0, 0)) if knowledge.errors is None else knowledge.errors
    samples = knowledge.samples
    return Memory(
        knowledge.links, knowledge.newest, knowledge.taken, samples.rows, samples.start, samples.distances, errors
    )


def _schedules(memory: SampledMemory, settings: Settings) -> Schedules:
    ticks, found = settings.ticks, memory.knowledge.schedule
    sampling, offset = (ticks.period, ticks.phase) if found is None else (found.period, found.phase)
    return Schedules(ticks.period, ticks.phase, settings.latency, sampling, offset, found is not None)


def _movement(memory: SampledMemory) -> Movement:
    motion = memory.motion
    actuation = memory.actuation
    limits, boxed = actuation.largest_forces
    speed = np.zeros(0) if actuation.speed is None else actuation.speed
    masses, rate = (np.ascontiguousarray(x[:, 0]) for x in (motion.masses, motion.rate))
    return Movement(
        motion.order, masses, rate, motion.begin, motion.longest, motion.coefficients, motion.force,
        binomials(motion.degree), limits, boxed, speed, actuation.speed_terms,
    )  # fmt: skip


def _work(shape: tuple[int, ...], room: int) -> Work:
    _, n, m = shape
    S, each = np.empty(shape), np.empty((4, n, m))
    who = np.zeros((2, n), dtype=bool)
    return Work(
        S, each[0], each[1], each[2], each[3], who[0], who[1], np.zeros((n, n), dtype=bool), np.empty(n),
        np.empty((2, 4)), np.empty((2, 4)), np.empty((room, 4)), np.empty(3),
    )  # fmt: skip


def _chances(loss: Loss | None) -> Array:
    """Numbers of the losses, see `Sending`."""
    if isinstance(loss, Bernoulli):
        return np.array([loss.probability])
    if isinstance(loss, GilbertElliott):
        redraws, law = loss.redraws
        leave = loss.to_bad + loss.to_good
        return np.array([loss.loss_good, loss.loss_bad, redraws, law, loss.stationary_bad, leave])
    return np.array([loss.floor, loss.range, loss.exponent]) if isinstance(loss, DistanceLoss) else np.zeros(0)


def _put_on_record(records: Recorder, native_records: Records) -> None:
    rows, switches, frames, acts, uses = (int(native_records.counts[x]) for x in (ROWS, SWITCHES, FRAMES, ACTS, USES))
    records.trace += [LedgerRow(*row) for row in native_records.trace[:rows].tolist()]
    records.switches += [_switch_row(*row) for row in native_records.switches[:switches].tolist()]
    if frames:
        t = native_records.frame_times[:frames].tolist()
        records.frames(t, native_records.q[:frames], native_records.p[:frames], native_records.links[:frames], [])
    assert records.log is not None
    if acts:
        records.log.ticks.extend(native_records.acts[:acts])
        records.log.forces.extend(native_records.forces[:acts])
        records.log.uses.extend(native_records.uses[:uses])


def _switch_row(t: float, i: float, j: float, breaks: float, graph: float, speed: float, relative: float) -> SwitchRow:
    kind = "break" if breaks else "appear"
    return (t, int(i), int(j), kind, int(graph), speed, is_tangential(speed, relative), np.nan, np.nan)
