"""An experiment: a session, the log of its changes, and saved moments to return to."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable

from flocking.apps.lab.experiment.events import Event, EventLog, Outcome, outcome
from flocking.engine.driver.registry import check_name, chosen_engine, engine_named
from flocking.engine.driver.waits import stage
from flocking.engine.protocol.session import Session
from flocking.engine.runs.run import SwitchRow
from flocking.errors import InvalidInput, SimulationError
from flocking.formula.safe_digits import given_text
from flocking.model.law import Scenario
from flocking.model.state import State
from flocking.model.world.information import Delayed

Moment = tuple[Callable[[], Session], Scenario, int, float, tuple[int, ...]]
"""Restores a session; the scenario that factors multiply then, the number of events before, the time and the agents."""

MOST_MOMENTS = 32
"""Moments that are kept to begin from again; when there are more, every second of the older ones goes."""
MOST_MOMENT_NUMBERS = 4e6
"""Positions, velocities and entries of link matrices that moments hold together, a bound on memory: about 100 MB with
what engines keep beside them."""

MOST_EVENTS = 100_000
"""Longest log, a bound on memory; an experiment with more interventions cannot be replayed."""

MOST_ROWS = 5_000
"""Rows of the ledger and switches that are stored, a bound on memory."""

REPLAY_SECONDS = 0.25
"""Wall time between two checks whether a replay was cancelled."""


class Experiment:
    """A running scenario, changed by events at step boundaries, all of which are logged.

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
        """Return to the start and clear the log."""
        self.base = self.original
        self.session, self.engine = opened(self.original, self._requested_engine)
        self.log = EventLog(self.original, self.engine, end=self.session.time)
        self.failure = ""
        self.changed_at = self.session.time
        """Time of the last event, of the start, or from which the run went on anew."""
        self.began = self.session.state
        """The state right after that."""
        self.version = 0
        """Rises with every event that changes the scenario."""
        self.complete = True
        """Whether the log holds all events."""
        self.members = tuple(range(self.original.start.n))
        """What names the agent of each number: its number at the start, negative of an agent that was added."""
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
    def regrouped(self) -> bool:
        """Whether agents were removed or added since the start, so that numbers may name others."""
        return self.members != tuple(range(self.original.start.n))

    @property
    def untouched(self) -> bool:
        """Whether there was no event since the start."""
        return self.complete and not self.log.entries

    @property
    def shrunk(self) -> str:
        """Message that steps have shrunk so much that the run nearly stops; empty where they have not."""
        return "" if self.session.shrunk is None else str(self.session.shrunk)

    def reached(self, to: float) -> bool:
        """Whether time ``to`` is reached."""
        return self.session.reached(to)

    def advance(self, to: float, seconds: float = math.inf) -> None:
        """Advance to ``to``, or for ``seconds``. After a failure it does nothing until `go_back` or `restart`.

        Parameters
        ----------
        to
            Time to reach.
        seconds
            Wall time after which it stops at the end of a step, before ``to``.

        Raises
        ------
        SimulationError
            When the run fails; `failure` holds the message.
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

    def outcome_of(self, event: Event) -> Outcome:
        """The effect that an event would have now; nothing is changed.

        Raises
        ------
        InvalidInput
            When the event is not possible.
        """
        if self.failure:
            raise InvalidInput(
                "lab", "event", "needs a run that has not failed", event.get("kind"), "Go back or restart."
            )
        return outcome(event, self.scenario, self.base, self.state)

    def apply(self, event: Event) -> None:
        """Apply an event now, and log it.

        Raises
        ------
        InvalidInput
            When the event is not possible; the experiment is then unchanged.
        """
        found = self.outcome_of(event)
        present, state, exact_time = self.scenario, self.state, self.session.time_is_exact
        now = found.scenario
        late = isinstance(present.information, Delayed) and now.information is not present.information
        if found.new_session or late or now.energy is not present.energy or now.agents is not present.agents:
            # Agents, masses, delays and the energy's frame are fixed for a session.
            if not found.new_session:
                now = now.with_(start=state, t_end=max(now.t_end, self.time), frames=1)
            self.session, _ = opened(now, self.engine)
        else:
            law = found.scenario.law if found.scenario.law is not present.law else None
            if found.scenario.control is not present.control:
                raise InvalidInput("lab", "control", "stays as it is while a run goes on", found.scenario.control)
            if law is not None or found.state is not None:
                self.session.replace(law=law, state=found.state)
            if found.scenario.information is not present.information:
                self.session.replace_information(found.scenario.information)
        self.base = found.base
        self.members = _members_after(event, self.members, -1 - self.version)
        self.changed_at, self.began = self.time, self.state
        self.version += 1
        self.complete = self.complete and exact_time and len(self.log.entries) < MOST_EVENTS
        if self.complete:
            self.log.entries.append((self.time, event))

    def save_moment(self) -> None:
        """Save this moment for `go_back` and `branch`, unless the run failed or its steps shrink."""
        if self.failure or not self.session.steady:
            return
        self._moments = [*self._moments, self._moment()]
        state = self.state
        size = 4 * state.q.size + (state.n**2 if state.links is not None else 0)
        if len(self._moments) > min(MOST_MOMENTS, max(2, MOST_MOMENT_NUMBERS // size)):
            # The last two stay: `go_back` returns to the older of them.
            self._moments = [*self._moments[:-2:2], *self._moments[-2:]]
            if size > MOST_MOMENT_NUMBERS / 4:
                self._moments = self._moments[-2:]

    def _moment(self) -> Moment:
        return self.session.moment(), self.base, len(self.log.entries), self.time, self.members

    def go_back(self) -> None:
        """Return to the older saved moment, or the start; later events are removed from the log."""
        back, self.base, events, time, self.members = self._moments[-2:][0] if self._moments else self._begin
        self._moments = self._moments[:-1] if len(self._moments) > 1 else self._moments
        self.session = back()
        self._forget_after(time)
        del self.log.entries[events:]
        self.log.end = self.changed_at = time
        self.began = self.state
        self.failure = ""
        self.version += 1

    def _forget_after(self, time: float) -> None:
        """Drop records that lie after a time."""
        trace, switches = self.records()
        trace[:] = [row for row in trace if row[0] <= time]
        switches[:] = [row for row in switches if row[0] <= time]

    def branch(self, to: float, proceed: Callable[[], bool] = lambda: True) -> Experiment:
        """Another experiment in the state that this one had at time ``to``, bit for bit; this one stays as it is.

        It is computed from the last saved moment before, with the events since.

        Parameters
        ----------
        to
            A time between the start and now.
        proceed
            Called every `REPLAY_SECONDS`; returns false to cancel.

        Raises
        ------
        InvalidInput
            When the time lies outside, the log is not complete, or the computation is cancelled.
        SimulationError
            When the run fails before.
        """
        start = self._begin[3]
        if not start <= to <= self.time:
            raise InvalidInput("lab", "time", f"must lie between {given_text(start)} and {given_text(self.time)}", to)
        if not self.complete:
            raise InvalidInput("lab", "time", "can be chosen only where the log holds all events", to)
        moments = [m for m in (self._begin, *self._moments) if m[3] <= to]
        back, base, events, _, members = moments[-1]
        found = copy.copy(self)
        found.session, found.base, found.members, found.failure = back(), base, members, ""
        found.log = EventLog(self.original, self.engine, self.log.entries[:events], found.session.time)
        found._moments = moments[1:]
        found._forget_after(found.session.time)
        for time, event in [entry for entry in self.log.entries[events:] if entry[0] <= to]:
            _advance_to(found, time, proceed)
            found.apply(event)
        _advance_to(found, to, proceed)
        # What was computed again from the last moment was not looked at.
        found.changed_at, found.began = found.time, found.state
        found.version = self.version + 1
        return found

    def records(self) -> tuple[list[tuple[float, ...]], list[SwitchRow]]:
        """The last rows of the ledger and the last switches; engines that locate none record none."""
        return self.session.records.trace, self.session.records.switches

    @property
    def last_row(self) -> tuple[float, ...] | None:
        """The last row of the ledger; None where there is none."""
        rows = self.records()[0]
        return rows[-1] if rows else None

    def _forget(self) -> None:
        """Drop old records."""
        for rows in self.records():
            if len(rows) > 2 * MOST_ROWS:
                del rows[:-MOST_ROWS]


def _members_after(event: Event, members: tuple[int, ...], added: int) -> tuple[int, ...]:
    """What names the agent of each number after an event that was done, which may have ``added`` one."""
    if event["kind"] == "kill":
        gone = set(map(int, event["agents"]))
        return tuple(who for number, who in enumerate(members) if number not in gone)
    return (*members, added) if event["kind"] == "add" else members


def opened(scenario: Scenario, engine: str) -> tuple[Session, str]:
    """A session that stores no frames, and the name of its engine.

    Raises
    ------
    InvalidInput, UnsupportedLaw
        When the scenario cannot be started, or not by that engine.
    """
    found = engine_named(chosen_engine(scenario, check_name("lab", engine), interactive=True))
    return found.open_unrecorded(scenario), found.name


def replay(log: EventLog, proceed: Callable[[], bool] = lambda: True) -> Experiment:
    """Repeat the events of a log at their times: the same trajectory, bit for bit.

    Parameters
    ----------
    log
        The log.
    proceed
        Called every `REPLAY_SECONDS`; returns false to cancel.

    Raises
    ------
    InvalidInput
        When an event does not fit, or the replay is cancelled.
    SimulationError
        When the run fails, as it did then.
    """
    found = Experiment(log.scenario, log.engine)
    for time, event in log.entries:
        _advance_to(found, time, proceed)
        found.apply(event)
    if math.isfinite(log.end):
        _advance_to(found, log.end, proceed)
    return found


def _advance_to(experiment: Experiment, to: float, proceed: Callable[[], bool]) -> None:
    """Advance an experiment in pieces, between which it can be cancelled."""
    while not experiment.reached(to):
        if not proceed():
            raise InvalidInput("lab", "replay", "was cancelled", f"t = {given_text(experiment.time)}")
        stage(f"replaying a log, t = {given_text(experiment.time)} of {given_text(to)}")
        experiment.advance(to, REPLAY_SECONDS)
