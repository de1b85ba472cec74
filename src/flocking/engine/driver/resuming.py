"""Resuming a run on disk that was killed or interrupted."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from flocking.engine.driver.checkpoint import largest_checkpoint, read_checkpoint, restored
from flocking.engine.driver.registry import entry_named, missing_engine
from flocking.engine.driver.session_writer import SessionWriter
from flocking.engine.driver.simulate import drive, open_session
from flocking.engine.fixed_step.threads import check_threads
from flocking.engine.protocol.engine import Engine
from flocking.engine.protocol.session import Packed, Session, Stored
from flocking.engine.protocol.team import Team
from flocking.engine.runs.run import Run
from flocking.engine.storage.atomic_files import checksum, read_soundly, storage_errors
from flocking.engine.storage.record import engine_of, goes_on, read_record
from flocking.engine.storage.record_checks import check_sums
from flocking.engine.storage.run_writer import RunWriter
from flocking.engine.storage.scenario_sums import plant_sums, scenario_sums
from flocking.engine.storage.stored_runs import own_scenario, read_last, read_run
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
    """Continue a run on disk from its last commit to the end of its scenario.

    The result equals that of an uninterrupted run bit for bit on the same machine and versions, of ``engine="lammps"``
    up to rounding, since sums are in the order in which its ranks have the agents.
    A finished run is read and returned, also from a folder that cannot be written.

    Parameters
    ----------
    folder
        The folder of the run.
    scenario, plant
        The scenario and the plant, for a run whose scenario could not be stored.
    progress
        Whether to show a progress bar for runs longer than two seconds.
    threads
        Number of threads, for an engine whose results do not depend on it; unchanged by default.

    Raises
    ------
    InvalidInput
        If ``threads`` is given and the engine that made it has no threads to choose, a plant without a scenario, or a
        scenario or a plant for a run that stores another.
    StorageError
        If there is no run, it is damaged, another process writes it, or it ended with an error.
    EngineMissing
        If its engine is not registered.
    SimulationError
        If the run cannot continue; ``run`` of the error contains the results so far.
    """
    if not isinstance(folder, str | Path):
        raise InvalidInput("resume", "folder", "must be a path", folder)
    if plant is not None and (scenario is None or not isinstance(plant, Law)):
        raise InvalidInput(
            "resume", "plant", "must be a Law, beside the scenario of a run that could not be stored", plant,
            "A stored run has its own plant: leave it out.",
        )  # fmt: skip
    if threads is not None:
        check_threads("resume", threads)
    folder = Path(folder)
    with read_soundly(folder):
        return _resume(folder, scenario, plant, progress, {} if threads is None else {"threads": threads})


@dataclass(frozen=True, eq=False)
class _Left:
    """State of a stopped run: the run if it is finished, else the data to continue from."""

    scenario: Scenario
    plant: Law | None
    counts: dict[str, int]
    options: dict[str, object]
    finished: Run | None = None
    packed: Packed | None = None
    place: Path = Path()


def _resume(
    folder: Path, scenario: Scenario | None, plant: Law | None, progress: bool, changes: dict[str, object]
) -> Run:
    name, package = engine_of(folder)
    entry = entry_named(name)
    if entry is None:
        # A finished run is read without its engine.
        found = read_run(folder, scenario=scenario)
        if found.finished:
            return found
        _check_goes_on(folder, read_record(folder))
        raise missing_engine(folder, name, package)
    engine = entry.load()
    _check_changes(name, changes, engine.free_options)
    team = engine.team()
    stored = team.shared(lambda: _read_only(folder, scenario, plant))
    if stored is not None:
        return replace(stored, rank=team.rank)
    writer = team.alone(lambda: RunWriter.reopen(folder))
    try:
        left = team.shared(lambda: _left(folder, writer, name, scenario, plant))
        if left.finished is not None:
            return replace(left.finished, rank=team.rank)
        _check_changes(name, changes, engine.free_options_of(left.options))
        session = _session(folder, engine, team, left, changes)
        return drive(session, progress=progress, writer=SessionWriter(writer, session))
    finally:
        if writer is not None:
            writer.close()


def _read_only(folder: Path, scenario: Scenario | None, plant: Law | None) -> Run | None:
    """A finished run in a folder that cannot be written, as on an archive or of somebody else; None otherwise."""
    if os.access(folder, os.W_OK) or read_record(folder)["status"] != "finished":
        return None
    scenario, plant = own_scenario("resume", folder, scenario, plant)
    return read_last(folder, scenario, None)


def _check_changes(name: str, changes: dict[str, object], free: frozenset[str]) -> None:
    for key in sorted(set(changes) - free):
        rule = f"is not an option of engine={name!r} that may change when this run goes on"
        raise InvalidInput("resume", key, rule, changes[key], "Leave it out.")


def _left(folder: Path, writer: RunWriter | None, engine: str, scenario: Scenario | None, plant: Law | None) -> _Left:
    assert writer is not None
    scenario, plant = own_scenario("resume", folder, scenario, plant)
    record: dict[str, Any] = writer.record
    how = record.get("session") or {}
    left = _Left(scenario, plant, writer.counts, dict(how.get("options", {})))
    if record["status"] == "finished":
        return _Left(scenario, plant, left.counts, left.options, read_last(folder, scenario, None))
    _check_goes_on(folder, record)
    _check_plant(folder, record, plant)
    check_sums(folder, record["scenario"], "sums", scenario_sums(scenario), code=True)
    if plant is not None:
        check_sums(folder, record["scenario"], "plant_sums", plant_sums(scenario, plant), code=True)
    checkpoint = record["checkpoint"]
    if checkpoint is None:
        return left
    # Damage is reported before the run continues.
    read_last(folder, scenario, 0)
    place = folder / checkpoint["file"]
    with storage_errors(folder, "read the checkpoint"):
        size, most = place.stat().st_size, largest_checkpoint(scenario)
        if size > most:
            rule = f"the checkpoint has {size} bytes, more than the {most} that its scenario explains"
            raise StorageError(f"{place}: {rule}; the file was damaged.")
        found = checksum(place)
    if found != checkpoint["checksum"]:
        raise StorageError(f"{place}: the checkpoint does not match its checksum; the file was damaged.")
    return _Left(scenario, plant, left.counts, left.options, None, read_checkpoint(place, engine, place), place)


def _check_goes_on(folder: Path, record: Mapping[str, object]) -> None:
    """Refuse a run that has neither a checkpoint nor a beginning that can be computed again."""
    if goes_on(record):
        return
    if not record["commits"]:
        raise StorageError(
            f"{folder}: a run was being copied here, and nothing of it was stored: it cannot continue. Delete the "
            "folder and write the run again."
        )
    raise StorageError(f"{folder}: this run cannot continue; it ended with: {record['status']}")


def _check_plant(folder: Path, record: Mapping[str, Any], plant: Law | None) -> None:
    """Refuse to go on without the plant of a run whose scenario is not stored, or with one that it had not."""
    about = record["scenario"]
    planted = about.get("plant")
    if not about["left_out"] or planted is None or planted == (plant is not None):
        return
    rule = (
        "must be given, for the agents of {} follow another law"
        if planted
        else ("must be absent, for the agents of {} follow its law")
    )
    raise InvalidInput("resume", "plant", rule.format(folder), plant, "It is that with which the run was begun.")


def _session(folder: Path, engine: Engine, team: Team, left: _Left, changes: dict[str, object]) -> Session:
    if left.packed is None:
        options = engine.stored_options({**left.options, **changes})
        return open_session(engine, left.scenario, options, left.plant)

    def read() -> Run:
        return team.shared(lambda: read_last(folder, left.scenario, None))

    stored = Stored(left.scenario, left.plant, left.counts, read)
    return restored(engine, left.packed, stored, left.place, changes)
