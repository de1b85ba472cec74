"""An experiment: a session, what was done to it, and the way back. It knows no page; a page is one of its users."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from flocking.apps.lab.experiment.events import Event, EventLog, outcome
from flocking.engine.driver.simulate import before
from flocking.engine.driver.simulate import start as start_session
from flocking.errors import InvalidInput, SimulationError, UnsupportedLaw
from flocking.model.law import Scenario
from flocking.model.state import State

MOST_EXACT = 300
"""Larger groups run under the tiled engine, where it can run their law."""

MOST_EVENTS = 100_000
"""Longest log; an experiment with more interventions can no longer be replayed, and says so."""

MOST_ROWS = 5_000
"""Rows of the ledger and switches kept."""

REPLAY_SECONDS = 0.25
"""Wall time between two looks at whether a replay is still wanted."""


class Experiment:
    """A scenario under way, changed by events that fall on step boundaries and are all put on record.

    Parameters
    ----------
    scenario
        What to start.
    engine
        ``"exact"``, ``"tiles"``, or ``"auto"``: exact for up to 300 agents.

    Raises
    ------
    InvalidInput
        When the scenario cannot be started.
    """

    def __init__(self, scenario: Scenario, engine: str = "auto") -> None:
        self.original = scenario
        self._requested_engine = engine
        self.restart()

    def restart(self) -> None:
        """Go back to the start; what was done is forgotten."""
        self.base = self.original
        self.session, self.engine = opened(self.original, self._requested_engine)
        self.log = EventLog(self.original, self.engine, end=self.session.time)
        self.failure = ""
        self.changed_at = self.session.time
        """Time of the last event, or of the start."""
        self.version = 0
        """Rises with every event that changes the scenario."""
        self.complete = True
        """Whether the log holds everything that was done."""
        self._kept: list[tuple[Any, Scenario, int, float]] = []
        self._begin = self._moment()

    @property
    def scenario(self) -> Scenario:
        """The scenario as it is now."""
        found: Scenario = self.session.scenario
        return found

    @property
    def time(self) -> float:
        """Time of the session."""
        return float(self.session.time)

    @property
    def state(self) -> State:
        """State of the session."""
        found: State = self.session.state
        return found

    @property
    def untouched(self) -> bool:
        """Whether nothing was done since the start."""
        return self.complete and not self.log.entries

    @property
    def shrunk(self) -> str:
        """That steps have shrunk so much that the run hardly goes on, and whose; empty where they have not."""
        return "" if self.session.shrunk is None else str(self.session.shrunk)

    def reached(self, to: float) -> bool:
        """Whether time ``to`` is reached."""
        return not before(self.session, to)

    def advance(self, to: float, seconds: float = math.inf) -> None:
        """Go on until ``to``, or for ``seconds``. After a failure nothing moves until `go_back` or `restart`.

        Parameters
        ----------
        to
            Time to reach.
        seconds
            Wall time after which it stops at the end of a step, before ``to``.

        Raises
        ------
        SimulationError
            When the run cannot go on; `failure` says why, too.
        """
        if self.failure:
            return
        try:
            self.session.advance(to, seconds)
        except SimulationError as error:
            self.failure = str(error)
            raise
        finally:
            self._forget()
        self.log.end = self.time

    def apply(self, event: Event) -> None:
        """Intervene now, and put it on record.

        Raises
        ------
        InvalidInput
            When the event is not possible; the experiment then goes on as before.
        """
        if self.failure:
            raise InvalidInput("lab", "event", "needs a run that goes on", event.get("kind"), "Go back or restart.")
        present, state, exact_time = self.scenario, self.state, self.session.time_is_exact
        found = outcome(event, present, self.base, state)
        if found.anew or found.scenario.energy is not present.energy or found.scenario.agents is not present.agents:
            # Agents, masses and the energy's frame are fixed for a session.
            now = found.scenario
            if not found.anew:
                now = now.with_(start=state, t_end=max(now.t_end, self.time), frames=1)
            self.session, _ = opened(now, self.engine)
        elif found.scenario.law is not present.law or found.state is not None:
            law = found.scenario.law if found.scenario.law is not present.law else None
            self.session.replace(law=law, state=found.state)
        self.base = found.base
        self.changed_at = self.time
        self.version += 1
        self.complete = self.complete and exact_time and len(self.log.entries) < MOST_EVENTS
        if self.complete:
            self.log.entries.append((self.time, event))

    def keep(self) -> None:
        """Remember this moment, if it is a good one: `go_back` returns to the last but one kept, or the only one.

        It is none where the run cannot go on, or its steps are shrinking.
        """
        if self.failure or not self.session.steady:
            return
        self._kept = [*self._kept[-1:], self._moment()]

    def _moment(self) -> tuple[Any, Scenario, int, float]:
        snapshot = self.session.snapshot(records=False) if self.engine == "exact" else self.session.snapshot()
        return snapshot, self.base, len(self.log.entries), self.time

    def go_back(self) -> None:
        """Return to the last good moment, or the start; what was done after it is off the record."""
        snapshot, self.base, events, time = self._kept[0] if self._kept else self._begin
        self._kept = self._kept[:1]
        self.session = type(self.session).resume(snapshot)
        records = self._records()
        for rows in (records.trace, getattr(records, "switches", [])):
            rows[:] = [row for row in rows if row[0] <= time]
        del self.log.entries[events:]
        self.log.end = self.changed_at = time
        self.failure = ""
        self.version += 1

    def _records(self) -> Any:
        return self.session.recorder if self.engine == "exact" else self.session.records

    def records(self) -> tuple[list[tuple[float, ...]], list[tuple[Any, ...]]]:
        """The last rows of the ledger and the last switches; the tiled engine records no switches."""
        records = self._records()
        return records.trace, getattr(records, "switches", [])

    def _forget(self) -> None:
        """Keep what is recorded bounded, however long this goes on."""
        for rows in self.records():
            if len(rows) > 2 * MOST_ROWS:
                del rows[:-MOST_ROWS]


def opened(scenario: Scenario, engine: str) -> tuple[Any, str]:
    """A session that keeps no frames, and the name of its engine.

    Raises
    ------
    InvalidInput, UnsupportedLaw
        When the scenario cannot be started, or not by that engine.
    """
    if engine == "tiles" or (engine == "auto" and scenario.start.n > MOST_EXACT):
        try:
            return start_session(scenario, "tiles", keep_frames=False), "tiles"
        except UnsupportedLaw:
            if engine == "tiles":
                raise
    # Frames do not move the steps of the exact engine, but they would fill the memory.
    return start_session(scenario.with_(frames=1), "exact"), "exact"


def replay(log: EventLog, goes_on: Callable[[], bool] = lambda: True) -> Experiment:
    """Do everything in a log again, each at its time: the same trajectory, bit for bit.

    Parameters
    ----------
    log
        What was done.
    goes_on
        Asked now and then whether to go on.

    Raises
    ------
    InvalidInput
        When an event does not fit, or the replay is no longer wanted.
    SimulationError
        When the run cannot go on, as it could not then.
    """
    found = Experiment(log.scenario, log.engine)

    def go_on(to: float) -> None:
        while not found.reached(to):
            if not goes_on():
                raise InvalidInput("lab", "replay", "was given up for something else", f"t = {found.time:.6g}")
            found.advance(to, REPLAY_SECONDS)

    for time, event in log.entries:
        go_on(time)
        found.apply(event)
    if math.isfinite(log.end):
        go_on(log.end)
    return found
