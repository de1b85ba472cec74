"""The page: the experiments, their scene and the panels that control them, on one viser server."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path

from flocking.apps.lab.access.confinement import Folder
from flocking.apps.lab.access.guarded_server import Guarded
from flocking.apps.lab.access.request_checks import RateLimit
from flocking.apps.lab.experiment.clock import Clock
from flocking.apps.lab.experiment.events import Event, EventLog
from flocking.apps.lab.experiment.experiment import Experiment, replay
from flocking.apps.lab.panels.banner import Banner
from flocking.apps.lab.panels.choices import first_choice, in_space, is_built_in, library, scenario_of
from flocking.apps.lab.panels.comparison import Comparison
from flocking.apps.lab.panels.controls import Controls
from flocking.apps.lab.panels.display import Display
from flocking.apps.lab.panels.file_panel import FilePanel
from flocking.apps.lab.panels.interventions import Interventions
from flocking.apps.lab.panels.measurement_panel import MeasurementPanel
from flocking.apps.lab.panels.playback import Transport
from flocking.apps.lab.scene.scene import Scene
from flocking.engine.interruption import uninterrupted
from flocking.errors import FlockingError, InvalidInput
from flocking.model.law import Scenario

SECONDS_A_RUN = 40.0
"""Wall seconds of a scenario at the initial speed."""

REQUESTS_PER_SECOND = 1.0
"""Rate limit of requests to open or save a file or to begin a run, each of which may start a computation."""
LONGEST_NOTE = 400
"""Characters of a notification, which covers part of the scene."""
BURST_OF_REQUESTS = 20
"""Such requests that are accepted at once."""


class Page:
    """A running lab.

    Parameters
    ----------
    guarded
        A viser server behind an access check.
    scenario
        What to start with, as in `flocking.apps.lab.server.lab`; an event log is replayed.
    folder
        The only folder in which the page opens and saves files; the working folder when absent.
    """

    def __init__(
        self, guarded: Guarded, scenario: Scenario | str | None = None, folder: str | Path | None = None
    ) -> None:
        self._guarded = guarded
        server = self.server = guarded.server
        self.folder = Folder(Path.cwd() if folder is None else folder)
        self._requests = RateLimit(REQUESTS_PER_SECOND, BURST_OF_REQUESTS)
        self._busy = threading.Lock()
        self._loads = 0
        self._given_file: Path | None = None
        name, experiment = self._first(scenario)
        self.clock = Clock([experiment])
        self.clock.on_error = self.show_error
        self.last_error = ""
        """Message of the last refused request."""
        self.scene = Scene(server, self.clock, self._dragged)
        gui = server.gui
        self._name = name
        names = tuple(dict.fromkeys((name, *library(self.folder))))
        self.banner = Banner(gui, self.clock, self.scene, self.go_back)
        tabs = gui.add_tab_group()
        with tabs.add_tab("Run"):
            self.transport = Transport(gui, self.clock, names, load=self.load, restart=self.restart, lift=self.lift)
            self.measurement_panel = MeasurementPanel(gui, self.clock, self.scene)
        law_tab = tabs.add_tab("Law")
        self.controls = Controls(gui, law_tab, self.send)
        with tabs.add_tab("Act"):
            self.interventions = Interventions(gui, self.clock, self.send)
            self.scene.picked = self._picked
        with tabs.add_tab("Claims"):
            self.measurement_panel.add_verdicts()
        with tabs.add_tab("View"):
            self.display = Display(gui, self.scene)
            self.comparison = Comparison(gui, self)
        with tabs.add_tab("Files"):
            self.file_panel = FilePanel(gui, self)
        self._given = scenario if isinstance(scenario, Scenario) else None
        self._given_name = name
        self._settle()
        self.clock.begin()
        self.scene.begin()
        self.measurement_panel.begin()
        self.clock.post(lambda: None)
        server.on_client_connect(lambda _: self.offer())

    @property
    def experiment(self) -> Experiment:
        """The first experiment."""
        return self.clock.experiments[0]

    @property
    def address(self) -> str:
        """Address of the page, with the token that it opens with."""
        return self._guarded.address

    def __repr__(self) -> str:
        return f"Page({self.address!r})"

    def close(self) -> None:
        """End the page; Ctrl-C waits until it has ended."""
        with uninterrupted():
            self.clock.close()
            self.scene.join()
            self.measurement_panel.join()
            self.server.stop()

    def _first(self, scenario: Scenario | str | None) -> tuple[str, Experiment]:
        if isinstance(scenario, Scenario):
            return scenario.name or "yours", Experiment(scenario)
        name = first_choice() if scenario is None else scenario
        # Named by the user who starts the lab, not by a page: any folder is allowed.
        file = Path(name).absolute()
        self._given_file = None if is_built_in(name) else file
        if name.endswith(".json"):
            return name, replay(EventLog.read(file))
        return name, Experiment(scenario_of(name, file))

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

    def show_error(self, message: str) -> None:
        """Show the ``message`` of a refused request."""
        self.last_error = message
        for client in self.server.get_clients().values():
            client.add_notification("Not possible", message[:LONGEST_NOTE], color="red", auto_close_seconds=10.0)

    def send(self, event: Event, key: object = None, show_message: Callable[[str], None] | None = None) -> None:
        """Apply an event to every experiment between two steps, and show its error in place.

        Parameters
        ----------
        key
            Of events waiting under one key only the last is done.
        show_message
            Called with the error, or an empty text; a notification is shown when absent.
        """

        def act() -> None:
            try:
                for each in self.comparison.targets(event):
                    each.apply(event)
            except FlockingError as error:
                self.last_error = str(error)
                (show_message or self.show_error)(str(error))
                return
            if show_message is not None:
                show_message("")
            if event["kind"] == "kill":
                self.scene.look.highlight = ()  # the remaining agents have other numbers
            if (
                event["kind"] not in ("set", "scale", "move", "kick")
                or str(event.get("path", [""])[-1])[:7] == "formula"
            ):
                self.controls.build(self.experiment.scenario)

        self.clock.post(act, key)

    def _dragged(self, path: tuple[object, ...], point: list[float]) -> None:
        self.send({"kind": "move", "path": list(path), "to": point}, ("move", path))

    def _picked(self, agent: int) -> None:
        """Choose a clicked agent for the next intervention, and highlight it."""
        self.scene.look.highlight = tuple(self.interventions.pick(agent))
        self.scene.repaint()

    def load(self, name: str, seed: int | None = None) -> None:
        """Open another scenario, or the same one with another seed."""
        with self._busy:
            self._loads += 1
            number = self._loads
        try:
            self.count_request()
            self._install(self._opened(name, seed, lambda: number == self._loads and not self.clock.closed))
            self._name = self.transport.scenario.value = name
        except (FlockingError, OSError) as error:
            self.transport.scenario.value = self._name
            self.show_error(str(error))

    def _opened(self, name: str, seed: int | None, proceed: Callable[[], bool]) -> Experiment:
        """The experiment of a name given by the page: in the folder, or what the lab was started with."""
        if self._given is not None and name == self._given_name:
            return Experiment(self._given)
        if name == self._given_name and self._given_file is not None:
            file = self._given_file
        else:
            file = Path(name) if is_built_in(name) else self.folder.inside(name)
        if name.endswith(".json"):
            return replay(EventLog.read(file), proceed)
        return Experiment(scenario_of(name, file, seed))

    def offer(self) -> None:
        """List the files that are in the folder now."""
        self.transport.offer(library(self.folder))
        self.file_panel.offer()

    def lift(self) -> None:
        """Restart the present scenario in three dimensions."""
        try:
            self.count_request()
            self._install(Experiment(in_space(self.experiment.original)))
        except FlockingError as error:
            self.show_error(str(error))

    def _install(self, experiment: Experiment) -> None:
        with self._busy:
            self.clock.pause()
            self.clock.do(lambda: self._swap([experiment]))
            self._settle()

    def _swap(self, experiments: list[Experiment]) -> None:
        self.clock.experiments = experiments
        self.comparison.end()

    def _settle(self) -> None:
        """Fit controls and view to the opened scenario."""
        scenario = self.experiment.scenario
        self.controls.build(scenario)
        self.measurement_panel.reset()
        self.comparison.refresh()
        length = max(scenario.t_end - scenario.start.t, 1e-9)
        self.transport.run_at(length / SECONDS_A_RUN)
        if scenario.seed is not None:
            self.transport.seed.value = scenario.seed
        frame = self.clock.frame
        self.scene.aim(frame)
        self.scene.repaint()

    @staticmethod
    def restarted(experiment: Experiment) -> Experiment:
        """The experiment from its start with the present settings; its own where the group changed."""
        now, first = experiment.scenario, experiment.original
        if now.start.n == first.start.n:
            first = first.with_(law=now.law, agents=now.agents, energy=now.energy)
        return Experiment(first, experiment.engine)

    def restart(self) -> None:
        """Restart with the present settings."""

        def act() -> None:
            self.count_request()
            self.clock.experiments = [self.restarted(each) for each in self.clock.experiments]
            self.measurement_panel.reset()

        self.clock.post(act, "restart")

    def go_back(self) -> None:
        """Return to the saved moment, and pause."""

        def act() -> None:
            self.clock.pause()
            for each in self.clock.experiments:
                each.go_back()
            self.clock.experiments = list(self.clock.experiments)
            self.controls.build(self.experiment.scenario)
            self.measurement_panel.reset()

        self.clock.post(act, "go back")
