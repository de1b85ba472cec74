"""Measurements and verdicts while a run goes on, each computed on a thread of its own."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Mapping

from flocking.apps.lab.experiment.challenges import Score, challenge_of, judged
from flocking.apps.lab.experiment.clock import Clock, Frame
from flocking.apps.lab.experiment.history import History
from flocking.apps.lab.experiment.timeline import CURVES, Timeline
from flocking.apps.lab.panels.measures import (
    LEDGER,
    MOST_CLAIMS,
    ShownVerdict,
    claims_of,
    guarantees_of,
    ledger,
    measured,
    verdicts_on,
)
from flocking.engine.runs.run import Run
from flocking.errors import FlockingError
from flocking.formula.markup.text_formulas import set_text
from flocking.model.law import Scenario
from flocking.model.state import State
from flocking.study.certificates.certificate import Certificates
from flocking.study.potentials.state_energy import total_energy

READ_SECONDS = 0.2
"""Least seconds between two measurements: five in a second can still be read."""
JUDGE_SECONDS = 1.0
"""Least seconds between two judgements of the claims, which take longer than measurements."""
MOST_EVALUATED = 2000
"""Agents up to which the energy within a step is computed anew, as their forces are: all pairs are looked at."""
PATIENCE = 5.0
"""The next judgement of a run that goes on waits at least this many times the processor time of the last."""


class Measuring:
    """Measures and judges the frames of a clock, and keeps their record.

    Parameters
    ----------
    clock
        The clock.
    changed
        Called when there is something new to show.
    """

    def __init__(self, clock: Clock, changed: Callable[[], None]) -> None:
        self._clock, self._changed = clock, changed
        self.timeline = Timeline()
        self.history = History()
        self.verdicts: list[ShownVerdict] = []
        self.numbers: list[dict[str, float]] = []
        """The last measurements, of each experiment."""
        self.measured_at = math.nan
        """Time of these."""
        self.since = math.nan
        """Time from which on the motion was judged."""
        self.reads = 0
        self.challenge = ""
        """Name of the challenge that is tried, as in `challenge_of`; empty for none."""
        self._faults: dict[str, str] = {}
        self._last_read: Frame | None = None
        self._certified: tuple[State, Certificates | None] | None = None
        """The first state of a history, and what is guaranteed from it on."""
        self._final: tuple[object, dict[str, ShownVerdict]] = ((), {})
        """A history, and the failures found in it that are final: later on it may not hold what they rest on."""
        self._judged: tuple[float, tuple[int, ...]] | None = None
        """Time and numbers of changes of the moment that was judged last."""
        self._judged_version = 0
        self._judged_members: tuple[int, ...] = ()
        """What named the agent of each number in the motion that was judged."""
        self._former = 0
        """Number of the last frame of a run that another took the place of."""
        self._lock = threading.Lock()
        self._judging = threading.Lock()
        self._threads = [
            threading.Thread(target=run, name=f"flocking-lab-{name}", daemon=True)
            for name, run in (("measurements", self._keep_reading), ("claims", self._keep_judging))
        ]

    def begin(self) -> None:
        """Start reading and judging."""
        for thread in self._threads:
            thread.start()

    def join(self) -> None:
        """Wait for the threads; the clock must be closed."""
        for thread in self._threads:
            if thread.is_alive():
                thread.join()

    def reset(self) -> None:
        """Clear all measurements, as for another run; called between steps of the clock."""
        with self._lock:
            self._begin_anew()
            self.timeline.reset()
            self.numbers = []
        self._changed()

    def go_on_from(self, t: float) -> None:
        """Remove what lies after ``t``: the run goes on from there; called between steps of the clock."""
        with self._lock:
            self._begin_anew()
            self.timeline.cut(t)
        self._changed()

    def _begin_anew(self) -> None:
        self.history.clear()
        self.verdicts, self._judged = [], None
        self._last_read = self._certified = None
        # A frame of the former run may be measured or judged just now: its result must not enter the new record.
        self._former = self._clock.frame.number

    def _keep_reading(self) -> None:
        number = 0
        while not self._clock.closed:
            frame = self._clock.next_frame(number, timeout=READ_SECONDS)
            if frame is None:
                continue
            number, used = frame.number, time.thread_time()
            if self._guarded(self._read, frame):
                self._last_read = frame
            time.sleep(max(READ_SECONDS, 2 * (time.thread_time() - used)))

    def _keep_judging(self) -> None:
        """Judge on a thread of its own: claims may take seconds, in which measurements go on."""
        judged, pause = 0.0, JUDGE_SECONDS
        while not self._clock.closed:
            time.sleep(READ_SECONDS)
            last = self._last_read
            if last is None or last.states[0].n > MOST_CLAIMS:
                continue
            # A run that stands still is judged once more: else its lamps would be those of a moment before.
            at_rest = not self._clock.running and last is self._clock.frame
            due = self._judged != _moment(last) if at_rest else time.perf_counter() - judged > pause
            if due:
                used = time.thread_time()
                self._guarded(self.judge, last)
                judged = time.perf_counter()
                pause = max(JUDGE_SECONDS, PATIENCE * (time.thread_time() - used))

    def _guarded(self, act: Callable[[Frame], None], frame: Frame) -> bool:
        """Do it; returns whether it succeeded."""
        fault = ""
        try:
            act(frame)
        except Exception as error:  # a measure may fail for a changed law
            fault = f"The measurements failed: {type(error).__name__}: {error}"
            self._judged = _moment(frame)
        self._faults[act.__name__] = fault
        self._changed()
        return not fault

    @property
    def fault(self) -> str:
        """Why the last measurement or judgement failed; empty when neither did."""
        return next((fault for fault in self._faults.values() if fault), "")

    def _read(self, frame: Frame) -> None:
        numbers = [_numbers(frame, k) for k in range(len(frame.states))]
        with self._lock:
            if frame.number <= self._former:
                return
            self.history.take(frame)
            self.numbers, self.measured_at = numbers, frame.time
            values = [_curve(each, name) for each in numbers for name in CURVES]
            self.timeline.take(frame.states[0], frame.scenarios[0], values)
        self.reads += 1

    def window(self) -> Run | None:
        """The motion since the last intervention, as a run; None before three of its moments were measured."""
        found: list[Run | None] = []

        def look() -> None:
            experiment = self._clock.experiments[0]
            closest, accuracy = experiment.session.known
            with self._lock:
                # After a change that was not measured yet what the session knows is not of the moments before it.
                same = self.history.mark[:2] == (experiment.changed_at, experiment.version)
                found.append(self.history.run(closest, accuracy, experiment.session.fidelity) if same else None)

        self._clock.between_steps(look)
        return found[0] if found else None

    def judge(self, frame: Frame) -> None:
        """Judge the claims by the motion since the last intervention."""
        self._judged = _moment(frame)
        with self._judging:
            run = self.window()
            if run is None or not run.links.size:
                return
            mark, first = self.history.mark, self.history.frames[0]
            known = self._certified
            if known is None or known[0] is not first:
                known = self._certified = first, guarantees_of(run, untouched=not frame.versions[0])
            found = self._with_final(mark, verdicts_on(run, claims_of(frame.scenarios[0].name), known[1]))
        until = float(run.t[-1])
        with self._lock:
            if frame.number <= self._former:
                return
            self.verdicts, self._judged_version, self.since = found, frame.versions[0], float(run.t[0])
            self._judged_members = frame.members[0]
            before = self.timeline.judged
            for verdict in found:
                since = float(run.t[0]) if before is None else until
                if verdict.witness is not None and verdict.word == "fails":
                    since = min(max(verdict.witness.time, float(run.t[0])), until)
                self.timeline.judge(verdict.claim.key, until, verdict.style, since, verdict.margin)

    def _with_final(self, mark: object, found: list[ShownVerdict]) -> list[ShownVerdict]:
        """Verdicts on a history with the failures that were final before: thinned, it may not show them any more."""
        known = self._final[1] if self._final[0] == mark else {}
        final = [v for v in found if v.word == "fails" and v.claim.about.lasting]
        known = {v.claim.key: v for v in final} | known
        self._final = mark, known
        return [known.get(v.claim.key, v) for v in found]

    def score(self) -> Score | None:
        """How the challenge stands; None where none is tried."""
        if not self.challenge:
            return None
        experiment = self._clock.experiments[0]
        with self._lock:
            states = self.timeline.states
        return judged(self.challenge, experiment.original, states, list(experiment.log.entries))

    def _challenge(self) -> dict[str, object] | None:
        score = self.score()
        if score is None:
            return None
        challenge = challenge_of(self.challenge)
        return {
            "title": challenge.title, "goal": challenge.goal, "unit": challenge.unit, "reached": score.reached,
            "value": _finite(score.value), "words": score.words, "key": self.challenge.partition("=")[0].strip(),
            "chosen": None if challenge.chosen is None else list(challenge.chosen),
        }  # fmt: skip

    def content(self) -> dict[str, object]:
        """The measurements, the record and the verdicts as JSON data."""
        clock = self._clock
        experiment = clock.experiments[0]
        events = [(t, str(event["kind"])) for t, event in list(experiment.log.entries)]
        with self._lock:
            record = self.timeline.content(events)
            shown = [v for v in self.verdicts if v.word != "not applicable"]
            now = {who: number for number, who in enumerate(clock.frame.members[0])}
            numbered = {number: now[who] for number, who in enumerate(self._judged_members) if who in now}
            claims = [_claim(v, self.timeline.strips[v.claim.key].largest, numbered) for v in shown]
            numbers = [{k: _finite(v) for k, v in each.items()} for each in self.numbers]
        return {
            "kind": "record", "now": experiment.time, "end": float(experiment.scenario.t_end), "record": record,
            "claims": claims, "numbers": numbers, "fault": self.fault, "since": _finite(self.since),
            "measured": _finite(self.measured_at), "changed": float(experiment.changed_at), "ledger": list(LEDGER),
            "few": not clock.running and len(self.history.frames) < 3,
            # The motion since an intervention has not been judged while a run stands still after it.
            "former": bool(claims) and self._judged_version != clock.frame.versions[0],
            "too_many": experiment.scenario.start.n > MOST_CLAIMS and MOST_CLAIMS,
            "reached": _finite(clock.reached), "speed": clock.speed, "playing": clock.playing,
            "challenge": self._challenge(),
            "running": clock.running, "complete": experiment.complete, "failure": clock.frame.failure,
            "shrunk": clock.frame.shrunk,
        }  # fmt: skip


def _claim(verdict: ShownVerdict, largest: float, numbered: Mapping[int, int]) -> dict[str, object]:
    """A verdict as JSON data; its agents have their present numbers, and those that were removed are left out."""
    claim, witness = verdict.claim, verdict.witness
    return {
        "key": claim.key, "source": claim.source, "sentence": set_text(claim.statement), "word": verdict.word,
        "style": verdict.style, "lamp": verdict.lamp, "note": verdict.note, "reason": claim.reason,
        "margin": _finite(verdict.margin), "largest": _finite(largest),
        "time": None if witness is None else _finite(witness.time),
        "agents": [] if witness is None else [numbered[i] for i in map(int, witness.agents) if i in numbered],
        "guarantee": "" if verdict.guarantee is None else verdict.guarantee.statement,
    }  # fmt: skip


def _finite(x: float) -> float | None:
    return float(x) if math.isfinite(x) else None


def _curve(numbers: dict[str, float], name: str) -> float:
    return numbers.get(name, math.nan)


def _moment(frame: Frame) -> tuple[float, tuple[int, ...]]:
    """What distinguishes frames that show another moment: what is done between steps makes new ones of the same."""
    return frame.time, frame.versions


def _numbers(frame: Frame, k: int) -> dict[str, float]:
    """Measurements of one of a frame's runs, with its ledger since the last intervention."""
    state, scenario, last = frame.states[k], frame.scenarios[k], frame.last[k]
    found = dict.fromkeys(LEDGER, math.nan)
    if last is not None:
        found = ledger(_row_after_change(list(frame.rows[k][0]), frame.changed_at[k], last), last)
    energy = _energy(state, scenario, last)
    bodies = scenario.agents
    return measured(state, energy, scenario.space, velocities=bodies.order > 1, masses=bodies.masses) | found


def _row_after_change(rows: list[tuple[float, ...]], changed_at: float, last: tuple[float, ...]) -> tuple[float, ...]:
    """The row from which on the ledger counts: of several at the time of a change the one after it.

    The run may have gone on since the last row of a frame: rows are added meanwhile.
    """
    known = next((k for k in range(len(rows) - 1, -1, -1) if rows[k] is last), -1)
    found = last
    for row in reversed(rows[: known + 1]):
        if row[0] < changed_at:
            break
        found = row
        if row[0] == changed_at:
            break
    return found


def _energy(state: State, scenario: Scenario, last: tuple[float, ...] | None) -> float:
    """Energy of a state: that of the ledger where its last row is of that time, computed where it is of another.

    Not a number where there is no ledger, where a state is refused, and for groups whose pairs are too many.
    """
    if last is None:
        return math.nan
    if last[0] == state.t:
        return last[1]
    if state.n > MOST_EVALUATED:
        return math.nan
    try:
        return total_energy(scenario.law, state, scenario.energy, agents=scenario.agents, space=scenario.space)
    except FlockingError:
        return math.nan
