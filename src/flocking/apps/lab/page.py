"""The page: the experiments, their scene and all that steers them, on one viser server."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

from flocking.apps.lab.banner import Banner
from flocking.apps.lab.choices import first_choice, in_space, library, scenario_of
from flocking.apps.lab.clock import Clock
from flocking.apps.lab.comparison import Comparison
from flocking.apps.lab.controls import Controls
from flocking.apps.lab.display import Display
from flocking.apps.lab.events import Event, EventLog
from flocking.apps.lab.experiment import Experiment, replay
from flocking.apps.lab.handling import Handling
from flocking.apps.lab.instruments import Instruments
from flocking.apps.lab.keeping import Keeping
from flocking.apps.lab.scene import Scene
from flocking.apps.lab.transport import Transport
from flocking.errors import FlockingError
from flocking.model.law import Scenario

SECONDS_A_RUN = 40.0
"""A scenario is played so fast that it takes about this long."""


class Page:
    """A lab that runs.

    Parameters
    ----------
    server
        A viser server.
    scenario
        What to start with, as in `flocking.apps.lab.server.lab`; an event log is replayed.
    folder
        Where the page saves to, and finds the user's scenario files; the working folder when absent.
    """

    def __init__(self, server: Any, scenario: Scenario | str | None = None, folder: str | Path | None = None) -> None:
        self.server = server
        self.folder = Path.cwd() if folder is None else Path(folder)
        self._busy = threading.Lock()
        name, experiment = self._first(scenario)
        self.clock = Clock([experiment])
        self.clock.complaint = self.complain
        self.trouble = ""
        """The last thing that was refused."""
        self.scene = Scene(server, self.clock, self._dragged)
        gui = server.gui
        self._name = name
        names = tuple(dict.fromkeys((name, *library(self.folder))))
        self.banner = Banner(gui, self.clock, self.scene, self.go_back)
        tabs = gui.add_tab_group()
        with tabs.add_tab("Run"):
            self.transport = Transport(gui, self.clock, names, load=self.load, restart=self.restart, lift=self.lift)
            self.instruments = Instruments(gui, self.clock, self.scene)
        law_tab = tabs.add_tab("Law")
        self.controls = Controls(gui, law_tab, self.send)
        with tabs.add_tab("Act"):
            self.handling = Handling(gui, self.clock, self.send)
            self.scene.picked = self._picked
        with tabs.add_tab("Claims"):
            self.instruments.add_lamps()
        with tabs.add_tab("View"):
            self.display = Display(gui, self.scene)
            self.comparison = Comparison(gui, self)
        with tabs.add_tab("Keep"):
            self.keeping = Keeping(gui, self)
        self._given = scenario if isinstance(scenario, Scenario) else None
        self._given_name = name
        self._settle()
        self.clock.begin()
        self.scene.begin()
        self.instruments.begin()
        self.clock.post(lambda: None)
        server.on_client_connect(lambda _: self.offer())

    @property
    def experiment(self) -> Experiment:
        """The first experiment."""
        return self.clock.experiments[0]

    @property
    def address(self) -> str:
        """Address of the page."""
        return f"http://{self.server.get_host()}:{self.server.get_port()}"

    def close(self) -> None:
        """End the page."""
        self.clock.close()
        self.scene.join()
        self.instruments.join()
        self.server.stop()

    def _first(self, scenario: Scenario | str | None) -> tuple[str, Experiment]:
        if isinstance(scenario, Scenario):
            return scenario.name or "yours", Experiment(scenario)
        name = first_choice() if scenario is None else scenario
        if name.endswith(".json"):
            return name, replay(EventLog.read(name))
        return name, Experiment(scenario_of(name, self.folder))

    def complain(self, message: str) -> None:
        """Say what was refused.

        Parameters
        ----------
        message
            What to say.
        """
        self.trouble = message
        for client in self.server.get_clients().values():
            client.add_notification("Not possible", message[:400], color="red", auto_close_seconds=10.0)

    def send(self, event: Event, key: object = None, tell: Callable[[str], None] | None = None) -> None:
        """Do an event to every experiment between two steps, and say in place what is wrong with it.

        Parameters
        ----------
        key
            Of events waiting under one key only the last is done.
        tell
            Told what is wrong, or an empty text; a notification when absent.
        """

        def act() -> None:
            try:
                for each in self.comparison.meant(event):
                    each.apply(event)
            except FlockingError as error:
                self.trouble = str(error)
                (tell or self.complain)(str(error))
                return
            if tell is not None:
                tell("")
            if event["kind"] == "kill":
                self.scene.look.highlight = ()  # those who stay have other numbers
            if (
                event["kind"] not in ("set", "scale", "move", "kick")
                or str(event.get("path", [""])[-1])[:7] == "formula"
            ):
                self.controls.build(self.experiment.scenario)

        self.clock.post(act, key)

    def _dragged(self, path: tuple[Any, ...], point: list[float]) -> None:
        self.send({"kind": "move", "path": list(path), "to": point}, ("move", path))

    def _picked(self, agent: int) -> None:
        """An agent was clicked: it is chosen for what is done next, and seen to be."""
        self.scene.look.highlight = tuple(self.handling.pick(agent))
        self.scene.repaint()

    def load(self, name: str, seed: int | None = None) -> None:
        """Open another scenario, or the same one with another seed."""
        try:
            if self._given is not None and name == self._given_name:
                self._install(Experiment(self._given))
            elif name.endswith(".json"):
                self._install(replay(EventLog.read(self.folder / name)))
            else:
                self._install(Experiment(scenario_of(name, self.folder, seed)))
            self._name = self.transport.scenario.value = name
        except (FlockingError, OSError) as error:
            self.transport.scenario.value = self._name
            self.complain(str(error))

    def offer(self) -> None:
        """Offer the files that are in the folder now."""
        self.transport.offer(library(self.folder))
        self.keeping.offer()

    def lift(self) -> None:
        """Start the present scenario anew in three dimensions."""
        try:
            self._install(Experiment(in_space(self.experiment.original)))
        except FlockingError as error:
            self.complain(str(error))

    def _install(self, experiment: Experiment) -> None:
        with self._busy:
            self.clock.pause()
            self.clock.do(lambda: self._swap([experiment]))
            self._settle()

    def _swap(self, experiments: list[Experiment]) -> None:
        self.clock.experiments = experiments
        self.comparison.end()

    def _settle(self) -> None:
        """Make controls and view fit the scenario that was opened."""
        scenario = self.experiment.scenario
        self.controls.build(scenario)
        self.instruments.reset()
        self.comparison.refresh()
        length = max(scenario.t_end - scenario.start.t, 1e-9)
        self.transport.run_at(length / SECONDS_A_RUN)
        if scenario.seed is not None:
            self.transport.seed.value = scenario.seed
        frame = self.clock.frame
        self.scene.aim(frame)
        self.scene.repaint()

    @staticmethod
    def anew(experiment: Experiment) -> Experiment:
        """The experiment from its start with the present settings; with its own where agents came or went."""
        now, first = experiment.scenario, experiment.original
        if now.start.n == first.start.n:
            first = first.with_(law=now.law, agents=now.agents, energy=now.energy)
        return Experiment(first, experiment.engine)

    def restart(self) -> None:
        """Start anew with the present settings."""

        def act() -> None:
            self.clock.experiments = [self.anew(each) for each in self.clock.experiments]
            self.instruments.reset()

        self.clock.post(act, "restart")

    def go_back(self) -> None:
        """Return to the last good moment."""

        def act() -> None:
            for each in self.clock.experiments:
                each.go_back()
            self.controls.build(self.experiment.scenario)
            self.instruments.reset()

        self.clock.post(act, "go back")
