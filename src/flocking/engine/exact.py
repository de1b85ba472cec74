"""The exact engine: adaptive order 8, every switch located and the step ended there."""

from __future__ import annotations

import copy
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from flocking.engine.codegen import compiled_kernels
from flocking.engine.layout import Layout
from flocking.engine.provenance import provenance
from flocking.engine.recorder import Recorder
from flocking.engine.run import Run
from flocking.engine.segment import Segment
from flocking.engine.stepper import Stepper, StepperMemory
from flocking.engine.switching import Crossing, LinkState
from flocking.errors import Chattering, InvalidInput, LinkLost, NotFinite, SimulationError
from flocking.model.checks import Array
from flocking.model.graphs import Graph
from flocking.model.law import Law, Scenario
from flocking.model.state import State
from flocking.model.terms import Gradient

TANGENTIAL = 1e-6
"""A crossing slower than this fraction of the pair's relative speed is flagged as tangential."""

MOST_INSTANT_SWITCHES = 200
INSTANT = 1e-9
"""So many switching instants within so little time make a session say that the motion chatters."""

RETRIES = 30
"""How often a step that cannot be right is retried, four times smaller each time."""


@dataclass(frozen=True, eq=False)
class Snapshot:
    """Everything a session of the exact engine needs to go on bit for bit."""

    scenario: Scenario
    time: float
    stepper: StepperMemory
    segment: Segment
    pending: list[Crossing]
    links: Any
    recorder: Recorder
    energy: float
    jumped: float
    steps: int


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
        self.time = scenario.start.t
        n, m = scenario.start.q.shape
        self.recorder = Recorder(scenario.frame_times, n, m)
        self.steps = 0
        self.jumped = 0.0
        self._instants: deque[float] = deque(maxlen=MOST_INSTANT_SWITCHES)
        self._tail = np.zeros(3)
        self._set_up(scenario, scenario.start)
        self._record_frames()
        self._record_trace()

    def _set_up(self, scenario: Scenario, state: State) -> None:
        n, m = state.q.shape
        self.n, self.m = n, m
        law = self.plant or scenario.law
        law.check_count(n, m)
        self._order = scenario.agents.order
        self._layout = Layout(law, scenario.energy)
        self._kernels = compiled_kernels(self._layout, m, self._order)
        self._slots = self._layout.values(scenario.agents, n)
        self._ledger = None
        if self.plant is not None:
            declared = Layout(scenario.law, scenario.energy)
            self._ledger = (compiled_kernels(declared, m, self._order), declared.values(scenario.agents, n))
        self._links = LinkState(law, state.q, state.links)
        self._barriers = [_has_barrier(law, g) for g in law.graphs]
        self._pairs = self._links.pairs()
        parts = [state.q.ravel(), state.p.ravel()] if self._order == 2 else [state.q.ravel()]
        y = np.concatenate([*parts, self._tail])
        self.energy, self.kinetic = self._energy(state.t, y)
        if not np.isfinite(self.energy):
            raise InvalidInput(
                "Scenario", "start", "must have a finite energy", self.energy,
                "Two agents sit where the potential is infinite; move them apart or inside its range.",
            )  # fmt: skip
        self._stepper = Stepper(self._right_hand_side(), state.t, y, self._tolerances(state))
        if not np.isfinite(self._stepper.memory.slope).all():
            raise NotFinite("The control at the start is infinite or NaN.", time=state.t)
        self._segment = Segment(state.t, state.t, np.repeat(y[None], 8, axis=0))
        self._pending: list[Crossing] = []
        self._left_at = 0.0

    def _tolerances(self, state: State) -> Array:
        spread = float(np.abs(state.q - state.q.mean(axis=0)).max(initial=0.0))
        speed = float(np.abs(state.p).max(initial=0.0))
        tolerance = self.scenario.tolerance
        count = self.n * self.m
        parts = [np.full(count, tolerance * max(1.0, spread))]
        if self._order == 2:
            parts.append(np.full(count, tolerance * max(1.0, speed)))
        return np.concatenate([*parts, np.full(3, tolerance * max(1.0, abs(self.energy)))])

    def _right_hand_side(self) -> Callable[[float, Array], Array]:
        rhs, n, count = self._kernels.rhs, self.n, self.n * self.m
        P, A, W = self._slots
        S = np.zeros((len(self._links.graphs), n))
        if self._ledger is None:

            def slope(t: float, y: Array) -> Array:
                senders, sensed, offsets = self._pairs
                return np.asarray(rhs(t, y, n, senders, sensed, offsets, P, A, W, S))

            return slope
        module, (P2, A2, W2) = self._ledger
        m, order = self.m, self._order

        def mutated(t: float, y: Array) -> Array:
            senders, sensed, offsets = self._pairs
            dy = np.asarray(rhs(t, y, n, senders, sensed, offsets, P, A, W, S))
            q = y[:count].reshape(n, m)
            p = y[count : 2 * count].reshape(n, m) if order == 2 else np.zeros_like(q)
            rates = np.empty(3)
            module.control(t, q, p, senders, sensed, offsets, P2, A2, W2, S, np.empty_like(q), rates)
            dy[order * count + 1 :] = rates[1:]
            return dy

        return mutated

    def _energy(self, t: float, y: Array) -> tuple[float, float]:
        module, (P, A, W) = self._ledger or (self._kernels, self._slots)
        q, p, _ = self._split(y)
        S = np.zeros((len(self._links.graphs), self.n))
        pairs, bodies, kinetic = module.energies(t, q, p, *self._pairs, P, A, W, S)
        unlinked = 0.0
        if self.scenario.energy.unlinked:
            count = np.count_nonzero(self._links.links[0])
            unlinked = 0.5 * (self.n * (self.n - 1) - count) * self.scenario.energy.unlinked
        return float(pairs + bodies + kinetic + unlinked), float(kinetic)

    def _split(self, y: Array) -> tuple[Array, Array, Array]:
        count = self.n * self.m
        q = y[:count].reshape(self.n, self.m)
        p = y[count : 2 * count].reshape(self.n, self.m) if self._order == 2 else np.zeros_like(q)
        return q, p, y[self._order * count :]

    @property
    def state(self) -> State:
        """State at the session's time, with the links of the law's graph."""
        q, p, _ = self._split(self._segment.at(self.time))
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
        now = self._segment.t1
        times = [self.scenario.t_end] if now < self.scenario.t_end else []
        for term in self._layout.law.body_terms:
            times += [s for s in term.switch_times(now, np.inf) if s > now]
        return min(times, default=np.inf)

    def _take_step(self) -> None:
        before = self._stepper.memory
        longest = np.inf
        for _ in range(RETRIES):
            segment = self._stepper.step(self._bound(), longest)
            where, crossings = self._links.next_crossings(segment, self.n, self.m)
            lost = self._lost_link(crossings)
            if lost is None and not self._ledger_breaks(segment, where):
                break
            longest = (segment.t1 - segment.t0) * min(where, 1.0) / 4
            if longest <= 64 * np.finfo(float).eps * max(1.0, abs(before.t)):
                break
            self._stepper.recall(before)
        if lost is not None:
            raise LinkLost(
                "A link whose potential is infinite at the break radius reached it. "
                "The energy of the start is not finite or the tolerance is too coarse; lower Scenario.tolerance.",
                time=before.t, agents=lost,
            )  # fmt: skip
        if crossings:
            segment = segment.until(segment.t0 + min(where, 1.0) * (segment.t1 - segment.t0))
        self._segment, self._pending = segment, crossings
        self.steps += 1

    def _ledger_breaks(self, segment: Segment, where: float) -> bool:
        """Whether a step changes the energy by far more than its ledger explains: it jumped over a barrier."""
        if self.plant is not None:
            return False
        y = segment.coefficients[-1]
        if where <= 1.0:
            y = segment.at(segment.t0 + where * (segment.t1 - segment.t0))
        tail = y[self._order * self.n * self.m :]
        energy, _ = self._energy(segment.t1, y)
        gap = energy - self.energy + (tail[1] - self._tail[1]) - (tail[2] - self._tail[2])
        scale = max(1.0, abs(energy), abs(self.energy), abs(tail[2] - self._tail[2]))
        return not abs(gap) <= 1e5 * self.scenario.tolerance * scale

    def _lost_link(self, crossings: list[Crossing]) -> tuple[int, ...] | None:
        for crossing in crossings:
            watch = self._links.watches[crossing.watch]
            if watch.kind == "link" and self._barriers[watch.graph]:
                for i, j in crossing.pairs:
                    if self._links.links[watch.graph][i, j]:
                        return (int(i), int(j))
        return None

    def _leave_segment(self) -> None:
        """Put the current segment on record and switch what crosses at its end."""
        segment = self._segment
        if segment.t1 > segment.t0:
            self.recorder.approach(segment, self._links.links[0])
            self._tail = np.array(segment.coefficients[-1][self._order * self.n * self.m :])
            y = segment.coefficients[-1]
            self.energy, self.kinetic = self._energy(segment.t1, y)
            self.time = segment.t1
            self._record_frames()
            self._record_trace()
        elif not self.recorder.trace:
            self._record_trace()
        if self._pending:
            self._switch()
        self._segment = Segment(segment.t1, segment.t1, np.repeat(segment.coefficients[-1][None], 8, axis=0))

    def _switch(self) -> None:
        segment, crossings = self._segment, self._pending
        self._pending = []
        y = segment.coefficients[-1]
        q, p, _ = self._split(y)
        self._instants.append(segment.t1)
        if len(self._instants) == MOST_INSTANT_SWITCHES and segment.t1 - self._instants[0] <= INSTANT * max(
            1.0, abs(segment.t1)
        ):
            i, j = crossings[0].pairs[0]
            raise Chattering(
                "A link switches on and off without time passing (a Filippov sliding mode). "
                "Use Hysteresis with a gap, or a potential that vanishes smoothly at the radius.",
                time=segment.t1, agents=(int(i), int(j)),
            )  # fmt: skip
        for crossing in crossings:
            self._write_switch(crossing, segment.t1, q, p)
            self._links.apply(crossing)
        if any(self._links.watches[c.watch].kind == "link" for c in crossings):
            self._pairs = self._links.pairs()
            before = self.energy
            self.energy, self.kinetic = self._energy(segment.t1, y)
            self.jumped += self.energy - before
            self._record_trace()
        self._stepper.restart(segment.t1, np.array(y))

    def _write_switch(self, crossing: Crossing, t: float, q: Array, p: Array) -> None:
        watch = self._links.watches[crossing.watch]
        near = self._links.near[crossing.watch]
        for i, j in crossing.pairs:
            d, v = q[j] - q[i], p[j] - p[i]
            speed = float(d @ v / np.linalg.norm(d)) if d.any() else 0.0
            scale = max(float(np.linalg.norm(v)), 1e-12)
            kind = "kink" if watch.kind == "kink" else "break" if near[i, j] else "appear"
            slow = self._order == 2 and abs(speed) < TANGENTIAL * scale
            self.recorder.switches.append((t, int(i), int(j), kind, watch.graph, speed, slow))

    def _record_frames(self) -> None:
        for t in self.recorder.due(self.time):
            q, p, _ = self._split(self._segment.at(t))
            self.recorder.frame(t, q, p, self._links.links[0])

    def _record_trace(self) -> None:
        work, dissipated, supplied = self._tail
        self.recorder.trace.append(
            (self._segment.t1, self.energy, self.kinetic, work, dissipated, supplied, self.jumped)
        )

    def snapshot(self, *, records: bool = True) -> Snapshot:
        """Everything needed to go on bit for bit; see `resume`. Without ``records`` the recorder is not copied."""
        recorder = copy.deepcopy(self.recorder) if records else self.recorder
        return Snapshot(
            self.scenario, self.time, self._stepper.memory, self._segment, list(self._pending),
            self._links.memory(), recorder, self.energy, self.jumped, self.steps,
        )  # fmt: skip

    @classmethod
    def resume(cls, snapshot: Snapshot, *, plant: Law | None = None) -> ExactSession:
        """A session that goes on exactly as the one the snapshot was taken of."""
        session = cls(snapshot.scenario, plant=plant)
        session.recorder = copy.deepcopy(snapshot.recorder)
        session.time, session.energy = snapshot.time, snapshot.energy
        session.jumped, session.steps = snapshot.jumped, snapshot.steps
        session._segment, session._pending = snapshot.segment, list(snapshot.pending)
        session._links.recall(snapshot.links)
        session._pairs = session._links.pairs()
        session._stepper.recall(snapshot.stepper)
        start = snapshot.segment.coefficients[0]
        session._tail = np.array(start[session._order * session.n * session.m :])
        return session

    def replace(self, *, law: Law | None = None, state: State | None = None) -> None:
        """Put another law or state in force from the session's time on.

        The change of energy counts as a jump of the ledger.

        Raises
        ------
        InvalidInput
            When law and state disagree, or the new energy is not finite.
        """
        old = self.state
        new = state if state is not None else old
        new = State(new.q, new.p, self.time, new.links if law is None else None)
        scenario = self.scenario.with_(law=law or self.scenario.law, start=State(new.q, new.p, self.time))
        self._segment = self._segment.until(self.time)
        if self._segment.t1 > self._segment.t0:
            self.recorder.approach(self._segment, self._links.links[0])
        y = self._segment.coefficients[-1]
        self._tail = np.array(y[self._order * self.n * self.m :])
        before, _ = self._energy(self.time, y)
        keep = self.scenario
        self.scenario = keep.with_(law=scenario.law, t_end=max(keep.t_end, self.time))
        self._set_up(self.scenario, new)
        self.jumped += self.energy - before
        self._record_trace()

    @property
    def about(self) -> dict[str, Any]:
        """Where the records come from: versions, engine, tolerance and counts."""
        return provenance(self.engine, self.scenario) | {"steps": self.steps, "tolerance": self.scenario.tolerance}

    def run(self, status: str = "finished") -> Run:
        """What was computed so far."""
        return Run(self.scenario, status=status, provenance=self.about, **self.recorder.tables())


def _has_barrier(law: Law, graph: Graph) -> bool:
    """Whether a potential over ``graph`` is infinite where its links break."""
    radius = np.max(np.asarray(graph.break_radius))
    if not np.isfinite(radius):
        return False
    numbers = [k for k, g in enumerate(law.graphs) if g is graph]
    return any(
        not np.isfinite(term.potential(radius))
        for term in law.pair_terms
        if isinstance(term, Gradient) and law.graph_number(term) in numbers
    )
