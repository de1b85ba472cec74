"""The exact engine: adaptive order 8, every switch located and the step ended there."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np

from flocking.engine import interruption
from flocking.engine.dynamics import LEDGER, Dynamics
from flocking.engine.guards import deepest_dip, reach
from flocking.engine.provenance import provenance
from flocking.engine.recorder import Recorder
from flocking.engine.run import Accuracy, Run
from flocking.engine.segment import Segment
from flocking.engine.snapshot import Snapshot as Snapshot
from flocking.engine.solution_error import SolutionError
from flocking.engine.stepper import Stepper, StepperMemory
from flocking.engine.switching import Crossing, LinkState
from flocking.errors import Chattering, InvalidInput, LinkLost, NotFinite, SimulationError
from flocking.model.checks import Array
from flocking.model.law import Law, Scenario
from flocking.model.state import State

TANGENTIAL = 1e-6
"""A crossing slower than this fraction of the pair's relative speed is flagged as tangential."""

LEDGER_GAP = 1e5
DIP_GAP = 1e-2
"""A step whose energy its ledger misses by more than this, in tolerances at its end and relatively at a close
encounter inside it, jumped over a barrier."""

RETRIES = 30
"""How often a step that cannot be right is retried, four times smaller each time."""


class ExactSession:
    """A running simulation under the exact engine.

    Parameters
    ----------
    scenario
        What to simulate.
    plant
        The law the agents really obey, where it is not the scenario's: the ledger goes on holding the
        declared law, so that a wrong plant shows.

    Raises
    ------
    InvalidInput
        When the plant does not fit the scenario, or the initial energy is not finite.
    """

    engine = "exact"

    def __init__(self, scenario: Scenario, *, plant: Law | None = None) -> None:
        self.scenario = scenario
        self.plant = plant
        start = scenario.start
        self.time = start.t
        self.recorder = Recorder(scenario)
        self.steps = 0
        self.jumped = 0.0
        self._tail = np.zeros(LEDGER)
        self._prepare(start.n, start.dimension)
        self._begin(start, LinkState(plant or scenario.law, start.q, start.links, start.t, scenario.agents.headings))
        self._record_frames()
        self._record_trace()

    def _prepare(self, n: int, m: int) -> None:
        """Kernels and parameters: all that depends on the law but not on the state."""
        self.n, self.m = n, m
        self._dynamics = Dynamics(self.scenario, self.plant, n, m)
        self._jump = -np.inf

    def _begin(self, state: State, links: LinkState) -> None:
        """Stand at ``state`` with the proposed step still to be found."""
        dynamics = self._dynamics
        dynamics.repack(state.t)
        self._links = links
        dynamics.divide(links)
        dynamics.relink(links)
        self._tail = np.concatenate([self._tail[:LEDGER], dynamics.places(state.t)])
        y = dynamics.join(state, self._tail)
        self.energy, self.kinetic = dynamics.energy(state.t, y)
        if not np.isfinite(self.energy):
            raise InvalidInput(
                "Scenario", "start", "must have a finite energy", self.energy,
                "Two agents sit where the potential is infinite; move them apart or inside its range.",
            )  # fmt: skip
        memory = StepperMemory(state.t, y, dynamics.slope(state.t, y), 0.0)
        if not np.isfinite(memory.slope).all():
            raise NotFinite("The control at the start is infinite or NaN.", time=state.t)
        self._stepper = Stepper(dynamics.slope, dynamics.stages, dynamics.tolerances(state, self.energy), memory)
        self._segment = Segment.resting(state.t, y)
        self._error = SolutionError(dynamics, self.recorder, len(y))
        self._pending: list[Crossing] = []

    @property
    def state(self) -> State:
        """State at the session's time, with the links of the law's graph."""
        q, p, _ = self._dynamics.split(self._segment.at(self.time))
        return State(q, p, self.time, self._links.links[0])

    def advance(self, to: float) -> None:
        """Go on until time ``to``. Where steps fall does not depend on how often this is called.

        Raises
        ------
        SimulationError
            When the run cannot go on; its ``run`` holds what was computed until then.
        InvalidInput
            When ``to`` lies in the past.
        """
        if not to >= self.time:
            raise InvalidInput("ExactSession", "to", f"must not be before the session's time, {self.time:g}", to)
        try:
            while self._segment.t1 < to:
                interruption.check()
                self._leave_segment()
                self._take_step()
            self.time = to
            self._record_frames()
            if self._segment.t1 == to == self.scenario.t_end:
                self._leave_segment()
        except SimulationError as error:
            error.run = self.run(str(error))
            raise

    def _bound(self) -> float:
        """Where the next step must end: the end of the run, or the last moment before a term switches."""
        now = self._segment.t1
        end = self.scenario.t_end if now < self.scenario.t_end else np.inf
        jump = self._next_jump(now)
        before = float(np.nextafter(jump, -np.inf))
        return before if jump < end and before > now else end

    def _next_jump(self, now: float) -> float:
        """The first time after ``now`` at which a term switches by itself."""
        if not self._jump > now:
            times = (s for term in self._dynamics.layout.law.body_terms for s in term.switch_times(now, np.inf))
            self._jump = min(times, default=np.inf)
        return self._jump

    def _take_step(self) -> None:
        before, known = self._stepper.memory, self._error.difference
        try:
            segment, pending = self._found_step(before)
            self._error.follow(segment)
        except BaseException:
            self._stepper.recall(before)
            self._error.difference = known
            raise
        self._segment, self._pending = segment, pending
        self.steps += 1

    def _found_step(self, before: StepperMemory) -> tuple[Segment, list[Crossing]]:
        """The next segment, up to the first crossing, with what crosses at its end."""
        bound = self._bound()
        longest = np.inf
        for _ in range(RETRIES):
            whole = self._stepper.step(bound, longest)
            where, crossings = self._links.next_crossings(whole, self.n, self.m)
            segment = whole.cut(where) if crossings else whole
            lost = self._links.lost_link(crossings, self._dynamics.barriers)
            share = self._dynamics.allowed_share(segment)
            if lost is None and share >= 1 and not self._jumps_barrier(segment):
                break
            longest = (segment.t1 - segment.t0) * (share if share < 1 else 0.25)
            if longest <= 64 * np.finfo(float).eps * max(1.0, abs(before.t)):
                break
            self._stepper.recall(before)
        if lost is not None:
            raise LinkLost(
                "A link whose potential is infinite at the break radius reached it. "
                "The energy of the start is not finite or the tolerance is too coarse; lower Scenario.tolerance.",
                time=before.t, agents=lost,
            )  # fmt: skip
        return segment, crossings

    def _jumps_barrier(self, segment: Segment) -> bool:
        """Whether a step changes the energy by far more than its ledger explains."""
        if self.plant is not None:
            return False
        if self._ledger_gap(segment.t1, segment.coefficients[-1]) > LEDGER_GAP * self.scenario.tolerance:
            return True
        if not self._dynamics.singular:
            return False
        B = segment.coefficients[:, : self.n * self.m].reshape(-1, self.n, self.m)
        x = deepest_dip(B, reach(B), self._dynamics.pairs[0], self._dynamics.pairs[1])
        if x > 1.0:
            return False
        inside = segment.cut(x)
        return self._ledger_gap(inside.t1, inside.coefficients[-1]) > DIP_GAP

    def _ledger_gap(self, t: float, y: Array) -> float:
        """What the ledger misses between the start of the step and ``y``, relative to the energies."""
        _, dissipated, supplied = (y[self._dynamics.order * self.n * self.m :] - self._tail)[:LEDGER]
        energy, kinetic = self._dynamics.energy(t, y)
        gap = abs(energy - self.energy + dissipated - supplied)
        gap /= max(1.0, abs(self.energy), abs(supplied), self.kinetic, kinetic)
        return float(gap) if np.isfinite(gap) else np.inf

    def _leave_segment(self) -> None:
        """Put the current segment on record and switch what crosses at its end."""
        segment = self._segment
        t, y = segment.t1, segment.coefficients[-1]
        if t > segment.t0:
            self._error.leave(segment, self._links)
            self._record_fine(segment)
            self._tail = np.array(y[self._dynamics.order * self.n * self.m :])
            self.energy, self.kinetic = self._dynamics.energy(t, y)
            self.time = t
            self._record_frames()
            self._record_trace()
        error = self._switch() if self._pending else None
        after = float(np.nextafter(t, np.inf))
        if after == self._next_jump(t):
            t = after
            self._dynamics.repack(t)
            before = self.energy
            self.energy, self.kinetic = self._dynamics.energy(t, y)
            self.jumped += self.energy - before
            self._stepper.restart(t, y)
        self._segment = Segment.resting(t, y)
        if error is not None:
            raise error

    def _switch(self) -> SimulationError | None:
        """Toggle what crosses at the end of the segment; why the run cannot go on, if it cannot."""
        crossings, self._pending = self._pending, []
        t, y = self._segment.t1, self._segment.coefficients[-1]
        q, p, _ = self._dynamics.split(y)
        if self._dynamics.order == 1:
            p = np.asarray(self._dynamics.slope(t, y))[: self.n * self.m].reshape(q.shape)
        chattering: tuple[int, ...] = ()
        for crossing in crossings:
            chattering = self._write_switch(crossing, t, q, p) or chattering
            self._links.apply(crossing)
        error: SimulationError | None = None
        if chattering:
            error = Chattering(
                "A pair crosses the same distance to and fro and does not leave it (a Filippov sliding mode). "
                "Use Hysteresis with a gap, or a potential that vanishes smoothly at the radius.",
                time=t, agents=chattering,
            )  # fmt: skip
        try:
            self._dynamics.relink(self._links)
        except InvalidInput as reason:
            # The functional of a graph may cease to exist as its links change.
            return SimulationError(str(reason), time=t)
        watches = [self._links.watches[c.watch] for c in crossings]
        if any(watch.rise or not watch.inner for watch in watches):
            before = self.energy
            self.energy, self.kinetic = self._dynamics.energy(t, y)
            if not np.isfinite(self.energy) or any(
                self._links.meets_barrier(c, self._dynamics.barriers) for c in crossings
            ):
                i, j = crossings[0].pairs[0]
                error = NotFinite(
                    "A link appeared where its potential is infinite. Use Hysteresis with a gap.",
                    time=t, agents=(int(i), int(j)),
                )  # fmt: skip
            self.jumped += self.energy - before
            self._record_trace()
        self._stepper.restart(t, np.array(y))
        self._error.switched(self._stepper.memory.slope)
        return error

    def _write_switch(self, crossing: Crossing, t: float, q: Array, p: Array) -> tuple[int, ...]:
        """Record the switches of a crossing; the pair that chatters, if one does."""
        watch = self._links.watches[crossing.watch]
        near = self._links.near[crossing.watch]
        chattering: tuple[int, ...] = ()
        for k, (i, j) in enumerate(crossing.pairs):
            if watch.kind in ("obstacle", "rim"):
                record = self._links.encounters.record(watch.graph - len(self._links.graphs), t, q, p, (i, j))
                errors = self._error.crossing(crossing, k, record[5], self._segment, self._links)
                if watch.kind == "obstacle":
                    self.recorder.switches.append((*record, *errors))
                if self._links.slides(crossing, k, t, record[5]):
                    chattering = (int(i),)
                continue
            d, v = q[j] - q[i], p[j] - p[i]
            speed = float(d @ v / np.linalg.norm(d)) if d.any() else 0.0
            slow = abs(speed) < TANGENTIAL * max(float(np.linalg.norm(v)), 1e-12)
            kind = "kink" if watch.kind == "kink" else "break" if near[i, j] else "appear"
            errors = self._error.crossing(crossing, k, speed, self._segment, self._links)
            self.recorder.switches.append((t, int(i), int(j), kind, watch.graph, speed, slow, *errors))
            if self._links.slides(crossing, k, t, speed):
                chattering = (int(i), int(j))
        return chattering

    def _record_frames(self) -> None:
        due = self.recorder.due(self.time)
        if due:
            error = self._error.over(self._segment)
        for t in due:
            q, p, _ = self._dynamics.split(self._segment.at(t))
            self.recorder.frame(t, q, p, self._links.links[0], (error.position, error.velocity))

    def _record_fine(self, segment: Segment) -> None:
        for t in self.recorder.fine_times(segment):
            q, p, _ = self._dynamics.split(segment.at(float(t)))
            self.recorder.fine_sample(float(t), q, p)

    def _record_trace(self) -> None:
        work, dissipated, supplied = self._tail[:LEDGER]
        self.recorder.trace.append(
            (self._segment.t1, self.energy, self.kinetic, work, dissipated, supplied, self.jumped)
        )

    def snapshot(self, *, records: bool = True) -> Snapshot:
        """Everything needed to go on bit for bit; see `resume`. Without ``records`` the recorder is not copied."""
        recorder = copy.deepcopy(self.recorder) if records else self.recorder
        return Snapshot(
            self.scenario, self.time, self._stepper.memory, self._segment, list(self._pending),
            self._links.memory(), recorder, self.energy, self.jumped, self.steps,
            self._stepper.tolerance, dict(self._links.sliding), self.plant, self._error.memory,
        )  # fmt: skip

    @classmethod
    def resume(cls, snapshot: Snapshot, *, plant: Law | None = None) -> ExactSession:
        """A session that goes on exactly as the one the snapshot was taken of."""
        scenario = snapshot.scenario
        session = cls.__new__(cls)
        session.scenario, session.plant = scenario, plant or snapshot.plant
        session.recorder = copy.deepcopy(snapshot.recorder)
        session.time, session.energy = snapshot.time, snapshot.energy
        session.jumped, session.steps = snapshot.jumped, snapshot.steps
        session._segment, session._pending = snapshot.segment, list(snapshot.pending)
        session._prepare(scenario.start.n, scenario.start.dimension)
        q, _, session._tail = (np.array(x) for x in session._dynamics.split(snapshot.segment.coefficients[0]))
        session._links = LinkState(
            session._dynamics.layout.law, q, t=snapshot.segment.t0, headings=scenario.agents.headings
        )
        session._dynamics.repack(snapshot.segment.t1)
        session._links.recall(snapshot.links)
        session._links.sliding = dict(snapshot.sliding)
        session._dynamics.divide(session._links)
        session._dynamics.relink(session._links)
        session.kinetic = session._dynamics.energy(snapshot.segment.t0, snapshot.segment.coefficients[0])[1]
        tolerance = snapshot.tolerance
        if tolerance is None:
            tolerance = session._dynamics.tolerances(scenario.start, session.energy)
        size = snapshot.segment.coefficients.shape[1]
        session._error = SolutionError(session._dynamics, session.recorder, size, snapshot.error)
        session._stepper = Stepper(session._dynamics.slope, session._dynamics.stages, tolerance, snapshot.stepper)
        return session

    def replace(self, *, law: Law | None = None, state: State | None = None) -> None:
        """Put another law or state in force from the session's time on.

        The change of energy counts as a jump of the ledger. A law over the same graphs keeps their link memory;
        a state that brings links sets that of the law's graph. A new law takes the place of a plant, too.

        Raises
        ------
        InvalidInput
            When law and state disagree, or the new energy is not finite; the session then goes on as before.
        """
        if self.time == self._segment.t1:
            self._leave_segment()
        old = self.state
        new = State(old.q, old.p, self.time) if state is None else State(state.q, state.p, self.time, state.links)
        if new.q.shape != old.q.shape:
            raise InvalidInput("ExactSession", "state", f"must have the shape {old.q.shape}", new.q.shape)
        declared = law or self.scenario.law
        end = max(self.scenario.t_end, self.time)
        self.scenario.with_(law=declared, start=new, t_end=end, frames=1)
        plant = self.plant if law is None else None
        acting = plant or declared
        links = LinkState(acting, new.q, new.links, self.time, self.scenario.agents.headings)
        if state is None and acting.graphs == self._links.graphs:
            for matrix, kept_links in zip(links.links, self._links.links, strict=True):
                matrix[:] = kept_links
        segment = self._segment.until(self.time)
        error = self._error
        error.follow(segment, again=True)
        y = segment.coefficients[-1]
        before, _ = self._dynamics.energy(self.time, y)
        kept = dict(vars(self))
        try:
            self.plant = plant
            self.scenario = self.scenario.with_(law=declared, t_end=end)
            self._tail = np.array(y[self._dynamics.order * self.n * self.m :])
            self._prepare(self.n, self.m)
            self._begin(new, links)
        except Exception:
            vars(self).update(kept)
            error.follow(self._segment, again=True)
            raise
        if segment.t1 > segment.t0:
            error.leave(segment, kept["_links"])
            self._record_fine(segment)
        error.abandon(self.time, kept["_links"])
        self._error.take_over(error, exact=state is not None)
        self.jumped += self.energy - before
        self._record_trace()

    @property
    def about(self) -> dict[str, Any]:
        """Where the records come from: versions, engine, tolerance and counts."""
        return provenance(self.engine, self.scenario) | {"steps": self.steps, "tolerance": self.scenario.tolerance}

    @property
    def accuracy(self) -> Accuracy:
        """What is known of the errors of what was computed so far."""
        return self.recorder.accuracy(self._error.open_rows(self.time, self._links), self._error.known_until)

    def run(self, status: str = "finished") -> Run:
        """What was computed so far."""
        return Run(
            self.scenario, status=status, provenance=self.about, accuracy=self.accuracy, **self.recorder.tables()
        )
