"""The clock: one thread that advances experiments in wall time and runs actions between steps."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from flocking.apps.lab.experiment.experiment import Experiment
from flocking.engine.runs.run import SwitchRow
from flocking.errors import FlockingError, InvalidInput, SimulationError
from flocking.model.law import Scenario
from flocking.model.state import State

SHORTEST_SLICE = 1e-6
"""Seconds that a slice counts as having taken at least: clocks resolve a tenth of it, and pace divides by it."""

SMOOTHING = 0.9
"""Weight of the displayed pace before against that of the new slice: it follows a change in some ten slices."""

ACTION_SECONDS = 60.0
"""Wall seconds after which an awaited action counts as failed: a slice ends in a twentieth of one, compilation in a
few."""

CLOSED_LOOK = 0.1
"""Wall seconds between two checks of an awaited action whether the clock was stopped: the lab's end waits for them."""

FRAME_SECONDS = 1 / 60
"""Time between two pictures: the rate of most screens."""
LONGEST_SLICE = 0.05
"""Wall seconds after which all sessions together stop at the end of a step, so that actions do not wait long."""

KEEP_SECONDS = 2.0
"""Seconds between moments that are saved to return to."""

Action = Callable[[], None]


@dataclass(frozen=True, eq=False)
class Frame:
    """One moment of all experiments.

    Parameters
    ----------
    number
        Rises from frame to frame.
    time
        Time of the first experiment.
    states, scenarios
        State and scenario of each.
    rows
        Their ledgers and switches, as `Experiment.records` gives them; they go on growing.
    last
        The last row of each ledger at that moment; None where there is none.
    changed_at, began, versions
        Time of the last change of each, the state right after it, and the number of changes.
    members
        What names the agent of each number, of each experiment: numbers may name others after agents were removed.
    failure
        Why the first that failed stopped; empty when none failed.
    shrunk
        Message that the steps of one have shrunk to nothing; empty when they have not.
    """

    number: int
    time: float
    states: tuple[State, ...]
    scenarios: tuple[Scenario, ...]
    rows: tuple[tuple[list[tuple[float, ...]], list[SwitchRow]], ...]
    last: tuple[tuple[float, ...] | None, ...]
    changed_at: tuple[float, ...]
    began: tuple[State, ...]
    versions: tuple[int, ...]
    members: tuple[tuple[int, ...], ...]
    failure: str
    shrunk: str


