"""What a page saves into its folder: scenarios, event logs, pictures and films."""

from __future__ import annotations

import base64
import binascii
import os
import time
from pathlib import Path

from flocking.apps.lab.access.confinement import Folder
from flocking.apps.lab.experiment.challenges import Score
from flocking.apps.lab.experiment.clock import Clock
from flocking.apps.lab.experiment.experiment import Experiment
from flocking.apps.lab.scene.filming import Film, Look
from flocking.errors import FlockingError, InvalidInput

MOST_RUNS = 200
"""Saved runs that a menu offers; a longer menu is hard to read."""
FILMS = (".mp4", ".gif")
PNG = b"\x89PNG\r\n\x1a\n"
"""First bytes of a picture."""

REBUILT = "Obstacles or leaders were changed meanwhile: they are drawn as they were at the end."
BEGUN_ANEW = "It begins where agents were removed or added, or another run began."
"""Notes about films that do not show all as it was, or not all that was recorded."""


class SavedFiles:
    """Writes files of an experiment; their names never come from a page.

    Parameters
    ----------
    folder
        Where they go.
    clock
        The clock of the experiment.
    """

    def __init__(self, folder: Folder, clock: Clock) -> None:
        self._folder, self._clock = folder, clock
        self._film: Film | None = None
        self.saved: list[Path] = []
        """Files written, the last one last."""

    @property
    def recording(self) -> bool:
        """Whether a film is recorded."""
        return self._film is not None

    def stored_runs(self) -> list[str]:
        """Names of the stored runs that are in the folder now."""
        known = sorted(file.parent.name for file in self._folder.path.glob("*/zarr.json"))
        return [name for name in known if self._folder.holds(name)][:MOST_RUNS]

    def _path(self, suffix: str) -> Path:
        """A new file in the folder."""
        title = self._clock.experiments[0].original.name
        name = "".join(c if c.isalnum() or c in "-_" else "-" for c in title) or "lab"
        stem = f"{name}-{time.strftime('%Y%m%d-%H%M%S')}"
        number = 1
        while True:
            found = self._folder.path / (stem if number == 1 else f"{stem}-{number}")
            # Also where a dangling symbolic link is: nothing is written through it.
            if not any(os.path.lexists(f"{found}{end}") for end in {suffix, *(FILMS if not suffix else ())}):
                return Path(f"{found}{suffix}")
            number += 1

    def save_scenario(self) -> str:
        """Write the scenario as TOML, after interventions also their log for replay; returns what was written.

        A log that does not hold all events is not written.
        """
        from flocking.engine.driver.registry import chosen_engine
        from flocking.study.scenario_files.scenario_file import write_scenario

        experiment: Experiment = self._clock.experiments[0]
        usual = chosen_engine(experiment.original, "auto") == experiment.engine
        engine = "" if usual else f" --engine {experiment.engine}"
        faults: list[FlockingError] = []
        paths: list[Path] = []

        def act() -> None:
            try:
                if experiment.untouched:
                    paths.append(write_scenario(experiment.original, self._path(".toml")))
                    return
                if experiment.complete:
                    paths.append(experiment.log.write(self._path(".events.json")))
                now = experiment.scenario.with_(
                    start=experiment.state, t_end=max(experiment.scenario.t_end, experiment.time + 1.0), frames=201
                )
                paths.append(write_scenario(now, self._path(".toml")))
            except FlockingError as error:
                faults.append(error)

        self._clock.do(act)
        if not paths and faults:
            raise faults[0]
        now = "the TOML file starts from the present state"
        if experiment.untouched:
            note = f"'flocking run {paths[-1].name}{engine}' gives the same run"
        elif experiment.complete:
            note = f"'flocking lab {paths[0].name}' replays the interventions; {now}"
        else:
            note = f"{now[0].upper()}{now[1:]}; the log of the interventions is not complete, and was not saved"
        return self._written(*paths, note=f"{note}. {faults[0] if faults else ''}")

    def save_score(self, challenge: str, score: Score) -> str:
        """Write a score with the log that gives it, which `flocking lab` replays; returns what was written.

        Parameters
        ----------
        challenge
            Name of the challenge; the file is named after its key.
        score
            The score.

        Raises
        ------
        InvalidInput
            When the goal is not reached, or the log does not hold all events.
        """
        experiment = self._clock.experiments[0]
        if not score.reached or not experiment.complete:
            raise InvalidInput("lab", "score", "needs a goal that is reached and a complete log", score.words)
        path = self._path(f".{challenge.partition('=')[0].strip()}.events.json")
        more = {"challenge": challenge, "score": score.value, "words": score.words}
        paths: list[Path] = []
        self._clock.do(lambda: paths.append(experiment.log.write(path, more)))
        return self._written(*paths, note=f"'flocking lab {path.name}' replays it")

    def save_picture(self, data: object) -> str:
        """Write a picture that a page has painted, as PNG; returns what was written.

        Parameters
        ----------
        data
            The picture, in base64.

        Raises
        ------
        InvalidInput
            When it is no such picture.
        """
        try:
            picture = base64.b64decode(data if isinstance(data, str) else "", validate=True)
        except (binascii.Error, ValueError):
            picture = b""
        if not picture.startswith(PNG):
            raise InvalidInput("lab", "picture", "must be a PNG picture in base64", f"{len(picture)} bytes")
        path = self._path(".png")
        with open(path, "xb") as file:
            file.write(picture)
        return self._written(path)

    def start_film(self) -> None:
        """Begin to record."""
        self._film = self._film or Film(self._clock)

    def save_film(self, look: Look) -> str:
        """End the recording and write the film; returns what was written.

        Parameters
        ----------
        look
            What is shown, and how.

        Raises
        ------
        InvalidInput
            When nothing was recorded, or nothing moved meanwhile.
        """
        film, self._film = self._film, None
        if film is None:
            raise InvalidInput("lab", "film", "must be recorded first", "none")
        written = film.write(self._path(""), look)
        notes = [words for words, applies in ((REBUILT, film.rebuilt), (BEGUN_ANEW, film.begun_anew)) if applies]
        return self._written(written, note=" ".join(notes))

    def _written(self, *paths: Path, note: str = "") -> str:
        self.saved += paths
        return f"Saved {', '.join(p.name for p in paths)}. {note}".strip()
