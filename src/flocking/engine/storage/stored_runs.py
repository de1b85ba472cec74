"""Runs on disk: a Zarr 3 group that grows by atomic commits.

The folder of a run is the group itself, so that ``xarray.open_zarr(folder)`` shows labelled arrays. Its ``zarr.json``
contains the record of the last commit and the metadata of all arrays. It is replaced last and atomically, so that a
reader finds exactly the frames of that commit.
"""

from __future__ import annotations

import json
import zlib
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict

import numpy as np

from flocking.arrays import AnyArray
from flocking.engine.archives.data_checks import MalformedError
from flocking.engine.interruption import interrupted, uninterrupted
from flocking.engine.memory_shortage import starved
from flocking.engine.runs.columns import (
    ARRAYS,
    COLUMN,
    FRAME_ERROR,
    FRAME_PARTS,
    LEDGER,
    LOG,
    OBSERVED,
    SWITCHES,
    frame_checksums,
    joined_columns,
    separate_columns,
    switch_table,
    table_of,
)
from flocking.engine.runs.fidelity import Fidelity
from flocking.engine.runs.message_log import MessageLog
from flocking.engine.runs.provenance import last_time
from flocking.engine.runs.run import OBSERVED_FIELDS, TRACE_FIELDS, Closest, Run
from flocking.engine.runs.run_errors import accuracy_of
from flocking.engine.runs.stored_fidelity import fidelity_of
from flocking.engine.storage.atomic_files import NO_MEMORY, read_soundly, storage_errors
from flocking.engine.storage.bounded_chunks import bounded_store, bounds_of
from flocking.engine.storage.new_folders import check_path, scenario_text
from flocking.engine.storage.record import COPIED, SCENARIO, goes_on, read_record, read_root
from flocking.engine.storage.record_checks import check_records
from flocking.engine.storage.regular_files import LARGEST_SCENARIO, bounded_content
from flocking.engine.storage.run_writer import RunWriter
from flocking.engine.storage.zarr_thread import zarr_calls
from flocking.errors import FlockingError, InvalidInput, StorageError
from flocking.formula.listed_files import files_below
from flocking.model.checks import integer
from flocking.model.law import Law, Scenario
from flocking.model.serial import ForeignPart, from_data, to_data

if TYPE_CHECKING:
    import zarr


def write_run(run: Run, folder: str | Path) -> Path:
    """Write a finished run to a new or empty folder.

    Ctrl-C waits until all of it is there.

    Raises
    ------
    StorageError
        If the folder is not empty or cannot be written.
    InvalidInput
        If the run is none, or not of as many entries everywhere as it has frames, or the folder no path.
    """
    if not isinstance(run, Run):
        raise InvalidInput("write_run", "run", "must be a Run", run, "Use fk.simulate(scenario).")
    check_path("write_run", "folder", folder)
    _check_lengths(run)
    links, observed = run.links.shape[1:] == (run.n, run.n), run.observables is not None
    precision = "float32" if run.q.dtype == np.float32 else "float64"
    with uninterrupted(), RunWriter.create(
        folder, run.scenario, with_links=links, precision=precision, observed=observed,
        with_errors=run.accuracy is not None, with_log=run.log is not None, session={COPIED: True},
    ) as writer:  # fmt: skip
        errors = None if run.accuracy is None else run.accuracy.frames
        columns = joined_columns(run.scenario, run.columns)
        writer.append(run.t, run.q, run.p, run.links, errors, columns)
        writer.append_records(run.switches, run.trace, run.observables)
        writer.append_log(run.log)
        closest = (run.closest_linked, run.closest_unlinked)
        writer.commit(
            run.status, closest=closest, accuracy=run.accuracy, provenance=run.provenance, fidelity=run.fidelity
        )
    return Path(folder)


def _check_lengths(run: Run) -> None:
    """Refuse a run put together of parts that do not fit: its tables could not be read again."""
    parts: dict[str, AnyArray] = {"q": run.q, "p": run.p, "links": run.links, **run.columns}
    if run.accuracy is not None:
        parts["accuracy.frames"] = run.accuracy.frames
    for name, values in parts.items():
        if len(values) != len(run.t):
            raise InvalidInput(
                "write_run", "run", f"must have an entry of {name} for each of its {len(run.t)} frames", len(values),
                "run.until(time) shortens all of them.",
            )  # fmt: skip


def read_run(folder: str | Path, *, scenario: Scenario | None = None, frames: int | None = None) -> Run:
    """Read the committed part of a run.

    Parameters
    ----------
    folder
        The folder of the run.
    scenario
        Its scenario, for a run whose scenario could not be stored.
    frames
        Number of frames to read, for example those before a damaged one. With fewer than there are the run is cut
        after them, see `flocking.engine.runs.run.Run.until`.

    Raises
    ------
    StorageError
        If there is no run, it was written by a newer version, or data do not match their checksums.
    InvalidInput
        If the run stores another scenario than the given one.
    """
    if not isinstance(folder, str | Path):
        raise InvalidInput("read_run", "folder", "must be a path", folder)
    if frames is not None:
        integer("read_run", "frames", frames, least=0)
    folder = Path(folder)
    with read_soundly(folder):
        return _read_run(folder, own_scenario("read_run", folder, scenario, None)[0], frames)


