"""A session kept on disk while it runs: frames streamed, a commit with a checkpoint every few seconds."""

from __future__ import annotations

import time
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from flocking.engine.driver.checkpoint import write_checkpoint
from flocking.engine.exact.session import ExactSession
from flocking.engine.runs.run import Run
from flocking.engine.storage.run_writer import RunWriter
from flocking.engine.storage.stored_runs import read_last

if TYPE_CHECKING:
    from flocking.engine.tiles.session import TilesSession

COMMIT_SECONDS = 2.0
"""Wall time between two commits; a kill loses no more than this and one stop of the simulation, in a small run."""

COMMIT_SHARE = 20.0
"""A commit that takes long is followed by so many times its own duration without one."""

MOST_WAITING = 2**28
"""Bytes of frames that wait in memory for a commit."""

MOST_RETURNED = 8 * 2**30
"""Bytes of frames up to which a saved run comes back whole; a larger one with its last frame alone."""


class SessionWriter:
    """Writes what a session has recorded since the last time.

    Parameters
    ----------
    writer
        The run on disk.
    session
        The running simulation; the run holds its records up to now.
    every
        Wall time between two commits, in seconds; `COMMIT_SECONDS` when absent. 0 commits at every stop.
    """

    def __init__(self, writer: RunWriter, session: ExactSession | TilesSession, every: float | None = None) -> None:
        self._writer = writer
        self._session = session
        self._every = COMMIT_SECONDS if every is None else every
        self._cost = 0.0
        self._last = time.monotonic()

    @classmethod
    def create(
        cls, folder: str | Path, session: ExactSession | TilesSession, every: float | None = None
    ) -> SessionWriter:
        """Save a new session to a new or empty folder.

        Parameters
        ----------
        every
            Wall time between two commits, in seconds; `COMMIT_SECONDS` when absent.

        Raises
        ------
        StorageError
            When the folder holds something already or cannot be written.
        """
        options = getattr(session, "options", None)
        how = {"engine": session.engine, "options": {} if options is None else asdict(options)}
        layout = session.recorder.layout
        return cls(
            RunWriter.create(folder, session.scenario, plant=session.plant, session=how, **layout), session, every
        )

    def __enter__(self) -> SessionWriter:
        return self

    def __exit__(self, *_: object) -> None:
        self._writer.close()

    def keep(self) -> None:
        """Commit what was recorded, with a checkpoint, when it is time to."""
        waited = time.monotonic() - self._last
        wait = max(self._every, COMMIT_SHARE * self._cost) if self._every else 0.0
        if waited >= wait or self._session.recorder.waiting > MOST_WAITING:
            self._keep()

    def _keep(self, status: str = "unfinished") -> None:
        begin = time.monotonic()
        self._write(complete=False)
        self._commit(status, resumable=True)
        self._last = time.monotonic()
        self._cost = self._last - begin

    def finish(self, status: str) -> None:
        """Commit the last records of a run that will not go on."""
        self._write(complete=True)
        self._commit(status, resumable=False)

    def interrupt(self, status: str, *, between_steps: bool = False) -> None:
        """Keep a run that was interrupted.

        ``between_steps``, all of it; otherwise its last commit, for an interrupted step is in no state to be kept.
        """
        if between_steps and getattr(self._session, "between_steps", False):
            self._keep(status)
        else:
            self._writer.mark(status)

    def run(self, status: str) -> Run:
        """The whole run: what is on disk, and what came after its last commit."""
        recent = self._session.run(status)
        recorder = self._session.recorder
        if not any(recorder.stored.values()):
            return recent
        last = None if recorder.stored["time"] * recorder.frame_bytes <= MOST_RETURNED else 1
        found = _joined(read_last(self._writer.folder, self._session.scenario, last), recent)
        if last is not None:
            found.provenance["frames"] = f"last frame alone; all of them are in {self._writer.folder}"
        return found

    def _write(self, *, complete: bool) -> None:
        new = self._session.recorder.since(self._writer.counts, complete=complete)
        if len(new.t):
            self._writer.append(new.t, new.q, new.p, new.links, new.errors)
        self._writer.append_records(new.switches, new.trace, new.observed)

    def _commit(self, status: str, *, resumable: bool) -> None:
        session = self._session
        self._writer.commit(
            status,
            closest=session.closest_pairs,
            accuracy=session.accuracy,
            provenance=session.about,
            checkpoint=(lambda file: write_checkpoint(session, file)) if resumable else None,
        )
        session.recorder.forget(self._writer.counts)


def _joined(stored: Run, recent: Run) -> Run:
    """A run of which memory holds the end alone, the rest read back."""
    names = ["t", "q", "p", "switches", "trace"] + ([] if recent.observables is None else ["observables"])
    complete: dict[str, Any] = {name: np.concatenate([getattr(stored, name), getattr(recent, name)]) for name in names}
    links = [run.links for run in (stored, recent) if len(run.t)] or [recent.links]
    return replace(recent, links=np.concatenate(links), **complete)
