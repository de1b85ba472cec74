"""Going on with a run on disk that was killed or interrupted."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from flocking.engine.driver.checkpoint import unpack
from flocking.engine.driver.session_writer import SessionWriter
from flocking.engine.driver.simulate import drive, opened
from flocking.engine.runs.run import Run
from flocking.engine.storage.atomic_files import checksum, read_soundly, storage_errors
from flocking.engine.storage.record import written_by
from flocking.engine.storage.run_writer import RunWriter
from flocking.engine.storage.stored_runs import read_last, read_run, read_scenario_of
from flocking.errors import InvalidInput, StorageError
from flocking.model.law import Law, Scenario


def resume(
    folder: str | Path,
    *,
    scenario: Scenario | None = None,
    plant: Law | None = None,
    progress: bool = True,
    threads: int | None = None,
) -> Run:
    """Go on with a run on disk from its last commit to the end of its scenario.

    The result equals that of a run never stopped, bit for bit, on the same machine and versions.
    A run that is finished already is read and returned.

    Parameters
    ----------
    folder
        Where the run is.
    scenario, plant
        Its scenario and plant, for a run whose scenario could not be stored.
    progress
        Show a progress bar once it takes longer than two seconds.
    threads
        Number of threads of the tiled engine, on which results do not depend; as before when absent.

    Raises
    ------
    StorageError
        When there is no run, it is damaged, another process writes it, or it ended in a way that cannot go on.
    SimulationError
        When the run cannot go on; its ``run`` holds what was computed until then.
    """
    if not isinstance(folder, str | Path):
        raise InvalidInput("resume", "folder", "must be a path", folder)
    folder = Path(folder)
    with read_soundly(folder):
        return _resume(folder, scenario, plant, progress, threads)


def _resume(folder: Path, scenario: Scenario | None, plant: Law | None, progress: bool, threads: int | None) -> Run:
    engine = written_by(folder)
    if engine == "lammps":
        from flocking.engine.driver.lammps_runs import resume_on_ranks

        return resume_on_ranks(folder, scenario=scenario, progress=progress)
    with RunWriter.reopen(folder) as writer:
        if scenario is None:
            scenario, plant = read_scenario_of(folder)
        # What the tiled engine has written need not be in memory to go on after it.
        many = engine == "tiles" and writer.record["status"] != "finished"
        records = read_last(folder, scenario, 0) if many else read_run(folder, scenario=scenario)
        if records.finished:
            return records
        checkpoint, counts = writer.record["checkpoint"], writer.counts
        fewer = {} if threads is None or engine != "tiles" else {"threads": threads}
        if checkpoint is not None:
            path = folder / checkpoint["file"]
            with storage_errors(folder, "read the checkpoint"):
                found = checksum(path)
            if found != checkpoint["checksum"]:
                raise StorageError(f"{path}: the checkpoint does not match its checksum; the file was damaged.")
            session = unpack(path, records, plant, path, stored=counts, threads=threads)
        elif writer.record["commits"] == 0:
            how: dict[str, Any] = writer.record.get("session") or {"engine": "exact", "options": {}}
            session = opened(scenario, how["engine"], plant, **{**how["options"], **fewer})
        else:
            raise StorageError(f"{folder}: this run cannot go on, it ended: {records.status}")
        return drive(session, progress=progress, saving=SessionWriter(writer, session))
