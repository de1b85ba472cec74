"""The exact engine: adaptive order 8, every switch located and the step ended there."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from functools import partial

import numpy as np

from flocking.engine import interruption
from flocking.engine.adaptive_steps.adaptive_session import AdaptiveSession
from flocking.engine.adaptive_steps.segment import Segment
from flocking.engine.adaptive_steps.step_lengths import StepLengths
from flocking.engine.adaptive_steps.stepper import Stepper, StepperMemory
from flocking.engine.exact.barriers import LedgerState, check_resolved, grown_tolerance
from flocking.engine.exact.blocks.arrays import STEP_JUMPED, STEP_LENGTH
from flocking.engine.exact.blocks.block import StepBlock, take_block
from flocking.engine.exact.checkpoint import pack_exact, restore_exact
from flocking.engine.exact.crossings.obstacle_centres import ObstacleCentres
from flocking.engine.exact.crossings.switching import Crossing, LinkState
from flocking.engine.exact.dynamics import LEDGER, Dynamics
from flocking.engine.exact.failures import infinite_at_once, sliding
from flocking.engine.exact.jump_times import JumpTimes
from flocking.engine.exact.origin import momentum, origin_of
from flocking.engine.exact.precision import Precision
from flocking.engine.exact.recorder import ExactOptions as ExactOptions
from flocking.engine.exact.recorder import ExactRecorder
from flocking.engine.exact.replacement import renumbered, replacement
from flocking.engine.exact.snapshot import Snapshot as Snapshot
from flocking.engine.exact.solution_error import SolutionError
from flocking.engine.exact.step_search import found_step
from flocking.engine.exact.switch_records import write_rows, write_switch
from flocking.engine.protocol.session import Packed, Session, Stored, end_of_slice, time_to_reach
from flocking.engine.protocol.world import check_world
from flocking.engine.reference.infinite_starts import infinite_start
from flocking.engine.reference.plants import known_plant
from flocking.engine.runs.run import Accuracy, Closest, LedgerRow
from flocking.errors import InvalidInput, NotFinite, SimulationError
from flocking.model.checks import Array
from flocking.model.law import Law, Scenario
from flocking.model.state import State


class ExactSession(AdaptiveSession):
    """A running simulation under the exact engine.

    Parameters
    ----------
    options
        Whether fine samples are stored.
    plant
        The law the agents really obey, if it is not the scenario's: the ledger remains that of the declared law, so
        that a wrong plant shows.

    Raises
    ------
    InvalidInput
        When the plant does not fit the scenario, or the initial energy is not finite.
    """

    engine = "exact"
    records: ExactRecorder
    options: ExactOptions

    def __init__(self, scenario: Scenario, options: ExactOptions | None = None, *, plant: Law | None = None) -> None:
        known_plant("ExactSession", plant)
        check_world(self.engine, scenario)
        self.scenario, self.plant, self.options = scenario, plant, options or ExactOptions()
        start = scenario.start
        self.time, self.steps, self.jumped = start.t, 0, 0.0
        self._origin = origin_of(scenario, plant, start, start.t)
        self.records = ExactRecorder(scenario, fine=self.options.fine)
        self._prepare(start.n, start.dimension)
        self._tail = np.zeros(self._dynamics.departs + LEDGER)
        own = self._origin.inwards(start)
        self._begin(own, LinkState(plant or scenario.law, own, scenario.agents, self._origin.time, scenario.space))
        self._record_frames(own.t)
        self._record_trace()

    def _prepare(self, n: int, m: int, dynamics: Dynamics | None = None) -> None:
        """Kernels and parameters: all that depends on the law but not on the state."""
        self.n, self.m = n, m
        self._dynamics = dynamics or Dynamics(self.scenario, self.plant, n, m, self._origin.time)
        self._jumps = JumpTimes(self._dynamics.layouts, self._origin, self.scenario)
        self._lengths = StepLengths(self.scenario.t_end - self.scenario.start.t)
        self._centres = ObstacleCentres(self.scenario)

    def _begin(self, state: State, links: LinkState, *, same_pairs: bool = False) -> None:
        """Start at ``state``, in own time and coordinates; ``same_pairs``: the dynamics already have these links."""
        dynamics = self._dynamics
        dynamics.repack(state.t)
        self._links = links
        dynamics.divide(links)
        if same_pairs and self.scenario.law.distributed:
            dynamics.keep_pairs()
        else:
            dynamics.relink(links)
        self._tail = np.concatenate([self._tail[: dynamics.departs + LEDGER], dynamics.places(state.t)])
        dynamics.follow_limits(state.t, y := dynamics.join(state, self._tail))
        self.energy, self.kinetic = dynamics.energy(state.t, y)
        if not np.isfinite(self.energy):
            raise infinite_start(self.scenario, state, self.energy)
        memory = StepperMemory(state.t, y, dynamics.slope(state.t, y), 0.0)
        if not np.isfinite(memory.slope).all():
            raise NotFinite("The control at the start is infinite or NaN.", time=self._origin.time_at(state.t))
        self._precision = Precision(self.scenario, dynamics, self._origin)
        self._precision.check(state.t, y)
        self._momentum = momentum(self.scenario, state.p)
        self._stepper = self._new_stepper(dynamics.tolerances(state, self.energy), memory)
        self._segment = Segment.resting(state.t, y)
        self._error = SolutionError(dynamics, self.records, len(y))
        self._pending: list[Crossing] = []

    def _new_stepper(self, tolerance: Array, memory: StepperMemory) -> Stepper:
        shape = self._dynamics.order, self.n, self.m
        return Stepper(self._dynamics.slope, self._dynamics.stages, tolerance, memory, self._origin.time, shape)

    @property
    def state(self) -> State:
        """State at the session's time, with the links of the law's graph."""
        own = self._own_now
        q, p, _ = self._dynamics.split(y := self._segment.at(own))
        return State(*self._origin.outwards(own, q, p), self.time, self._links.links[0], self._dynamics.further(y))

    @property
    def _own_now(self) -> float:
        """The session's own time now, within the last step even if that is shorter than times resolve."""
        return min(max(self._origin.own_time(self.time), self._segment.t0), self._segment.t1)

    @property
    def time_is_exact(self) -> bool:
        """False if steps are shorter than the spacing of floating-point times."""
        own, segment = self._origin.own_time(self.time), self._segment
        return own == segment.t1 or segment.t0 < own < segment.t1

    def advance(self, to: float, seconds: float = np.inf) -> None:
        """Go on until time ``to``, or for ``seconds`` of wall time. Where steps fall depends on neither."""
        to = time_to_reach("ExactSession", to, self.time)
        own, stop = self._origin.own_time(to), end_of_slice("ExactSession", seconds)
        self._jumps.look_beyond(own)
        try:
            while self._segment.t1 < own:
                interruption.check()
                self._leave_segment()
                if self._segment.t1 == own == self._jumps.end:
                    break
                block = self._take_block(own, stop)
                if block is None or block.segment is None:
                    self._take_step(None if block is None else block.tried)
                check_resolved(self._dynamics, self._links, self._segment, self._stepper.tolerance)
                reached = max(self.time, self._origin.latest(self._segment.t1))
                # Own times are finer than times: a slice that would round to ``to`` goes on until it is there.
                if self._segment.t1 < own and reached < to and time.monotonic() >= stop:
                    self.time = reached
                    self._record_frames(self._own_now)
                    return
            self.time = to
            self._record_frames(own)
            if self._segment.t1 == own == self._jumps.end:
                self._leave_segment()
        except SimulationError as error:
            error.run = self.run(str(error))
            raise

    def _take_block(self, until: float, stop: float) -> StepBlock | None:
        """Take steps up to the first that ends in a switch or leaves something in doubt, and record those before."""
        records, dynamics, origin = self.records, self._dynamics, self._origin
        found = None if records.fine is not None else take_block(
            dynamics, self._links, self._stepper, self._error, records.extremes, self._precision, origin,
            (self.energy, self.kinetic, self.jumped), (until, self._jumps.bound(self._segment.t1)),
            records.to_come(origin.time), seconds=stop - time.monotonic(), most=self._centres.until_look(self.steps),
        )  # fmt: skip
        if found is None or not found.taken:
            return found
        rows, states, length = found.rows, found.states, found.last[0]
        records.trace += self._trace_rows(rows[:, :STEP_LENGTH], rows[:, STEP_JUMPED], states)
        states_shown, errors, links = found.frames
        if len(errors):
            own_times = records.frame_times[records.count :][: len(errors)] - origin.time
            records.frames_at(own_times, states_shown, dynamics, links, errors, origin)
        self._stepper.recall(found.memory)
        self._error.difference, records.extremes.rows = found.difference, found.extremes
        self.steps += found.taken
        for step in rows[:, STEP_LENGTH].tolist():
            if step > 0.0:
                self._lengths.add(step)
        if len(rows):
            own, self.energy, self.kinetic, _, self.jumped = rows[-1].tolist()
            self._tail = states[-1][dynamics.columns_size :]
            self.time = origin.time_at(own)
            self._segment = Segment.resting(own, states[-1])
            self._error.take_fresh(found.fresh, self._links)
        if found.links is not None:
            write_rows(records, found.switches, self._links, origin)
            self._links.take(*found.links)
            self._links.take_sliding(found.sliding)
            dynamics.relink(self._links, found.pairs)
        if found.segment is not None:
            self._lengths.add(length)
            self._segment, self._pending = found.segment, found.pending
            self._error.know(found.segment, found.errors)
            dynamics.know_energy(found.segment.t1, found.segment.coefficients[-1], found.last[1:])
        return found

    def _take_step(self, tried: tuple[Segment, StepperMemory] | None) -> None:
        before, known = self._stepper.memory, self._error.difference
        if self._dynamics.held.limits:
            stepper, dynamics = self._stepper, self._dynamics
            stepper.tolerance = grown_tolerance(dynamics, stepper.tolerance, before.y, before.slope)
        try:
            ledger = LedgerState(self._tail, self.energy, self.kinetic) if self.plant is None else None
            bound = self._jumps.bound(self._segment.t1)
            segment, pending = found_step(self._stepper, self._links, self._dynamics, bound, ledger, tried)
            self._precision.check(segment.t1, segment.coefficients[-1])
            self._dynamics.check_limits(segment.t1, segment.coefficients[-1])
            self._error.follow(segment)
        except BaseException:
            self._stepper.recall(before)
            self._error.difference = known
            raise
        self._segment, self._pending = segment, pending
        self._lengths.add(segment.t1 - segment.t0)
        self.steps += 1

    def _leave_segment(self) -> None:
        """Record the current segment and apply the switches at its end."""
        segment = self._segment
        t, y = segment.t1, segment.coefficients[-1]
        if t > segment.t0:
            self._error.leave(segment, self._links, self._origin)
            self.records.sample(segment, self._dynamics.split, self._origin)
            self._tail = np.array(y[self._dynamics.columns_size :])
            self.energy, self.kinetic = self._dynamics.energy(t, y)
            self.time = self._origin.time_at(t)
            self._record_frames(t, left=True)
            self._record_trace()
            self._centres.look(self.steps, lambda: (self.state, self.accelerations()))
        error = self._switch() if self._pending else None
        if jumps := (after := float(np.nextafter(t, np.inf))) == self._jumps.following(t):
            t = after
        if jumps or self._jumps.gust_at_end(t):
            self._dynamics.repack(t)
            before, (self.energy, self.kinetic) = self.energy, self._dynamics.energy(t, y)
            self.jumped += self.energy - before
            self._stepper.restart(t, y)
        if self._dynamics.follow_limits(t, y) or (self._dynamics.held.limits and self._stepper.memory.t != t):
            self._stepper.restart(t, np.array(y))
        self._segment = Segment.resting(t, y)
        if jumps and t >= self._jumps.end:  # There may be no step that would record it.
            self._record_trace()
        if error is not None:
            raise error

    def _switch(self) -> SimulationError | None:
        """Apply the crossings at the end of the segment; the error, if the run cannot go on."""
        crossings, self._pending = self._pending, []
        t, y = self._segment.t1, self._segment.coefficients[-1]
        q, p, _ = self._dynamics.split(y)
        if self._dynamics.order == 1:
            p = np.asarray(self._dynamics.slope(t, y))[: self.n * self.m].reshape(q.shape)
        chattering: tuple[int, ...] = ()
        for crossing in crossings:
            found = write_switch(self.records, crossing, self._segment, q, p, self._links, self._error, self._origin)
            chattering = found or chattering
            self._links.apply(crossing, q)
        error: SimulationError | None = sliding(self.time, chattering) if chattering else None
        try:
            self._dynamics.relink(self._links)
        except InvalidInput as reason:
            # The functional of a graph may cease to exist as its links change.
            return SimulationError(str(reason), time=self.time)
        watches = [self._links.watches[c.watch] for c in crossings]
        if any(watch.rise or not watch.inner for watch in watches):
            before, (self.energy, self.kinetic) = self.energy, self._dynamics.energy(t, y)
            if not np.isfinite(self.energy) or any(
                self._links.meets_barrier(c, self._dynamics.barriers) for c in crossings
            ):
                error = infinite_at_once(self.time, tuple(map(int, crossings[0].pairs[0])))
            self.jumped += self.energy - before
            self._record_trace()
        self._stepper.restart(t, np.array(y))
        self._error.switched(self._stepper.memory.slope)
        return error

    def _record_frames(self, until: float, *, left: bool = False) -> None:
        due = self.records.due_until(until, self._origin.time)
        if due:
            error = self._error.over(self._segment) if left else self._error.once_left(self._segment, self._links)
        for own, t in due:
            y, found = self._segment.at(own), (error.position, error.velocity)
            self.records.frame_at(own, t, y, self._dynamics, self._links.links[0], found, self._origin)

    def _record_trace(self) -> None:
        t, y = self._segment.t1, self._segment.coefficients[-1]
        rows, jumped = np.array([[t, self.energy, self.kinetic]]), np.array([self.jumped])
        self.records.trace += self._trace_rows(rows, jumped, np.ascontiguousarray(y[None]))

    def _trace_rows(self, rows: Array, jumped: Array, states: Array) -> list[LedgerRow]:
        """Rows of the ledger from rows (own time, energy, kinetic energy), jumps of the energy and state vectors."""
        found = self._dynamics.integrals(states, self._origin.velocity, self._momentum)
        base, table = self._origin.time, zip(rows.tolist(), found.tolist(), jumped.tolist(), strict=True)
        return [
            LedgerRow(base + own, energy + more, kinetic + more, work, lost, given, jump, departed)
            for (own, energy, kinetic), (more, work, lost, given, departed), jump in table
        ]

    def _added(self, y: Array) -> tuple[float, float, float]:
        """Differences of kinetic energy, work and supply in the user's coordinates from those in the session's."""
        return self._origin.added(self.scenario, self._dynamics.split(y)[1], self._momentum)

    def snapshot(self, *, records: bool = True) -> Snapshot:
        """Everything needed to go on bit for bit; see `resume`. Without ``records`` the recorder is not copied."""
        recorder = self.records.copy() if records else self.records
        return Snapshot(
            self.scenario, self.time, self._stepper.memory, self._segment, list(self._pending),
            self._links.memory(), recorder, self.energy, self.jumped, self.steps, self._stepper.tolerance,
            dict(self._links.sliding), self.plant, self._error.memory, origin=self._origin, momentum=self._momentum,
            limits=self._dynamics.held.acting, centres=self._centres.memory,
        )  # fmt: skip

    @classmethod
    def resume(cls, snapshot: Snapshot, *, plant: Law | None = None) -> ExactSession:
        """A session that goes on exactly as the one the snapshot was taken of."""
        known_plant("ExactSession", plant)
        scenario, session = snapshot.scenario, cls.__new__(cls)
        session.scenario, session.plant = scenario, plant or snapshot.plant
        session.records = snapshot.recorder.copy()
        session.options = ExactOptions(session.records.fine is not None)
        session.time, session.energy = snapshot.time, snapshot.energy
        session._origin, session._momentum = snapshot.origin, snapshot.momentum
        session.jumped, session.steps = snapshot.jumped, snapshot.steps
        session._segment, session._pending = snapshot.segment, list(snapshot.pending)
        session._prepare(scenario.start.n, scenario.start.dimension)
        session._centres.recall(snapshot.centres)
        y = snapshot.segment.coefficients[0]
        q, p, session._tail = (np.array(x) for x in session._dynamics.split(y))
        begin = State(q, p, snapshot.segment.t0, columns=session._dynamics.further(y))
        about = scenario.agents, session._origin.time, scenario.space
        session._links = LinkState(session._dynamics.layout.law, begin, *about)
        session._dynamics.repack(snapshot.segment.t1)
        session._dynamics.recall_limits(snapshot.limits)
        session._links.recall(snapshot.links)
        session._links.sliding = dict(snapshot.sliding)
        session._dynamics.divide(session._links)
        session._dynamics.relink(session._links)
        session.kinetic = session._dynamics.energy(snapshot.segment.t0, snapshot.segment.coefficients[0])[1]
        tolerance = snapshot.tolerance
        if tolerance is None:
            tolerance = session._dynamics.tolerances(scenario.start, session.energy)
        size = snapshot.segment.coefficients.shape[1]
        session._error = SolutionError(session._dynamics, session.records, size, snapshot.error)
        session._precision = Precision(scenario, session._dynamics, session._origin)
        session._stepper = session._new_stepper(tolerance, snapshot.stepper)
        return session

    def replace(self, *, law: Law | None = None, state: State | None = None) -> None:
        """Replace the law or the state from the session's time on.

        The change of energy counts as a jump of the ledger. Graphs that a new law shares with the one before keep their
        links, others have those of a start; a state with links sets those of the law's graph. A plant is replaced, too.

        Raises
        ------
        InvalidInput
            When law and state disagree, or the new energy is not finite; the session is then unchanged.
        """
        if self._own_now == self._segment.t1:
            self._leave_segment()  # past a jump that comes next, if there is one
        under_way, dynamics = ((own := self._own_now), self._segment, self._links, self._origin), self._dynamics
        numbers = law if state is None and self.plant is None else None
        new = renumbered(self.scenario, numbers, self.time, *under_way, dynamics)
        new = new or replacement(self.scenario, self.plant, law, state, self.state, *under_way, dynamics)
        segment, y, error = new.segment, new.segment.coefficients[-1], self._error
        error.follow(segment, again=True)
        kinetic, work, supplied = self._added(y)
        before = self._dynamics.energy(own, y)[0] + kinetic
        saved = dict(vars(self))
        try:
            self.plant, self.scenario, self._origin = new.plant, new.scenario, new.origin
            self._tail = np.array(y[self._dynamics.columns_size :])
            self._tail[self._dynamics.departs :][:LEDGER] += (work, 0.0, supplied)
            self._prepare(self.n, self.m, new.dynamics)
            self._begin(new.begin, new.links, same_pairs=new.dynamics is not None)
        except Exception:
            vars(self).update(saved)
            error.follow(self._segment, again=True)
            raise
        if segment.t1 > segment.t0:
            error.leave(segment, saved["_links"], saved["_origin"])
            self.records.sample(segment, self._dynamics.split, saved["_origin"])
        error.abandon(own, saved["_links"])
        self._error.take_over(error, exact=state is not None)
        self.records.note_replacement(self.time)
        self.jumped += self.energy + self._added(self._segment.coefficients[-1])[0] - before
        self._record_trace()

    def moment(self) -> Callable[[], Session]:
        """A function that opens a session in the present state, with the records until now."""
        return partial(ExactSession.resume, self.snapshot())

    def pack(self) -> Packed:
        """All that another session needs to go on bit for bit, but its scenario and its records."""
        return pack_exact(self.snapshot(records=False))

    @classmethod
    def unpack(cls, packed: Packed, stored: Stored, changes: Mapping[str, object]) -> ExactSession:
        """Restore a packed session."""
        return cls.resume(restore_exact(*packed, stored))

    def accelerations(self) -> Array:
        """Rates of change of the velocities now, shape (N, m); of agents of order 1 their controls."""
        own = self._own_now
        return self._dynamics.accelerations(own, np.array(self._segment.at(own)))

    @property
    def known(self) -> tuple[tuple[Closest, Closest], Accuracy]:
        """The closest linked and unlinked pair until now, and what is known of the errors."""
        rows, extremes = self._error.until_now(self._segment, self._own_now, self._links, self._origin)
        return extremes.closest, self.records.accuracy(rows, extremes.largest, self._error.known_until)
