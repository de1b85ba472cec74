"""What pages look at beside the present: the record of the run, and a stored run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flocking.apps.lab.access.confinement import Folder
from flocking.apps.lab.experiment.clock import Clock
from flocking.apps.lab.experiment.timeline import Timeline
from flocking.apps.lab.live.frame_bytes import packed
from flocking.apps.lab.live.hub import Hub, Tab
from flocking.apps.lab.live.messages import stored_message
from flocking.engine.runs.run import Run
from flocking.errors import InvalidInput


class Past:
    """Shows recorded states to pages.

    Parameters
    ----------
    hub
        The open pages.
    clock
        The clock of the live run.
    timeline
        Its record.
    folder
        The only folder in which a page opens stored runs.
    """

    def __init__(self, hub: Hub, clock: Clock, timeline: Timeline, folder: Folder) -> None:
        self._hub, self._clock, self._timeline, self._folder = hub, clock, timeline, folder
        self.stored: Run | None = None
        """The stored run that is shown."""

    def leave(self) -> None:
        """Let all pages look at the present, which they are shown."""
        for tab in tuple(self._hub.tabs):
            if tab.looking is not None:
                tab.looking = None
                # The frame of the present may have come while they looked at the record.
                self._hub.repaint(tab)

    def look(self, tab: Tab, t: float | None) -> None:
        """Show a page the record at a time, or the present again.

        Parameters
        ----------
        tab
            The page.
        t
            The time; None for the present.
        """
        tab.looking = t
        run = self.stored
        if run is not None:
            k = len(run.t) - 1 if t is None else max(int(np.searchsorted(run.t, t, side="right")) - 1, 0)
            state, scenario = run.state(k), run.scenario
        elif t is None:
            self._hub.repaint(tab)
            return
        else:
            found = self._timeline.at(t)
            if found is None:
                return
            state, scenario = found
        shown = replace(self._clock.frame, time=float(state.t), states=(state,), scenarios=(scenario,))
        tab.show(packed(shown, tab.requested, live=False), present=False)

    def open_run(self, name: str) -> None:
        """Show a stored run on the timeline.

        Parameters
        ----------
        name
            Name given by a page.

        Raises
        ------
        InvalidInput, StorageError
            When there is none of that name in the folder, it cannot be read, or it holds no frames.
        """
        from flocking.engine.storage.stored_runs import read_run

        run = read_run(self._folder.path_of(name))
        if not len(run.t):
            raise InvalidInput("lab", "run", "must hold frames to be shown", name, "Its summary: flocking info.")
        self._clock.pause()
        self.stored = run
        self._hub.tell(stored_message(run))
        for tab in tuple(self._hub.tabs):
            self.look(tab, float(run.t[0]))
        self._hub.tell({"kind": "aim"})

    def close_run(self) -> None:
        """Show the live run again."""
        self.stored = None
        for tab in tuple(self._hub.tabs):
            self.look(tab, None)
