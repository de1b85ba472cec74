"""An experiment: a session, what was done to it, and the way back. It knows no page; a page is one of its users."""

from __future__ import annotations

import math
from collections.abc import Callable

from flocking.apps.lab.experiment.events import Event, EventLog, outcome
from flocking.engine.driver.registry import check_name, chosen_engine, engine_named
from flocking.engine.protocol.session import Session
from flocking.engine.runs.run import SwitchRow
from flocking.errors import InvalidInput, SimulationError, UnsupportedLaw
from flocking.model.law import Scenario
from flocking.model.state import State

Moment = tuple[Callable[[], Session], Scenario, int, float]
"""The way back to a session, what factors multiply then, how many events were before, and the time."""

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
        Name of an engine, or ``"auto"``: the exact one for up to 300 agents, the tiled one beyond.

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
        self._moments: list[Moment] = []
        self._begin = self._moment()

    @property
    def scenario(self) -> Scenario:
        """The scenario as it is now."""
        return self.session.scenario

    @property
    def time(self) -> float:
        """Time of the session."""
        return self.session.time

    @property
    def state(self) -> State:
        """State of the session."""
        return self.session.state

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
        return self.session.reached(to)

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
        self._moments = [*self._moments[-1:], self._moment()]

    def _moment(self) -> Moment:
        return self.session.moment(), self.base, len(self.log.entries), self.time

    def go_back(self) -> None:
        """Return to the last good moment, or the start; what was done after it is off the record."""
        back, self.base, events, time = self._moments[0] if self._moments else self._begin
        self._moments = self._moments[:1]
        self.session = back()
        trace, switches = self.records()
        trace[:] = [row for row in trace if row[0] <= time]
        switches[:] = [row for row in switches if row[0] <= time]
        del self.log.entries[events:]
        self.log.end = self.changed_at = time
        self.failure = ""
        self.version += 1

    def records(self) -> tuple[list[tuple[float, ...]], list[SwitchRow]]:
        """The last rows of the ledger and the last switches; engines that locate none record none."""
        return self.session.records.trace, self.session.records.switches

    def _forget(self) -> None:
        """Keep what is recorded bounded, however long this goes on."""
        for rows in self.records():
            if len(rows) > 2 * MOST_ROWS:
                del rows[:-MOST_ROWS]


def opened(scenario: Scenario, engine: str) -> tuple[Session, str]:
    """A session that keeps no frames, and the name of its engine.

    Raises
    ------
    InvalidInput, UnsupportedLaw
        When the scenario cannot be started, or not by that engine, and when its space repeats.
    """
    if not scenario.space.is_open:
        name = type(scenario.space).__name__
        raise UnsupportedLaw(f"The lab shows open space alone, not {name}. Use fk.simulate and fk.plot.")
    found = engine_named(chosen_engine(scenario, check_name("lab", engine), interactive=True))
    return found.open_unrecorded(scenario), found.name


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
