"""A session kept on disk while it runs: frames streamed, a commit with a checkpoint every few seconds."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np

from flocking.engine.checkpoint import pack
from flocking.engine.exact import ExactSession
from flocking.engine.run import SWITCH_FIELDS, TRACE_FIELDS
from flocking.engine.run_writer import RunWriter

COMMIT_SECONDS = 2.0
"""Wall time between two commits; a kill loses no more than this and one stop of the simulation."""


class Saving:
    """Writes what a session has recorded since the last time.

    Parameters
    ----------
    writer
        The run on disk.
    session
        The running simulation; the run holds its records up to now.
    every
        Wall time between two commits, in seconds; `COMMIT_SECONDS` when absent.
    """

    def __init__(self, writer: RunWriter, session: ExactSession, every: float | None = None) -> None:
        self._writer = writer
        self._session = session
        self._every = COMMIT_SECONDS if every is None else every
        self._last = time.monotonic()

    @classmethod
    def create(cls, folder: str | Path, session: ExactSession, every: float | None = None) -> Saving:
        """Save a new session to a new or empty folder.

        Raises
        ------
        StorageError
            When the folder holds something already or cannot be written.
        """
        return cls(RunWriter.create(folder, session.scenario, plant=session.plant), session, every)

    def __enter__(self) -> Saving:
        return self

    def __exit__(self, *_: object) -> None:
        self._writer.close()

    def keep(self) -> None:
        """Commit what was recorded, with a checkpoint, when it is time to."""
        if time.monotonic() - self._last >= self._every:
            self._write()
            self._commit("unfinished", resumable=True)
            self._last = time.monotonic()

    def finish(self, status: str) -> None:
        """Commit the last records of a run that will not go on."""
        self._write()
        self._commit(status, resumable=False)

    def interrupt(self, status: str) -> None:
        """Leave the last commit, from which the run can go on: an interrupted step is in no state to be kept."""
        self._writer.mark(status)

    def _write(self) -> None:
        recorder, counts = self._session.recorder, self._writer.counts
        new = slice(counts["time"], len(recorder.t))
        if recorder.t[new]:
            self._writer.append(*(np.array(x[new]) for x in (recorder.t, recorder.q, recorder.p, recorder.links)))
        self._writer.append_records(
            np.array(recorder.switches[counts["switch"] :], dtype=SWITCH_FIELDS),
            np.array(recorder.trace[counts["step"] :], dtype=TRACE_FIELDS),
        )

    def _commit(self, status: str, *, resumable: bool) -> None:
        recorder = self._session.recorder
        self._writer.commit(
            status,
            closest=(recorder.closest_linked, recorder.closest_unlinked),
            provenance=self._session.about,
            checkpoint=pack(self._session) if resumable else None,
        )
