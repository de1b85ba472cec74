"""Saving of a running session: frames are appended, and a checkpoint is committed every few seconds."""

from __future__ import annotations

import json
import time
from dataclasses import asdict, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from flocking.engine.driver.checkpoint import write_checkpoint
from flocking.engine.driver.registry import entry_named
from flocking.engine.protocol.session import Session
from flocking.engine.runs.columns import joined_columns
from flocking.engine.runs.frame_parts import FramePart
from flocking.engine.runs.message_log import joined_logs
from flocking.engine.runs.provenance import with_earlier
from flocking.engine.runs.run import FRAMES, Run
from flocking.engine.storage.atomic_files import checksum
from flocking.engine.storage.part_writer import sees, write_parts
from flocking.engine.storage.record import RECORD, read_record
from flocking.engine.storage.run_writer import RunWriter
from flocking.engine.storage.stored_runs import read_last
from flocking.errors import InvalidInput, StorageError

COMMIT_SECONDS = 2.0
"""Wall time in seconds between two commits; in a small run a kill loses at most this and one stop of the
simulation."""

COMMIT_SHARE = 20.0
"""Least ratio of the time between two commits to the duration of a commit."""

MOST_WAITING = 2**28
"""Bytes of frames in memory that trigger a commit."""

MOST_RETURNED = 8 * 2**30
"""Bytes of frames up to which a saved run is returned complete; a larger one is returned with its last frame only."""


class SessionWriter:
    """Writes the new records of a session.

    Parameters
    ----------
    writer
        The run on disk; None on processes that do not write it.
    session
        The session; the run contains its records so far.
    every
        Wall time between two commits in seconds; `COMMIT_SECONDS` by default. 0 commits at every stop.
    """

    def __init__(self, writer: RunWriter | None, session: Session, every: float | None = None) -> None:
        self._writer = writer
        self._session = session
        self._team = session.team
        self._every = COMMIT_SECONDS if every is None else every
        self._cost = 0.0
        self._last = time.monotonic()
        self._folder = self._shared_folder()

    def _shared_folder(self) -> Path | None:
        """The run's folder if each process writes the frames of its agents there; None if the first one writes all."""
        team = self._team
        if team.size == 1:
            return None
        folder, agents, record = team.shared(
            lambda: (self._here.folder, self._here.shared_agents, checksum(self._here.folder / RECORD))
        )
        if not agents:
            return None
        all_see = team.collected(sees(folder, record))
        if not team.shared(lambda: all(all_see or ())):
            return None
        return folder if self._session.share_frames(agents) else None

    @classmethod
    def create(cls, folder: str | Path, session: Session, every: float | None = None) -> SessionWriter:
        """Save a new session to a new or empty folder; ``every`` as for the class.

        Raises
        ------
        StorageError
            If the folder is not empty or cannot be written.
        """
        entry = entry_named(session.engine)
        how: dict[str, object] = {"engine": session.engine, "options": plain_options(session.options)}
        if entry is not None:
            how["package"] = entry.package
        layout = session.records.layout
        writer = session.team.alone(
            lambda: RunWriter.create(folder, session.scenario, plant=session.plant, session=how, **layout)
        )
        return cls(writer, session, every)

    def __enter__(self) -> SessionWriter:
        return self

    def __exit__(self, *_: object) -> None:
        if self._writer is not None:
            self._writer.close()

    @property
    def _here(self) -> RunWriter:
        """The run on disk, on the process that writes it."""
        assert self._writer is not None
        return self._writer

    def commit_if_due(self) -> None:
        """Commit the new records, with a checkpoint, if a commit is due."""
        if self._team.shared(self._due):
            self._save()

    def _due(self) -> bool:
        waited = time.monotonic() - self._last
        wait = max(self._every, COMMIT_SHARE * self._cost) if self._every else 0.0
        return waited >= wait or self._session.records.waiting > MOST_WAITING

    def _save(self, status: str = "unfinished") -> None:
        begin = time.monotonic()
        self._write(complete=False)
        self._commit(status, resumable=True)
        self._last = time.monotonic()
        self._cost = self._last - begin

    def finish(self, status: str) -> None:
        """Commit the last records of a run that has ended."""
        self._write(complete=True)
        self._commit(status, resumable=False)

    def interrupt(self, status: str, *, between_steps: bool = False) -> None:
        """Save a run that was interrupted.

        ``between_steps``: with all its records. Otherwise as of its last commit, since the state within a step cannot
        be saved.
        """
        if between_steps and self._session.saves_when_interrupted:
            self._save(status)
        else:
            self._team.alone(lambda: self._here.mark(status))

    def run(self, status: str) -> Run:
        """The complete run: the part on disk, and the records after its last commit."""
        records = self._session.records
        if self._writer is not None and records.lets_go:
            # A second Ctrl-C may have come between a commit and its end here.
            counts = read_record(self._here.folder)["counts"]
            records.forget({name: max(count, counts.get(name, 0)) for name, count in records.stored.items()})
        recent = self._session.run(status)
        if not any(records.stored.values()):
            before = {} if self._writer is None else self._writer.provenance
            return replace(recent, provenance=with_earlier(recent.provenance, before))
        last = None if records.stored["time"] * records.frame_bytes <= MOST_RETURNED else 1
        found = _joined(read_last(self._here.folder, self._session.scenario, last), recent)
        if last is not None:
            which = "frame" if len(found.t) == 1 else f"{len(found.t)} frames"
            found.provenance[FRAMES] = f"only the last {which}; all frames are in {self._here.folder}"
        return found

    def _write(self, *, complete: bool) -> None:
        self._team.alone(lambda: self._append(complete=complete))
        if self._folder is not None and self._session.records.parts:
            self._append_parts(self._folder, self._session.records.parts)

    def _append_parts(self, folder: Path, parts: list[FramePart]) -> None:
        """Write frames of which each process has a part."""
        team, times = self._team, np.array([part.t for part in parts])
        frame = team.shared(lambda: self._here.make_room(times))
        failure, sums = "", []
        try:
            sums = write_parts(folder, parts, frame)
        except StorageError as error:
            failure = str(error)
        written = team.collected((failure, sums))

        def note() -> None:
            assert written is not None
            for text, _ in written:
                if text:
                    raise StorageError(text)
            self._here.note_parts(times, [each for _, each in written])

        team.alone(note)

    def _append(self, *, complete: bool) -> None:
        writer = self._here
        new = self._session.records.since(writer.counts, complete=complete)
        if len(new.t):
            columns = joined_columns(self._session.scenario, new.columns)
            writer.append(new.t, new.q, new.p, new.links, new.errors, columns)
        writer.append_records(new.switches, new.trace, new.observed)
        writer.append_log(new.log)

    def _commit(self, status: str, *, resumable: bool) -> None:
        session = self._session
        packed = session.pack() if resumable else None

        def commit() -> None:
            closest, accuracy = session.known
            self._here.commit(
                status,
                closest=closest,
                accuracy=accuracy,
                provenance=with_earlier(session.about, self._here.provenance),
                fidelity=session.fidelity,
                checkpoint=None if packed is None else lambda file: write_checkpoint(session.engine, packed, file),
            )
            session.records.forget(self._here.counts)

        self._team.alone(commit)
        session.records.forget_parts(stored=self._team.first)


