"""A running simulation in which agents act on what they know: true links, closest approaches and the ledger beside it.

Between two changes of the forces, or of their formula, positions are polynomials in time; what a change is, and how the
agents move, every engine states itself.
"""

from __future__ import annotations

import heapq
import math
import time as clock
from abc import abstractmethod
from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from flocking.arrays import Array, Indices, Links
from flocking.engine import interruption
from flocking.engine.archives.data_checks import MalformedError
from flocking.engine.imperfect.graph_views import GraphView, view_events, view_from, views_of, with_bodies
from flocking.engine.imperfect.link_rules import LinkRules, known_rules, link_rules
from flocking.engine.imperfect.memory import ImperfectMemory
from flocking.engine.imperfect.pair_polynomials import Paths, as_closest, closest_pairs, paths_in
from flocking.engine.imperfect.pair_switches import pair_events, radial_speed
from flocking.engine.imperfect.powers import SEVEN, Rule
from flocking.engine.imperfect.taylor_series import rates_of
from flocking.engine.imperfect.true_law import TrueLaw
from flocking.engine.protocol.session import Session, Stored, end_of_slice, time_to_reach
from flocking.engine.reference.infinite_starts import infinite_start
from flocking.engine.runs.fidelity import Approaches, Fidelity, LedgerRule
from flocking.engine.runs.recorder import Recorder
from flocking.engine.runs.run import Closest, LedgerRow, is_tangential
from flocking.errors import SimulationError, UnsupportedLaw
from flocking.model.law import Law, Scenario
from flocking.model.state import State

MOST_AT_ONCE = 10_000
"""Events at one instant after which a slice of wall time ends even so: 2,000 agents that act and meet four others."""

NUMBERS = ("time", "steps", "jumped", "accounted", "energy", "kinetic", "largest_power", "ledger_ends",
           "gains_changed")  # fmt: skip
"""Names of the numbers from which a session goes on; times are of the scenario, ``accounted`` is since the start."""


