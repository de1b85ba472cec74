"""The panel of files: saves scenarios, event logs, pictures and films, and shows stored runs."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from flocking.apps.lab.experiment.experiment import Experiment
from flocking.apps.lab.panels.measures import measured
from flocking.apps.lab.scene.filming import Film, picture
from flocking.engine.runs.run import Run
from flocking.errors import FlockingError
from flocking.model.state import State

if TYPE_CHECKING:
    from viser import GuiApi, GuiEvent

NO_RUN = "(none here)"
MOST_RUNS = 200
"""Saved runs that a menu offers; a longer menu is hard to read."""
FILMS = (".mp4", ".gif")


class FilePanel:
    """The part of a page that saves and opens.

    Parameters
    ----------
    gui
        GUI of a viser server.
    page
        The page.
    """

    def __init__(self, gui: GuiApi, page: Any) -> None:
        self._page = page
        self._film: Film | None = None
        self.stored: Run | None = None
        """The stored run that is shown."""
        self.saved: list[Path] = []
        """Files written, the last one last."""
        self.scenario = gui.add_button("Save scenario", icon="device-floppy")
        self.picture = gui.add_button("Save picture", icon="camera")
        self.record = gui.add_button("Record a film", icon="video")
        self.message = gui.add_markdown("")
        with gui.add_folder("Stored run"):
            self.folder = gui.add_dropdown("folder", (NO_RUN,), hint="Runs that 'flocking run --out' stored here.")
            self.elsewhere = gui.add_text("or below it", "", hint="A path below the folder the lab was started with.")
            self.open = gui.add_button("Open", icon="folder-open")
            self.frame = gui.add_slider("frame", 0, 1, 1, 0, visible=False)
            self.back = gui.add_button("Back to the live run", visible=False)
        self.scenario.on_click(lambda event: self._guarded(self.save_scenario, event))
        self.picture.on_click(lambda event: self._guarded(self.save_picture, event))
        self.record.on_click(lambda event: self._guarded(self.toggle_film, event))
        self.open.on_click(
            lambda event: self._guarded(lambda: self.open_run(self.elsewhere.value or self.folder.value), event)
        )
        self.offer()
        self.frame.on_update(lambda _: self.scrub(int(self.frame.value)))
        self.back.on_click(lambda _: self.close_run())

    def offer(self) -> None:
        """List the stored runs that are in the folder now."""
        folder = self._page.folder
        known = sorted(file.parent.name for file in folder.path.glob("*/zarr.json"))
        found = [name for name in known if folder.holds(name)][:MOST_RUNS]
        chosen, names = self.folder.value, tuple(found) or (NO_RUN,)
        if tuple(self.folder.options) != names:
            self.folder.options = names
            self.folder.value = chosen if chosen in names else names[0]

    def _guarded(self, action: Callable[[], None], event: GuiEvent) -> None:
        before = len(self.saved)
        try:
            self._page.count_request()
            action()
        except (FlockingError, OSError) as error:
            self.message.content = f"Not possible: {error}"
            return
        for path in self.saved[before:]:
            self._page.offer()
            if event is not None and event.client is not None:
                event.client.send_file_download(path.name, path.read_bytes())

    def _path(self, suffix: str) -> Path:
        """A new file in the page's folder; its name never comes from the page."""
        name = "".join(c if c.isalnum() or c in "-_" else "-" for c in self._page.experiment.original.name) or "lab"
        stem = f"{name}-{time.strftime('%Y%m%d-%H%M%S')}"
        folder, number = self._page.folder.path, 1
        while True:
            found = folder / (stem if number == 1 else f"{stem}-{number}")
            # Also where a dangling symbolic link is: nothing is written through it.
            if not any(os.path.lexists(f"{found}{end}") for end in {suffix, *(FILMS if not suffix else ())}):
                return Path(f"{found}{suffix}")
            number += 1

    def _show_saved(self, *paths: Path, note: str = "") -> None:
        self.saved += paths
        self.message.content = f"Saved {', '.join(p.name for p in paths)}. {note}".strip()

    def save_scenario(self) -> None:
        """Write the scenario as TOML; after interventions also their log, for replay."""
        from flocking.engine.driver.registry import chosen_engine
        from flocking.study.scenario_files.scenario_file import write_scenario

        experiment: Experiment = self._page.experiment
        usual = chosen_engine(experiment.original, "auto") == experiment.engine
        engine = "" if usual else f" --engine {experiment.engine}"
        faults: list[FlockingError] = []
        paths: list[Path] = []

        def act() -> None:
            try:
                if experiment.untouched:
                    paths.append(write_scenario(experiment.original, self._path(".toml")))
                    return
                paths.append(experiment.log.write(self._path(".events.json")))
                now = experiment.scenario.with_(
                    start=experiment.state, t_end=max(experiment.scenario.t_end, experiment.time + 1.0), frames=201
                )
                paths.append(write_scenario(now, self._path(".toml")))
            except FlockingError as error:
                faults.append(error)

        self._page.clock.do(act)
        if not paths and faults:
            raise faults[0]
        note = f"`flocking run {paths[-1].name}{engine}` gives the same run" if experiment.untouched else (
            f"`flocking lab {paths[0].name}` replays the interventions; the TOML file starts from the present state"
        )  # fmt: skip
        self._show_saved(*paths, note=f"{note}. {faults[0] if faults else ''}")

    def save_picture(self) -> None:
        """Draw the present moment as a picture."""
        frame = self._page.clock.frame
        self._show_saved(picture(frame.states[0], frame.scenarios[0], self._page.scene.look, self._path(".png")))

    def toggle_film(self) -> None:
        """Begin to record, or end and write the film."""
        if self._film is None:
            self._film = Film(self._page.clock)
            self.record.label = "Stop and save the film"
            return
        film, self._film = self._film, None
        self.record.label = "Record a film"
        self.message.content = "Writing the film..."
        self._show_saved(film.write(self._path(""), self._page.scene.look))

    def open_run(self, folder: str) -> None:
        """Open a stored run and show its frames.

        Parameters
        ----------
        folder
            Name given by the page.
        """
        from flocking.engine.storage.stored_runs import read_run

        run = read_run(self._page.folder.path_of(folder))
        self._page.clock.pause()
        self.stored = run
        self.frame.max = max(len(run.t) - 1, 1)
        self.frame.value = 0
        self.frame.visible = self.back.visible = True
        self._page.scene.show_stored([run.state(0)], run.scenario, aim=True)
        self.scrub(0)

    def scrub(self, frame: int) -> None:
        """Show one frame of the stored run."""
        run = self.stored
        if run is None or not len(run.t):
            return
        frame = min(max(frame, 0), len(run.t) - 1)
        self._page.scene.show_stored([_drawable(run, frame)], run.scenario)
        numbers = measured(run.state(frame), _energy_at(run, frame))
        message = ", ".join(f"{name} {value:.4g}" for name, value in numbers.items() if np.isfinite(value))
        self.message.content = f"Stored run {run.scenario.name}: t = {run.t[frame]:.4g}, {run.status}. {message}."

    def close_run(self) -> None:
        """Go back to the live run."""
        self.stored = None
        self.frame.visible = self.back.visible = False
        self.message.content = ""
        self._page.scene.show_live()


def _energy_at(run: Run, frame: int) -> float:
    """Energy of the last row of the ledger up to a frame."""
    row = int(np.searchsorted(run.trace["time"], run.t[frame], side="right")) - 1
    return float(run.trace["energy"][row]) if row >= 0 else float("nan")


def _drawable(run: Run, frame: int) -> State:
    state = run.state(frame)
    if not np.isfinite(state.q).all():
        return run.state(0)
    return state