def plain_options(options: object) -> dict[str, object]:
    """Options of an engine as plain data for the record of a run.

    Raises
    ------
    InvalidInput
        If JSON cannot represent one of them.
    """
    if not is_dataclass(options) or isinstance(options, type):
        raise InvalidInput("Session", "options", "must be a dataclass", options)
    found = asdict(options)
    for name, value in found.items():
        try:
            json.dumps(value)
        except (TypeError, ValueError):
            raise InvalidInput(
                type(options).__name__, name, "must be plain data to be saved with a run", value, "Run it without save."
            ) from None
    return found


def _joined(stored: Run, recent: Run) -> Run:
    """A run from the part on disk and the recent part in memory."""
    names = ["t", "q", "p", "switches", "trace"] + ([] if recent.observables is None else ["observables"])
    complete: dict[str, Any] = {name: np.concatenate([getattr(stored, name), getattr(recent, name)]) for name in names}
    links = [run.links for run in (stored, recent) if len(run.t)] or [recent.links]
    known = recent.accuracy
    if known is not None and stored.accuracy is not None:
        known = replace(known, frames=np.concatenate([stored.accuracy.frames, known.frames]))
    columns = {name: np.concatenate([stored.columns[name], recent.columns[name]]) for name in recent.columns}
    return replace(
        recent, links=np.concatenate(links), accuracy=known, columns=columns or stored.columns,
        log=joined_logs(stored.log, recent.log), provenance=with_earlier(recent.provenance, stored.provenance),
        **complete,
    )  # fmt: skip