class ImperfectSession(Session):
    """A session in which forces follow from what agents know.

    A derived class calls `begin` once its motion can be evaluated.

    Parameters
    ----------
    scenario
        What is simulated.

    Attributes
    ----------
    links
        True links of each graph, shape (graphs, N, N).
    crossings
        Heap of times, in seconds from the start, and pairs and graphs of true links that will switch.
    closest
        Rows (squared distance, time, i, j) of the closest linked and unlinked pair.
    accounted
        Time until which the ledger is computed, in seconds from the start.
    sums, errors
        Integrals of the powers of the ledger, and what they may be off by, shape (4,) each.
    gains_changed
        How often scheduled gains have changed.
    """

    rule: ClassVar[Rule] = SEVEN
    """How powers of the ledger are integrated."""
    keeps_log: ClassVar[bool] = False
    """Whether it is recorded what agents use when they act."""
    rounding_alone: ClassVar[bool] = True
    """Whether positions have no error but rounding; otherwise that of closest approaches is not known."""

    def __init__(self, scenario: Scenario) -> None:
        self.scenario, self.plant = scenario, None
        start = scenario.start
        self.n, self.m = start.q.shape
        self._base = start.t
        self.time, self.steps = start.t, 0
        self.records = Recorder(scenario, with_log=self.keeps_log)
        graphs = scenario.law.graphs
        self.links: Links = scenario.links_at_start
        self._rules: LinkRules = link_rules(graphs, self.n)
        self._known_rules = known_rules(self._rules, graphs)
        self._views: dict[int, GraphView] = views_of(graphs, scenario.agents.headings, start.q)
        self.crossings: list[tuple[float, int, int, int]] = []
        self.closest = np.array([[np.inf, np.nan, -1.0, -1.0]] * 2)
        self.accounted, self.sums, self.errors = 0.0, np.zeros(4), np.zeros(4)
        self.jumped, self.largest_power, self.ledger_ends = 0.0, 0.0, math.inf
        self._schedule = sorted({s for x in scenario.law.body_terms for s in x.switch_times(start.t, math.inf)})
        self.gains_changed = 0

    def begin(self) -> None:
        """Take up links and ledger at the start.

        Raises
        ------
        InvalidInput
            When the energy is infinite there.
        """
        self.relink()
        self.ledger_ends = self._law.ledger_end(self._base)
        self.energy, self.kinetic = self._energy(0.0)
        if not np.isfinite(self.energy):
            raise infinite_start(self.scenario, self.scenario.start, self.energy)
        self._record_row(0.0)

    # What an engine states of its motion.

    @property
    @abstractmethod
    def _law(self) -> TrueLaw:
        """The law on the true state."""

    @abstractmethod
    def motion_at(self, seconds: float, agents: Indices | slice = slice(None)) -> tuple[Array, Array]:
        """Positions and velocities of ``agents``; those of order 1 with the velocity at which they move.

        Parameters
        ----------
        seconds
            Time since the start, from the last change on.
        """

    def _columns_at(self, seconds: float) -> dict[str, Array]:
        return {}

    def _views_at(self, seconds: float) -> dict[int, GraphView]:
        return with_bodies(self._views, lambda: self._columns_at(seconds))

    def _seen_at(self, seconds: float) -> tuple[Array, Array, dict[str, Array]]:
        q, p = self.motion_at(seconds)
        return q, p if self._law.order == 2 else np.zeros_like(p), self._columns_at(seconds)

    @abstractmethod
    def _series(self, seconds: float) -> Array:
        """Taylor coefficients of the positions about a time since the start, shape (degree + 1, N, m)."""

    def _headings(self, seconds: float, column: str) -> Array:
        """Taylor coefficients about a time of a ``column`` along which agents look: velocities; shape (terms, N, m)."""
        return rates_of(self._series(seconds))

    @abstractmethod
    def _integrated(self, length: float) -> tuple[Array, Array, float]:
        """Integrals of the powers of the ledger over a ``length`` of time, their errors, and the largest power met."""

    @abstractmethod
    def _next_change(self) -> float:
        """When the motion changes next, in seconds from the start."""

    @abstractmethod
    def _change(self) -> None:
        """Change the motion at that time, and record it."""

    def relink(self) -> None:
        """Take the true links as they are now."""
        self._pairs = self._law.pairs(self.links)
        self._linked = int(self.links[0].sum())

    def _energy(self, seconds: float) -> tuple[float, float]:
        q, p = self.motion_at(seconds)
        return self._law.energy(self._base + seconds, q, p, self._pairs, self._linked)

    def _paths(self, seconds: float) -> Paths:
        """How agents move from a time on."""
        return paths_in(self.scenario.space, self._series(seconds), self._base + seconds)

    # Events.

    def _since_start(self, t: float) -> float:
        """Seconds from the start of a scenario's time at which gains change."""
        return t - self._base

    def _next_gains(self) -> float:
        """When scheduled gains change next, in seconds from the start."""
        done = self.gains_changed
        return math.inf if done == len(self._schedule) else self._since_start(self._schedule[done])

    def _take_gains(self) -> None:
        """Take the gains that are in force after the changes so far."""
        changes = self.gains_changed
        self._law.take_parameters(self._schedule[changes - 1] if changes else self._base)

    def _recall_gains(self, numbers: Mapping[str, float]) -> None:
        """Take the gains of a checkpoint; those written before gains could change do not state how often they had."""
        times = [self._since_start(t) for t in self._schedule]
        least, most = (sum(t < numbers["accounted"] for t in times), sum(t <= numbers["accounted"] for t in times))
        found = numbers.get("gains_changed", float(most))
        if not (least <= found <= most and found == int(found)):
            raise MalformedError("gains_changed must agree with the schedules")
        self.gains_changed = int(found)
        self._take_gains()

    def _change_gains(self) -> None:
        """Take the next gains; what they change of the energy is a jump of the ledger."""
        seconds = self._next_gains()
        self._account(seconds)
        self._record_row(seconds)
        self.gains_changed += 1
        self._take_gains()
        before = self.energy
        self.energy, self.kinetic = self._energy(seconds)
        self._jump(before)
        self._record_row(seconds)

    def _jump(self, before: float) -> None:
        """Count what the energy jumped from ``before``; where either is not finite, the ledger ends."""
        finite = bool(np.isfinite(self.energy) and np.isfinite(before))
        self.jumped += self.energy - before if finite else 0.0
        self.ledger_ends = self.ledger_ends if finite else min(self.ledger_ends, self._base + self.accounted)

    def advance(self, to: float, seconds: float = math.inf) -> None:
        """Go on until time ``to``, or for ``seconds`` of wall time."""
        to = time_to_reach(type(self).__name__, to, self.time)
        stop, before, events = end_of_slice(type(self).__name__, seconds), (self.time, self.steps), 0
        end = to - self._base
        last = self.scenario.t_end - self._base
        try:
            while True:
                interruption.check()
                at = self._next_change()
                crossing = self.crossings[0][0] if self.crossings else math.inf
                gains = self._next_gains()
                earliest = min(at, crossing, gains)
                taken = self._take_block(min(end, gains, last), earliest)
                if not taken and self.accounted < last <= earliest and last <= end:
                    self._record_frames(last)
                    self._account(last)
                    self._record_row(last)
                    self.time = self._base + last
                    continue
                if not taken and earliest >= end:
                    break
                if not taken:
                    self._record_frames(earliest)
                    self.time = max(self.time, self._base + earliest)
                    change = self._change if crossing > at else self._switch
                    (self._change_gains if gains <= earliest else change)()
                events += taken or 1
                moved = (self.time, self.steps) != before or events >= MOST_AT_ONCE
                # Seconds from the start are finer than times: a slice that would round to ``to`` goes on.
                moved = moved and self.time < to
                if moved and clock.monotonic() >= stop:  # a slice that ended at its first instant would seem stuck
                    return
            self.time = to
            self._record_frames(end)
        except SimulationError as error:
            error.run = self.run(str(error))
            raise

    def _take_block(self, bound: float, earliest: float) -> int:
        """Let several events take place at once that come before a time, if an engine can; how many have.

        Parameters
        ----------
        bound
            The time, in seconds from the start.
        earliest
            When the next event comes.
        """
        return 0

    def _watch(self, seconds: float, length: Array, changed: Links) -> None:
        """Find the switches of the pairs of changed agents until either one's motion changes again.

        Parameters
        ----------
        seconds
            Now, since the start.
        length
            How long each agent's motion goes on from now, shape (N,).
        changed
            Whose motion begins now, shape (N,).
        """
        if not self._rules.ways.any() and not self._views:
            return
        # A motion may change before its end: its later switches do not take place.
        self.crossings = [x for x in self.crossings if not (changed[x[1]] or changed[x[2]])]
        heapq.heapify(self.crossings)
        size = float(np.abs((paths := self._paths(seconds)).S[0]).max())
        for s, i, j, graph in pair_events(paths, length, changed, self.links, *self._rules, size):
            heapq.heappush(self.crossings, (float(seconds + s), int(i), int(j), int(graph)))
        for graph, each in self._views.items():
            view = view_from(each, lambda column: self._headings(seconds, column))
            for s, i, j in view_events(paths, length, changed, self.links[graph], view, size):
                heapq.heappush(self.crossings, (float(seconds + s), int(i), int(j), graph))

    def _switch(self) -> None:
        """Switch a true link that crosses its distance."""
        seconds, i, j, graph = heapq.heappop(self.crossings)
        (q, r), (p, v) = self.motion_at(seconds, np.array([i, j]))
        d, w = self.scenario.space.displacement(r - q), v - p
        speed, relative = radial_speed(d.tolist(), w.tolist())
        if graph in self._views:
            view = view_from(self._views[graph], lambda column: self._headings(seconds, column))
            speed, relative = view.border_speed(i, d, w)
        breaks = bool(self.links[graph, i, j])
        if breaks and self._law.barriers[graph]:
            self.ledger_ends = min(self.ledger_ends, self._base + self.accounted)
        self._account(seconds)
        self._record_row(seconds)
        self.links[graph, i, j] = not breaks
        if self._rules.ways[graph] == 1 or (graph in self._views and self._views[graph].mutual):
            self.links[graph, j, i] = not breaks
        self.relink()
        before = self.energy
        self.energy, self.kinetic = self._energy(seconds)
        self._jump(before)
        slow, kind = is_tangential(speed, relative), "break" if breaks else "appear"
        self.records.switches.append((self._base + seconds, i, j, kind, graph, speed, slow, math.nan, math.nan))
        self._record_row(seconds)

    # Records.

    def _account(self, seconds: float) -> None:
        """Bring the ledger and the closest approaches up to a time; nothing switched since the last one."""
        length = seconds - self.accounted
        if length <= 0.0:
            return
        paths = self._paths(self.accounted)
        self.closest = closest_pairs(paths, length, self.links[0], self.accounted, self.closest)
        if self._base + self.accounted < self.ledger_ends:
            sums, errors, self.largest_power = self._integrated(length)
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
            q, p, columns = self._seen_at(t - self._base)
            records.frame(t, q, p, self.links[0], columns=columns)

    # Saving.

    @property
    def truth(self) -> ImperfectMemory:
        """What the session goes on from, but what agents know and how they move."""
        numbers = {name: float(getattr(self, name)) for name in NUMBERS}
        return ImperfectMemory(self.links, self.crossings, self.closest, self.sums, self.errors, numbers)

    def recall(self, memory: ImperfectMemory, stored: Stored) -> None:
        """Go on from what a checkpoint states, and from the stored records.

        Parameters
        ----------
        memory
            What was packed, after its checks.
        stored
            The scenario and the records.

        Raises
        ------
        MalformedError
            When gains have not changed as the schedules of the law state.
        """
        self.links, self.crossings, self.closest = memory.links, memory.crossings, memory.closest
        self.sums, self.errors = memory.sums, memory.errors
        self._recall_gains(memory.numbers)
        for name in set(NUMBERS) - {"steps", "gains_changed"}:
            setattr(self, name, float(memory.numbers[name]))
        self.ledger_ends = min(self.ledger_ends, self._law.ledger_end(self.time))  # earlier versions went on
        self.steps = int(memory.numbers["steps"])
        self.relink()
        self.records = Recorder(stored.scenario, with_log=self.keeps_log)
        self.records.recall(stored.counts, stored.read)

    # What others ask.

    @property
    def state(self) -> State:
        """State at the session's time, with the true links."""
        q, p, columns = self._seen_at(self.time - self._base)
        return State(q, p, self.time, self.links[0].copy(), columns)

    @property
    def known(self) -> tuple[tuple[Closest, Closest], None]:
        """The closest linked and unlinked pair until now, with errors of rounding where there are no others."""
        length, found = self.time - self._base - self.accounted, self.closest
        paths = self._paths(self.accounted)
        if length > 0.0:
            found = closest_pairs(paths, length, self.links[0], self.accounted, found)
        return as_closest(paths, found, self._base, rounding_alone=self.rounding_alone), None

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
        """Not possible: `UnsupportedLaw` is raised. What agents know of each other belongs to the past of this run."""
        what = "replaces neither law nor state while a run goes on. Start another run from run.state(-1)."
        raise UnsupportedLaw(f"engine={self.engine!r} {what}")
