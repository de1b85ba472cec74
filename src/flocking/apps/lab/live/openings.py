"""Which experiment a name means: of the library, in the folder of the page, or what the lab was started with."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from flocking.apps.lab.access.confinement import Folder
from flocking.apps.lab.experiment.challenges import CHALLENGE, challenge_of
from flocking.apps.lab.experiment.events import EventLog
from flocking.apps.lab.experiment.experiment import Experiment, replay
from flocking.apps.lab.panels.choices import first_choice, is_built_in, scenario_of
from flocking.engine.driver.waits import Wait
from flocking.model.law import Scenario


class Openings:
    """Opens experiments by their names.

    Parameters
    ----------
    given
        What the lab was started with: a scenario, a name, a file, or nothing.
    folder
        The only folder in which a page opens files.
    """

    def __init__(self, given: Scenario | str | None, folder: Folder) -> None:
        self._folder = folder
        self._scenario = given if isinstance(given, Scenario) else None
        if isinstance(given, Scenario):
            self.first_name = given.name or "yours"
        else:
            self.first_name = first_choice() if given is None else given
        # Named by the user who starts the lab, not by a page: any folder is allowed.
        is_file = self._scenario is None and not is_built_in(self.first_name)
        self._file = Path(self.first_name).absolute() if is_file else None

    def first(self) -> Experiment:
        """What the lab was started with."""
        with Wait("lab"):
            return self.opened(self.first_name, None, lambda: True)

    def opened(self, name: str, seed: int | None, proceed: Callable[[], bool]) -> Experiment:
        """The experiment of a name given by a page.

        Parameters
        ----------
        name
            The name.
        seed
            Seed of its random draws; its own when absent.
        proceed
            Whether a replay still goes on; false cancels it.

        Raises
        ------
        InvalidInput
            When there is none, or it cannot be started.
        """
        if name.startswith(CHALLENGE):
            return Experiment(challenge_of(name.removeprefix(CHALLENGE)).make())
        if self._scenario is not None and name == self.first_name:
            return Experiment(self._scenario)
        if name == self.first_name and self._file is not None:
            file = self._file
        else:
            file = Path(name) if is_built_in(name) else self._folder.inside(name)
        if name.endswith(".json"):
            return replay(EventLog.read(file), proceed)
        return Experiment(scenario_of(name, file, seed))
