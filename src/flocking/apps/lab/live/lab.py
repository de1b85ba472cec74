"""The lab: its experiments, what is done to them, and what pages see of them."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from pathlib import Path

from flocking.apps.lab.access.confinement import Folder
from flocking.apps.lab.access.request_checks import RateLimit
from flocking.apps.lab.access.web_server import WebServer
from flocking.apps.lab.experiment.challenges import CHALLENGE
from flocking.apps.lab.experiment.clock import Clock
from flocking.apps.lab.experiment.events import Event
from flocking.apps.lab.experiment.experiment import Experiment
from flocking.apps.lab.experiment.settings import sections
from flocking.apps.lab.live.hub import Hub, Message, Tab
from flocking.apps.lab.live.measuring import Measuring
from flocking.apps.lab.live.messages import REGROUPED, scenario_message, stored_message, values_message
from flocking.apps.lab.live.openings import Openings
from flocking.apps.lab.live.past import Past
from flocking.apps.lab.panels.catalogue import catalogue
from flocking.apps.lab.panels.choices import in_space
from flocking.apps.lab.panels.controls import Controls, law_content
from flocking.apps.lab.panels.saved_files import SavedFiles
from flocking.errors import FlockingError, InvalidInput
from flocking.formula.safe_digits import time_text
from flocking.model.law import Scenario
from flocking.model.parts.structure import Step

SHORTEST_RUN = 1e-9
"""Length that a scenario counts as at least, so that the speed of one that ends at its start is not zero."""

SECONDS_A_RUN = 40.0
"""Wall seconds of a scenario at the initial speed."""

SLOWEST, FASTEST = 0.01, 100.0
"""Bounds of the speed of playback, in units of time per second: a hundredth and a hundred times real time."""

REQUESTS_PER_SECOND = 1.0
"""Rate limit of requests to open or save a file or to begin a run, each of which may start a computation."""
BURST_OF_REQUESTS = 20
"""Such requests that are accepted at once."""
LONGEST_NOTE = 400
"""Characters of a message, which covers part of the scene."""
RECORD_SECONDS = 0.25
"""Least seconds between two times that pages are sent the record of the run."""
QUIET_CHANGES = frozenset({"set", "scale", "move", "kick", "place", "shift"})
"""Events after which the controls of the law stay the same ones."""


class Lab:
    """Experiments that run, and pages that look at them.

    Parameters
    ----------
    server
        The server of its files and connections.
    scenario
        What to start with, as in `flocking.apps.lab.server.lab`; an event log is replayed.
    folder
        The only folder in which the page opens and saves files; the working folder when absent.
    """

    def __init__(
        self, server: WebServer, scenario: Scenario | str | None = None, folder: str | Path | None = None
    ) -> None:
        self.server = server
        self.folder = Folder(Path.cwd() if folder is None else folder)
        self._requests = RateLimit(REQUESTS_PER_SECOND, BURST_OF_REQUESTS)
        self._busy = threading.Lock()
        self._telling = threading.Lock()
        self._loads = 0
        self._openings = Openings(scenario, self.folder)
        self.name = self._openings.first_name
        self.seed: int | None = None
        """The seed that it was opened with; that of a scenario may be another than those of its draws."""
        experiment = self._openings.first()
        self.last_error = ""
        """Message of the last refused request."""
        self.compared: tuple[Step, ...] = ()
        """Path of the number in which two experiments differ; empty when there is one."""
        self._opening = ""
        self._reported = 0.0
        self.clock = Clock([experiment])
        self.clock.on_error = self.show_error
        self.files = SavedFiles(self.folder, self.clock)
        self.measuring = Measuring(self.clock, self._measured)
        self.controls = Controls(lambda: self.experiment.scenario, lambda: self.experiment.state, self.send)
        self.hub = Hub(server, self.clock, self._greet)
        self.past = Past(self.hub, self.clock, self.measuring.timeline, self.folder)
        self._settle()

    @property
    def experiment(self) -> Experiment:
        """The first experiment."""
        return self.clock.experiments[0]

    def count_request(self) -> None:
        """Count a request that opens or saves a file, or begins a run.

        Raises
        ------
        InvalidInput
            When there were too many in a short time.
        """
        if not self._requests.take():
            raise InvalidInput(
                "lab",
                "requests",
                f"must be at most {BURST_OF_REQUESTS} at once, and then one per second",
                "another one",
            )

    # Messages to pages.

    def show_error(self, message: str) -> None:
        """Show the ``message`` of a refused request on every page."""
        self.last_error = message
        self.hub.tell({"kind": "refused", "message": message[:LONGEST_NOTE]})

    def refuse(self, tab: Tab, message: str, more: Message) -> None:
        """Send a page the reason why its order is refused, and the values that hold.

        Parameters
        ----------
        tab
            The page.
        message
            The reason.
        more
            The request.
        """
        self.last_error = message
        tab.tell({"kind": "refused", "message": message[:LONGEST_NOTE], **more})
        tab.tell(values_message(self.experiment))

    def _greet(self, tab: Tab) -> None:
        tab.tell(self._scenario_message())
        # The frame, not the session, which may be in the middle of a step in another thread.
        frame = self.clock.frame
        tab.tell(law_content(frame.scenarios[0], frame.states[0], self.experiment.base))
        with self._telling:
            tab.tell(self.measuring.content())
        if self._opening:
            tab.tell({"kind": "opening", "name": self._opening})
        if self.past.stored is not None:
            tab.tell(stored_message(self.past.stored))

    def _scenario_message(self) -> Message:
        found = scenario_message(self.name, self.experiment, self.clock.speed)
        return {**found, "compared": list(self.compared), "second": self._second(), "folder": str(self.folder.path)}

    def _second(self) -> str:
        """In which number the second of two compared experiments differs, in words; empty when there is one."""
        if not self.compared:
            return ""
        second = self.clock.experiments[1]
        every = (s for section in sections(second.scenario, second.base) for s in section.settings)
        found = next((s for s in every if s.path == self.compared), None)
        return "" if found is None else f"{found.label} = {found.value:.6g}"

    def tell_record(self) -> None:
        """Send all pages the record of the run."""
        self._reported = time.monotonic()
        # Of two threads the one that read first sends first, else pages would keep an older state.
        with self._telling:
            if self.past.stored is None:
                self.hub.tell(self.measuring.content())

    def tell_catalogue(self, tab: Tab) -> None:
        """Send the page of a ``tab`` all scenarios and stored runs."""
        tab.tell({**catalogue(self.folder), "runs": self.files.stored_runs()})

    def _law(self) -> Message:
        """The law of the first experiment, with its controls."""
        return law_content(self.experiment.scenario, self.experiment.state, self.experiment.base)

    def tell_law(self) -> None:
        """Send all pages what is open, and its law."""
        self.hub.tell(self._scenario_message())
        self.hub.tell(self._law())

    def _measured(self) -> None:
        if not self.clock.playing or time.monotonic() - self._reported > RECORD_SECONDS:
            self.tell_record()

    def saved(self, message: str) -> dict[str, object]:
        """What is sent to a page by a ``message`` about files that were saved; all pages get the new list of files."""
        self.hub.tell({**catalogue(self.folder), "runs": self.files.stored_runs()})
        return {"message": message}

    # What is done to the experiments.

    def send(self, event: Event, key: object = None) -> None:
        """Apply an event to every experiment between two steps; errors are shown.

        Parameters
        ----------
        key
            Of events waiting under one key only the last is done.
        """
        self.clock.post(lambda: self._apply(event), key)

    def apply(self, event: Event) -> None:
        """Apply an event, and wait for it.

        Raises
        ------
        InvalidInput
            When it is not possible.
        """
        faults: list[FlockingError] = []

        def act() -> None:
            try:
                self._apply(event)
            except FlockingError as error:
                faults.append(error)

        self.clock.do(act)
        if faults:
            raise faults[0]

    def _apply(self, event: Event) -> None:
        both = self.clock.experiments
        # The number in which two experiments differ is changed in the first alone.
        targets = both[:1] if self.compared and tuple(event.get("path", ())) == self.compared else both
        try:
            # What one of them refuses is done to none.
            for each in targets[1:]:
                each.outcome_of(event)
            for each in targets:
                each.apply(event)
        finally:
            for tab in tuple(self.hub.tabs):
                tab.tell(values_message(self.experiment))
        last = str(event.get("path", [""])[-1])
        if event["kind"] not in QUIET_CHANGES or last == "formula":
            self.tell_law()
        elif any(str(step) == "potential" for step in event.get("path", ())):
            self.hub.tell({**self._law(), "kind": "curves"})

    def load(self, name: str, seed: int | None = None) -> None:
        """Open another scenario, or the same one with another seed.

        Raises
        ------
        InvalidInput, OSError
            When it cannot be opened.
        """
        with self._busy:
            self._loads += 1
            number = self._loads
        self.count_request()
        self._tell_opening(name)
        try:
            found = self._openings.opened(name, seed, lambda: number == self._loads and not self.clock.closed)
            self.name, self.seed = name, seed
            self._install([found], challenge=name.removeprefix(CHALLENGE) if name.startswith(CHALLENGE) else "")
        finally:
            self._tell_opening("")

    def _tell_opening(self, name: str) -> None:
        self._opening = name
        self.hub.tell({"kind": "opening", "name": name})

    def lift(self) -> None:
        """Restart the present scenario in three dimensions.

        Raises
        ------
        InvalidInput
            When it cannot be put in space.
        """
        self.count_request()
        self._install([Experiment(in_space(self.experiment.original))])

    def _install(self, experiments: Sequence[Experiment], compared: tuple[Step, ...] = (), challenge: str = "") -> None:
        """Show other experiments, from their start, and paused."""

        def swap() -> None:
            self.clock.experiments = list(experiments)
            self.compared = compared
            self.measuring.challenge = challenge
            self.past.stored = None
            self.measuring.reset()

        with self._busy:
            self.clock.pause()
            self.clock.do(swap)
            self.past.leave()
            self._settle()

    def _settle(self) -> None:
        """Fit speed and controls to the opened scenario."""
        scenario = self.experiment.scenario
        self.run_at(max(scenario.t_end - scenario.start.t, SHORTEST_RUN) / SECONDS_A_RUN)
        self.tell_law()
        self.hub.tell({"kind": "aim"})
        self.tell_record()

    def run_at(self, speed: float) -> None:
        """Set the simulated time per second, within bounds.

        Parameters
        ----------
        speed
            Time units per second.
        """
        self.clock.speed = min(max(float(f"{speed:.3g}"), SLOWEST), FASTEST)
        self.hub.tell({"kind": "speed", "speed": self.clock.speed})

    @staticmethod
    def restarted(experiment: Experiment) -> Experiment:
        """The experiment from its start with the present settings; as it was opened where the group changed."""
        now, first = experiment.scenario, experiment.original
        if not experiment.regrouped:
            first = first.with_(law=now.law, agents=now.agents, energy=now.energy, information=now.information)
        return Experiment(first, experiment.engine)

    def restart(self) -> None:
        """Restart with the present settings; a run that plays goes on playing."""
        self.count_request()

        def act() -> None:
            changed = any(each.regrouped for each in self.clock.experiments)
            self.clock.experiments = [self.restarted(each) for each in self.clock.experiments]
            self.measuring.reset()
            self.tell_law()
            if changed:
                self.hub.tell(REGROUPED)

        self.clock.post(act, "restart")

    def go_back(self) -> None:
        """Return to the saved moment, and pause."""

        def act() -> None:
            self.clock.pause()
            for each in self.clock.experiments:
                each.go_back()
            self.clock.experiments = list(self.clock.experiments)
            self.measuring.go_on_from(self.experiment.time)
            self.tell_law()

        self.clock.post(act, "go back")

    def branch(self, t: float) -> None:
        """Go on from an earlier time, which the run had reached; what came after it is removed.

        Parameters
        ----------
        t
            The time.

        Raises
        ------
        InvalidInput
            When the run was not there, or its log is not complete.
        """
        self.count_request()
        self.clock.pause()
        self.clock.do(lambda: None)
        first = self.experiment.original
        self._tell_opening(f"t = {time_text(t, first.start.t, max(first.t_end, t))}")
        try:
            both = [each.branch(t, lambda: not self.clock.closed) for each in self.clock.experiments]
        finally:
            self._tell_opening("")

        def act() -> None:
            self.clock.experiments = both
            self.measuring.go_on_from(t)

        self.clock.do(act)
        self.past.leave()
        self.tell_law()

    def compare(self, path: Sequence[Step], value: float) -> None:
        """Restart the present scenario beside a second one that differs in one number.

        Parameters
        ----------
        path
            Where the number is.
        value
            The number of the second.

        Raises
        ------
        InvalidInput
            When the second cannot have that number.
        """
        self.count_request()
        changed, left = self.experiment.regrouped, self.restarted(self.experiment)
        right = Experiment(left.original, left.engine)
        right.apply({"kind": "set", "path": list(path), "value": value})
        self._install([left, right], tuple(path))
        if changed:
            self.hub.tell(REGROUPED)

    def close_run(self) -> None:
        """Go back from a stored run to the live one."""
        self.past.close_run()
        self.tell_law()
        self.hub.tell({"kind": "aim"})
        self.tell_record()

    def only_one(self) -> None:
        """Continue with the first experiment alone."""

        def act() -> None:
            self.clock.experiments = self.clock.experiments[:1]
            self.compared = ()

        self.clock.do(act)
        self.tell_law()
        self.hub.tell({"kind": "aim"})
