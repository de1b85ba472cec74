"""The record of a run on disk: the content of its last commit, with a checksum."""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from flocking.engine.archives.data_checks import MalformedError
from flocking.engine.storage.atomic_files import put, settle
from flocking.engine.storage.metadata import check_metadata
from flocking.engine.storage.regular_files import LARGEST_RECORD, bounded_content
from flocking.errors import StorageError, said

FORMAT = 2
"""Version of the layout on disk; a reader refuses newer ones. Runs of format 1 contain no errors of frames."""

FIRST_ENGINE = "exact"
"""Engine of stored runs without the name of one, from versions with a single engine."""

RECORD = "zarr.json"
SCENARIO = "scenario.json"
COPIED = "copied"
"""Key in the session of a run that was computed before it was written: an engine does not begin it anew."""
UNFINISHED = "unfinished"
"""Status of a run whose end was not recorded: it is running, or was killed."""


def read_root(folder: Path) -> Any:
    """Zarr's metadata of a whole run, with the attributes of this library: JSON data that nothing has checked."""
    return json.loads(bounded_content(folder / RECORD, LARGEST_RECORD))


def read_record(folder: str | Path) -> dict[str, Any]:
    """Record of the last commit of a run: its status, counts, checksums and checkpoint.

    Raises
    ------
    StorageError
        If there is no run, its record is damaged, or a newer version wrote it.
    """
    folder = Path(folder)
    path = folder / RECORD
    try:
        root = read_root(folder)
        record = root["attributes"]["flocking"]
    except (FileNotFoundError, NotADirectoryError):
        raise StorageError(f"{folder}: not a run. A run is a folder with the file {RECORD}.") from None
    except OSError as error:
        raise StorageError(f"{folder}: cannot read the run: {error.strerror}.") from None
    except (ValueError, KeyError, TypeError, RecursionError):
        raise StorageError(f"{path}: not the record of a run; the file is damaged or foreign.") from None
    if not isinstance(record, dict) or not isinstance(record.get("format"), int):
        raise StorageError(f"{path}: not the record of a run; the file is damaged or foreign.")
    if record["format"] > FORMAT:
        raise StorageError(
            f"{folder}: written by a newer version of flocking "
            f"(format {said(record['format'])}; this one reads {FORMAT}). Update flocking to read it."
        )
    if record.pop("seal", None) != _seal(root):
        raise StorageError(f"{path}: the record of the run does not match its checksum; the file was damaged.")
    try:
        check_metadata(root, record)
    except MalformedError as error:
        raise StorageError(f"{path}: not a run that this version can read: {error}.") from None
    return record


def read_provenance(folder: Path) -> dict[str, Any]:
    """Provenance of a run as of its last commit."""
    read_record(folder)
    return dict(read_root(folder)["attributes"].get("provenance", {}))


def engine_of(folder: Path) -> tuple[str, str]:
    """Name of the engine of a run, and its package; empty if the run does not state it."""
    session = read_record(folder).get("session") or {}
    name = read_provenance(folder).get("engine") or session.get("engine") or FIRST_ENGINE
    return str(name), str(session.get("package", ""))


def goes_on(record: Mapping[str, object]) -> bool:
    """Whether an unfinished run can continue: from a checkpoint, or from its start as long as nothing was committed.

    Parameters
    ----------
    record
        The record of its last commit.
    """
    session = record.get("session")
    copied = isinstance(session, Mapping) and COPIED in session
    return record["checkpoint"] is not None or not (record["commits"] or copied)


def write_record(folder: Path, record: dict[str, Any], provenance: Mapping[str, object]) -> None:
    """Replace the record of a run, its ``provenance`` and the shapes that a reader finds, atomically."""
    metadata = {name: json.loads((folder / name / RECORD).read_bytes()) for name in record["arrays"]}
    for data in metadata.values():
        # Rows that are not committed must not be visible, so shapes are those of the commit.
        if (first := data["dimension_names"][0]) in record["counts"]:
            data["shape"][0] = record["counts"][first]
    root: dict[str, Any] = {
        "zarr_format": 3, "node_type": "group",
        "attributes": {
            "title": record["title"], "provenance": json.loads(json.dumps(provenance, default=str)), "flocking": record,
        },
        "consolidated_metadata": {"kind": "inline", "must_understand": False, "metadata": metadata},
    }  # fmt: skip
    root["attributes"]["flocking"] = {**record, "seal": _seal(root)}
    put(folder / RECORD, json.dumps(root).encode())
    settle({folder})


def _seal(root: Mapping[str, object]) -> int:
    """Checksum of the content of the file."""
    return zlib.crc32(json.dumps(root, sort_keys=True).encode())