class Clock:
    """Advances experiments side by side.

    Parameters
    ----------
    experiments
        The experiments, at the same time.
    speed
        Simulated time per second.
    """

    def __init__(self, experiments: Sequence[Experiment], speed: float = 1.0) -> None:
        self._target: float | None = None
        self.experiments = list(experiments)
        self.speed = speed
        self.playing = False
        self._goal: float | None = None
        self.reached = 0.0
        """Simulated time per second that is really reached while playing."""
        self.on_error: Callable[[str], None] = lambda _: None
        """Called with the message of a refused action."""
        self._wake = threading.Condition()
        self._waiting: dict[object, Action] = {}
        self._looks: list[Action] = []
        self._closed = False
        self._pace = 0.0
        self._frame_ready = threading.Condition()
        self._generation = 0
        self._shown = 0.0
        self.frame = self._look()
        self._thread = threading.Thread(target=self._run, name="flocking-lab-clock", daemon=True)

    @property
    def experiments(self) -> list[Experiment]:
        """The experiments; assigning others, or the same again, clears their target time."""
        return self._experiments

    @experiments.setter
    def experiments(self, experiments: list[Experiment]) -> None:
        self._experiments, self._target = experiments, None

    def begin(self) -> None:
        """Start the thread."""
        self._thread.start()

    def close(self) -> None:
        """Stop the thread and wait for it."""
        with self._wake:
            self._closed = True
            self._wake.notify_all()
        with self._frame_ready:
            self._frame_ready.notify_all()
        if self._thread.is_alive():
            self._thread.join()

    @property
    def closed(self) -> bool:
        """Whether it was stopped."""
        return self._closed

    def post(self, action: Action, key: object = None) -> None:
        """Run an action between two steps, soon. Of those posted with the same key only the last is done.

        Parameters
        ----------
        action
            Called without arguments by the thread of the clock.
        """
        with self._wake:
            self._waiting[object() if key is None else key] = action
            self._wake.notify_all()

    def do(self, action: Action, key: object = None, timeout: float = ACTION_SECONDS) -> None:
        """Run an action between two steps and wait until it is done.

        Parameters
        ----------
        action
            Called without arguments by the thread of the clock.
        key
            Of actions waiting under one key only the last is done.
        timeout
            Seconds to wait at most.

        Raises
        ------
        InvalidInput
            When it was not done in that time, in which case it may be done later, or the clock was stopped before.
        """
        finish, done = _signalled(action)
        self.post(finish, key)
        self._wait_for(done, timeout)

    def _wait_for(self, done: threading.Event, timeout: float) -> None:
        late = time.monotonic() + timeout
        while not done.wait(CLOSED_LOOK):
            if not self._thread.is_alive() and self._closed:
                raise InvalidInput("lab", "order", "needs a lab that is open", "one that was closed")
            if time.monotonic() > late:
                raise InvalidInput(
                    "lab", "order", f"must be reached within {timeout:g} s", "a longer step", "It may be done later."
                )

    def between_steps(self, action: Action) -> None:
        """Run an ``action`` that changes nothing while no session is within a step, and wait until it is done.

        No frame follows from it. Errors are those of `do`.
        """
        if not self._thread.is_alive():
            action()
            return
        finish, done = _signalled(action)
        with self._wake:
            self._looks.append(finish)
            self._wake.notify_all()
        self._wait_for(done, ACTION_SECONDS)

    def play(self) -> None:
        """Let time run."""
        self._set_playing(True)

    def pause(self) -> None:
        """Stop time."""
        self._set_playing(False)

    def _set_playing(self, playing: bool) -> None:
        with self._wake:
            self.playing, self._goal = playing, None
            self._wake.notify_all()

    @property
    def running(self) -> bool:
        """Whether time runs, or a step is being made."""
        return self.playing or self._goal is not None

    def step(self, duration: float) -> None:
        """Stop time, and advance by ``duration`` once; `pause` ends that, too."""

        def aim() -> None:
            self._goal = (self.experiments[0].time if self._goal is None else self._goal) + duration

        with self._wake:
            self.playing = False
        self.post(aim)

    def next_frame(self, after: int, timeout: float | None = None) -> Frame | None:
        """Wait for a frame with a number above ``after``; None when there is none in time, or the clock was stopped.

        Parameters
        ----------
        timeout
            Seconds to wait at most; for ever when absent.
        """
        with self._frame_ready:
            self._frame_ready.wait_for(lambda: self._closed or self.frame.number > after, timeout)
            return None if self._closed or self.frame.number <= after else self.frame

    def _look(self) -> Frame:
        self._generation += 1
        every = self.experiments
        return Frame(
            self._generation, every[0].time, tuple(e.state for e in every), tuple(e.scenario for e in every),
            tuple(e.records() for e in every), tuple(e.last_row for e in every),
            tuple(e.changed_at for e in every), tuple(e.began for e in every), tuple(e.version for e in every),
            tuple(e.members for e in every),
            next((e.failure for e in every if e.failure), ""), next((e.shrunk for e in every if e.shrunk), ""),
        )  # fmt: skip

    def _show(self) -> None:
        self._shown = time.perf_counter()
        frame = self._look()
        with self._frame_ready:
            self.frame = frame
            self._frame_ready.notify_all()

    def _run(self) -> None:
        before = stored_at = time.perf_counter()
        while True:
            with self._wake:
                if not self._awake:
                    self._wake.wait_for(lambda: self._awake)
                    before = time.perf_counter()
                if self._closed:
                    return
                actions, self._waiting = list(self._waiting.values()), {}
                looks, self._looks = self._looks, []
                goal = self._goal
            for action in (*actions, *looks):
                self._try(action)
            if looks and not actions and not self.running and not self._apart:
                continue
            now = time.perf_counter()
            elapsed, before = min(now - before, 4 * FRAME_SECONDS), now
            if self.playing:
                self._advance(self._behind + self.speed * elapsed)
                if now - stored_at > KEEP_SECONDS:
                    stored_at = now
                    for each in self.experiments:
                        each.save_moment()
            elif goal is not None:
                if not self._make_step(goal):
                    continue
            elif self._target is not None and self._apart:
                self._advance(self._target)
            self._show()
            rest = FRAME_SECONDS - (time.perf_counter() - now)
            if rest > 0 and self.playing:
                with self._wake:
                    self._wake.wait(rest)

    def _make_step(self, goal: float) -> bool:
        """Advance towards the end of a step; whether it is done, or a frame is due meanwhile."""
        self._advance(goal)
        moving = [each for each in self.experiments if not each.failure]
        done = len(moving) < len(self.experiments) or all(each.reached(goal) for each in moving)
        with self._wake:
            if done and self._goal == goal:
                self._goal = None
        return done or time.perf_counter() - self._shown > LONGEST_SLICE

    @property
    def _awake(self) -> bool:
        return bool(self.running or self._waiting or self._looks or self._closed or self._apart)

    @property
    def _apart(self) -> bool:
        """Whether one of the compared experiments is still behind another."""
        target, every = self._target, self.experiments
        return target is not None and len(every) > 1 and not all(
            each.reached(target) or each.failure or each.shrunk for each in every
        )  # fmt: skip

    @property
    def _behind(self) -> float:
        """Smallest time of the experiments: the others wait for it."""
        return min((each.time for each in self.experiments if not each.failure), default=self.experiments[0].time)

    def _try(self, action: Action) -> None:
        try:
            action()
        except FlockingError as error:
            self.on_error(str(error))
        except Exception as error:  # a fault in one action must not stop the clock
            self.on_error(f"{type(error).__name__}: {error}")

    def _advance(self, to: float) -> None:
        if len(self.experiments) > 1 and any(each.failure for each in self.experiments):
            # The time that is shown is that of both: neither goes on alone.
            with self._wake:
                self.playing, self._goal, self._target = False, None, None
            return
        begin, since = time.perf_counter(), self._behind
        if self._pace:
            to = min(to, since + self._pace * LONGEST_SLICE)
        self._target = to if self._target is None else max(to, self._target)
        for each in self.experiments:
            try:
                if to > each.time:
                    each.advance(to, LONGEST_SLICE / len(self.experiments))
            except SimulationError as error:
                self.playing = False
                self.on_error(str(error))
        took = max(time.perf_counter() - begin, SHORTEST_SLICE)
        elapsed = self._behind - since
        if elapsed > 0:
            pace = elapsed / took
            # Falls at once after a slow slice, and at most doubles after a quick one.
            self._pace = pace if not self._pace else min(pace, 2 * self._pace)
            self.reached = SMOOTHING * self.reached + (1.0 - SMOOTHING) * min(pace, self.speed)


def _signalled(action: Action) -> tuple[Action, threading.Event]:
    """The ``action``, and an event that is set when it has ended, by an error too."""
    done = threading.Event()

    def finish() -> None:
        try:
            action()
        finally:
            done.set()

    return finish, done