def read_last(folder: Path, scenario: Scenario, last: int | None) -> Run:
    """Read a run of a ``scenario``, which is its own, with only its ``last`` frames, or with all of them.

    Raises
    ------
    StorageError
        If there is no run or it is damaged.
    """
    with read_soundly(folder):
        return _read_run(folder, scenario, None, last)


def _read_run(folder: Path, scenario: Scenario, frames: int | None, last: int | None = None) -> Run:
    record = read_record(folder)
    with storage_errors(folder, "read the run"), zarr_calls():
        import zarr

        store = bounded_store(bounds_of(read_root(folder)["consolidated_metadata"]["metadata"]))(folder, read_only=True)
        group = zarr.open_group(store, mode="r", use_consolidated=True, zarr_format=3)
        arrays = {name: group[name] for name in group.attrs["flocking"]["arrays"]}
    count = record["counts"]["time"] if frames is None else min(frames, record["counts"]["time"])
    first = 0 if last is None else max(0, count - last)
    names = [name for name in (*FRAME_PARTS, "checksum") if name in arrays]
    parts = {name: _read(folder, arrays[name], name, count, first) for name in names}
    _check_frames(folder, parts, first)
    rows = {name: record["counts"]["switch"] for name in SWITCHES if name in arrays}
    further = {LEDGER: "step", OBSERVED: "observation", FRAME_ERROR: "time", COLUMN: "time"}
    further |= {"tick": "tick", "tick_force": "tick", "use": "use"}
    rows |= {name: record["counts"].get(kind, 0) for name, kind in further.items() if name in arrays}
    tables = {name: _read(folder, arrays[name], name, length) for name, length in rows.items()}
    for name, values in tables.items():
        if len(values) and zlib.crc32(values.tobytes()) != record["checksums"].get(name):
            raise StorageError(f"{folder}: the table {name!r} does not match its checksum; the file was damaged.")
    if COLUMN in tables:
        tables[COLUMN] = tables[COLUMN][first:count]
    provenance = dict(group.attrs["provenance"])
    check_records(folder, scenario, record, parts, tables, last_time(scenario, provenance))
    errors = tables.get(FRAME_ERROR)
    columns = separate_columns(scenario, tables[COLUMN]) if COLUMN in tables else {}
    linked, unlinked = (_closest_of(c) for c in record["closest"])
    found = Run(
        scenario, parts["time"], parts["position"], parts["velocity"],
        parts["links"] if record["links"] else np.zeros((count - first, 0, 0), dtype=bool),
        switch_table(tables), table_of(tables[LEDGER], TRACE_FIELDS), linked, unlinked, record["status"], provenance,
        table_of(tables[OBSERVED], OBSERVED_FIELDS) if OBSERVED in tables else None,
        accuracy=accuracy_of(record.get("accuracy"), errors if errors is None else errors[first:count]),
        fidelity=_fidelity(folder, record.get("fidelity"), provenance, scenario),
        columns=columns,
        log=MessageLog(*(tables[name] for name in LOG)) if "tick" in tables else None,
    )  # fmt: skip
    return found.cut(count) if count < record["counts"]["time"] else found


def _fidelity(folder: Path, data: object, provenance: dict[str, object], scenario: Scenario) -> Fidelity:
    try:
        return fidelity_of(data, provenance, scenario)
    except MalformedError as error:
        raise StorageError(f"{folder}: not a fidelity of a run that this version can read: {error}.") from None


class StoredFacts(TypedDict):
    """Content of the record of a stored run, and its size on disk."""

    title: str
    status: str
    agents: int
    dimension: int
    frames: int
    links: bool
    commits: int
    can_go_on: bool
    scenario_stored: bool
    format: int
    bytes: int


def stored_facts(folder: str | Path) -> StoredFacts:
    """Content of the record of a run as plain data for JSON; frames are not read.

    Raises
    ------
    StorageError
        If there is no run, its record is damaged, or a newer version wrote it.
    """
    folder = Path(folder)
    with read_soundly(folder):
        return _stored_facts(folder)


def _stored_facts(folder: Path) -> StoredFacts:
    record = read_record(folder)
    with storage_errors(folder, "read the run"):
        size = sum(entry.stat().st_size for entry in files_below(folder) if entry.is_file())
    return {
        "title": record["title"], "status": record["status"], "agents": record["n"], "dimension": record["dimension"],
        "frames": record["counts"]["time"], "links": record["links"], "commits": record["commits"],
        "can_go_on": goes_on(record),
        "scenario_stored": not record["scenario"]["left_out"], "format": record["format"], "bytes": size,
    }  # fmt: skip


