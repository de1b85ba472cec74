"""Whole runs under LAMMPS: the first rank writes them to disk while they go on, any number of ranks resumes them."""

from __future__ import annotations

import time
import zlib
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path

import numpy as np

from flocking.engine import interruption
from flocking.engine.driver.progress import Progress, stops
from flocking.engine.lammps import library
from flocking.engine.lammps.options import LammpsOptions
from flocking.engine.lammps.ranks import Ranks
from flocking.engine.lammps.restart import Restart, packed, stored_options, unpacked
from flocking.engine.lammps.session import LammpsSession
from flocking.engine.runs.run import OBSERVED_FIELDS, SWITCH_FIELDS, TRACE_FIELDS, Run
from flocking.engine.storage.atomic_files import storage_errors
from flocking.engine.storage.run_writer import RunWriter
from flocking.engine.storage.stored_runs import read_run, read_scenario_of
from flocking.errors import InvalidInput, SimulationError, StorageError
from flocking.model.law import Scenario

COMMIT_SECONDS = 5.0
"""Wall time between two commits; a kill loses no more than this and one stop of a small run."""

COMMIT_SHARE = 20.0
"""A commit that takes long is followed by so many times its own duration without one."""


class _Writing:
    """Writes a session to disk: frames at once, a commit to go on from every few seconds."""

    def __init__(self, session: LammpsSession, writer: RunWriter | None, every: float) -> None:
        self._session, self._writer, self._every = session, writer, every
        self._last, self._cost = time.monotonic(), 0.0

    def keep(self) -> None:
        """Commit when it is time to; all ranks call it together."""
        ranks = self._session.ranks
        begin = time.monotonic()
        wait = max(self._every, COMMIT_SHARE * self._cost) if self._every else 0.0
        if not ranks.comm.bcast(begin - self._last >= wait):
            return
        restart = self._session.restart()
        ranks.alone(lambda: self._commit("unfinished", restart))
        self._last = time.monotonic()
        self._cost = self._last - begin

    def finish(self, status: str) -> None:
        """Commit the last records of a run that will not go on."""
        self._session.ranks.alone(lambda: self._commit(status, None))

    def _commit(self, status: str, restart: Restart | None) -> None:
        writer, records = self._writer, self._session.records
        assert writer is not None
        counts = writer.counts
        new = slice(counts["time"], len(records.t))
        if records.t[new]:
            links = np.array(records.links[new]) if records.with_links else None
            writer.append(np.array(records.t[new]), np.array(records.q[new]), np.array(records.p[new]), links)
        rows = np.array(records.ledger.trace[counts["step"] :], dtype=TRACE_FIELDS)
        observed = np.array(records.observed[counts["observation"] :], dtype=OBSERVED_FIELDS)
        writer.append_records(np.zeros(0, dtype=SWITCH_FIELDS), rows, observed)
        writer.commit(
            status, closest=(records.ledger.closest_linked, records.ledger.closest_unlinked),
            provenance=self._session.about,
            checkpoint=None if restart is None else packed(restart, self._session.options),
        )  # fmt: skip


def drive_ranks(
    session: LammpsSession, *, save: str | Path | None, progress: bool, every: float = COMMIT_SECONDS
) -> Run:
    """Advance a session to the end of its scenario on all ranks; the run's frames are on the first rank.

    Parameters
    ----------
    session
        The session, on all ranks.
    save
        New or empty folder to write the run to while it goes on; nothing is written when absent.
    progress
        Show a progress bar on the first rank.
    every
        Wall time between two commits.

    Raises
    ------
    SimulationError
        When the run cannot go on; its ``run`` holds what was computed until then.
    StorageError
        When the run cannot be saved.
    """
    if save is None:
        return _drive(session, None, progress)
    if session.plant is not None:
        raise InvalidInput("engine='lammps'", "plant", "cannot be stored with a run", session.plant, "Give no folder.")
    records, options = session.records, session.options
    how = {"engine": "lammps", "options": asdict(options)}
    writer = session.ranks.alone(
        lambda: RunWriter.create(
            save, session.scenario, with_links=records.with_links, observed=options.observe, session=how
        )
    )
    return _written(session, writer, progress, every)


def resume_on_ranks(folder: str | Path, *, scenario: Scenario | None, progress: bool) -> Run:
    """Go on with a run on disk from its last commit, on any number of ranks.

    Parameters
    ----------
    progress
        Show a progress bar.

    Raises
    ------
    StorageError
        When there is no run, it is damaged, or it ended in a way that cannot go on.
    """
    folder = Path(folder)
    ranks = Ranks(library.communicator())
    writer = ranks.alone(lambda: RunWriter.reopen(folder))
    try:
        found = ranks.comm.bcast(ranks.alone(lambda: _last_commit(folder, writer, scenario)))
        records, data = found
        if data is None:
            return records  # type: ignore[no-any-return]
        if isinstance(data, LammpsOptions):
            session = LammpsSession(records.scenario, data)
        else:
            restart, options = unpacked(data, folder, records.scenario)
            session = LammpsSession(records.scenario, options, restart=restart)
            session.records.recall(records, session.gathered_state())
    except BaseException:
        if writer is not None:
            writer.close()
        raise
    return _written(session, writer, progress, COMMIT_SECONDS)


def _last_commit(
    folder: Path, writer: RunWriter | None, scenario: Scenario | None
) -> tuple[Run, bytes | LammpsOptions | None]:
    """The run as committed, and what it goes on from: nothing where it has ended, options where it never began."""
    assert writer is not None
    records = read_run(folder, scenario=scenario if scenario is not None else read_scenario_of(folder)[0])
    if records.finished:
        return records, None
    checkpoint = writer.record["checkpoint"]
    if checkpoint is None and writer.record["commits"] == 0:
        return records, stored_options(writer.record["session"]["options"])
    if checkpoint is None:
        raise StorageError(f"{folder}: this run cannot go on, it has no checkpoint: {records.status}")
    with storage_errors(folder, "read the checkpoint"):
        data = (folder / checkpoint["file"]).read_bytes()
    if zlib.crc32(data) != checkpoint["checksum"]:
        raise StorageError(
            f"{folder / checkpoint['file']}: the checkpoint does not match its checksum; it was damaged."
        )
    return records, data


def _written(session: LammpsSession, writer: RunWriter | None, progress: bool, every: float) -> Run:
    try:
        writing = _Writing(session, writer, every)
        writing.keep()
        return _drive(session, writing, progress)
    finally:
        if writer is not None:
            writer.close()


def _drive(session: LammpsSession, writing: _Writing | None, progress: bool) -> Run:
    scenario = session.scenario
    status = "finished"
    try:
        with Progress(progress and session.ranks.first, scenario, lines=True) as bar:
            begin = session.steps
            bar.show(session.time, 0)
            for t in stops(scenario, session.time, often=writing is not None):
                session.advance(t)
                bar.show(session.time, (session.steps - begin) * scenario.start.n)
                if writing is not None and t < scenario.t_end:
                    writing.keep()
        if writing is not None:
            writing.finish(status)
    except KeyboardInterrupt:
        if session.ranks.size > 1 or not interruption.PARTS_WANTED:
            raise
        status = f"interrupted at t = {session.time:.9g}"
    except SimulationError as error:
        if writing is not None:
            with suppress(StorageError):
                writing.finish(str(error))
        raise
    finally:
        session.close()
    return session.run(status)