def read_scenario_of(folder: str | Path) -> tuple[Scenario, Law | None]:
    """Scenario of a run on disk, and its plant if it has one.

    Raises
    ------
    StorageError
        If the scenario was not stored or is damaged.
    """
    folder = Path(folder)
    about = read_record(folder)["scenario"]
    if about["left_out"]:
        raise StorageError(
            f"{folder}: the run contains no scenario ({about['left_out']}). "
            "Give it when reading in Python: read_run(folder, scenario=...)."
        )
    with storage_errors(folder, "read the scenario"):
        text = bounded_content(folder / SCENARIO, LARGEST_SCENARIO)
    if zlib.crc32(text) != about["checksum"]:
        raise StorageError(f"{folder / SCENARIO}: the scenario does not match its checksum; the file was damaged.")
    try:
        scenario, plant = from_data(json.loads(text))
    except (FlockingError, ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise StorageError(f"{folder / SCENARIO}: not a scenario that this version can build: {error}") from None
    if not isinstance(scenario, Scenario) or not isinstance(plant, Law | None):
        raise StorageError(f"{folder / SCENARIO}: contains no scenario.")
    return scenario, plant


def own_scenario(owner: str, folder: Path, given: Scenario | None, plant: Law | None) -> tuple[Scenario, Law | None]:
    """Scenario of a run on disk, and its plant if it has one: those that it stores, else the given ones.

    Parameters
    ----------
    owner
        The function that was called, for messages.
    given, plant
        Scenario and plant as they were given; a stored run may be given its own again.

    Raises
    ------
    StorageError
        If none is stored and none given, or the stored one is damaged.
    InvalidInput
        If the run stores another scenario or plant than the given one.
    """
    if given is None:
        return read_scenario_of(folder)
    if not isinstance(given, Scenario):
        raise InvalidInput(owner, "scenario", "must be a Scenario", given)
    about = read_record(folder)["scenario"]
    # One that is stored may be damaged: the given one then takes its place where it has its checksum.
    if about["left_out"] or zlib.crc32(scenario_text(given, plant)[0]) == about["checksum"]:
        return given, plant
    scenario, own_plant = read_scenario_of(folder)
    for name, one, other in (("scenario", given, scenario), ("plant", plant, own_plant)):
        if one is not None and not _same_data(one, other):
            raise InvalidInput(
                owner, name, f"must be absent, for {folder} stores its own, which is another", one,
                "A scenario is given for a run whose scenario could not be stored.",
            )  # fmt: skip
    return scenario, own_plant


def _same_data(one: Scenario | Law, other: Scenario | Law | None) -> bool:
    """Whether two parts are written as the same data; one from outside this library is not written."""
    try:
        return other is not None and json.dumps(to_data(one)) == json.dumps(to_data(other))
    except ForeignPart:
        return False


def _read(folder: Path, array: zarr.Array, name: str, count: int, begin: int = 0) -> AnyArray:
    """Rows from ``begin`` up to ``count``; the error for a damaged chunk gives its rows."""
    try:
        if array.shape[0] < count:
            raise ValueError(f"{array.shape[0]} rows instead of {count}")
        with zarr_calls():
            return np.asarray(array[begin:count])
    except Exception as fault:  # Each codec raises errors of its own.
        if interrupted(fault):
            raise KeyboardInterrupt from None
        if starved(fault):
            raise StorageError(f"{folder}: {NO_MEMORY}") from None
        size = array.chunks[0]
        for first in range(begin - begin % size, count, size):
            try:
                with zarr_calls():
                    array[first : first + size]
            except Exception:
                last = min(first + size, count) - 1
                rows = f"frames {first} to {last}" if name in ARRAYS else f"rows {first} to {last}"
                raise StorageError(
                    f"{folder}: a chunk of {name!r} is damaged ({rows}): {fault}. "
                    f"Earlier frames can be read in Python: read_run(folder, frames={first})."
                ) from None
        raise StorageError(f"{folder}: the array {name!r} cannot be read: {fault}") from None


def _check_frames(folder: Path, parts: dict[str, AnyArray], first: int) -> None:
    found = frame_checksums(parts)
    for at, row in enumerate(np.atleast_2d(found != parts["checksum"])):
        if row.any():
            name, k = [n for n in FRAME_PARTS[1:] if n in parts][int(np.argmax(row))], first + at
            raise StorageError(
                f"{folder}: frame {k} of {name!r} (t = {parts['time'][at]:.9g}) does not match its checksum; the file "
                f"was damaged. Earlier frames can be read in Python: read_run(folder, frames={k})."
            )


def _closest_of(data: list[Any] | None) -> Closest:
    if data is None:
        return Closest()
    return Closest(float(data[0]), float(data[1]), (data[2][0], data[2][1]), *(float(x) for x in data[3:]))
