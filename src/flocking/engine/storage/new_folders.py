"""What a new run needs before its first frame: a free folder, and its scenario as text."""

from __future__ import annotations

import json
import zlib
from pathlib import Path

import numpy as np

from flocking.engine.storage.atomic_files import NOTHING_WRITTEN, storage_errors
from flocking.engine.storage.record import RECORD
from flocking.errors import InvalidInput, StorageError
from flocking.model.law import Law, Scenario
from flocking.model.serial import ForeignPart, to_data
from flocking.model.terms.schedules import Schedule


def check_path(owner: str, name: str, path: object) -> None:
    """Check that a place to write to is named by a path.

    Parameters
    ----------
    owner, name
        The function and its parameter, for the message.
    path
        What was given.

    Raises
    ------
    InvalidInput
        If it is no path.
    """
    if not isinstance(path, str | Path):
        raise InvalidInput(owner, name, "must be a path", path, "Give a text or a pathlib.Path.")


def check_free(folder: Path) -> None:
    """Check that a folder is empty or missing.

    Raises
    ------
    StorageError
        If it is not empty, or cannot be read.
    """
    with storage_errors(folder, "create the run", full=NOTHING_WRITTEN):
        if (folder / RECORD).exists():
            raise StorageError(
                f"{folder}: contains a run. Choose another folder, continue it with `flocking resume`, or delete it."
            )
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise StorageError(f"{folder}: not an empty folder. Choose another one; nothing is ever overwritten.")


def scenario_text(scenario: Scenario, plant: Law | None) -> tuple[bytes, str | None]:
    """Scenario and plant as JSON, or ``null`` and the reason where a part is from outside this library.

    Parameters
    ----------
    scenario
        The scenario.
    plant
        The law that agents follow, if it differs from that of the scenario.
    """
    try:
        return json.dumps(to_data([scenario, plant])).encode(), None
    except ForeignPart as error:
        return b"null", str(error)


def law_sum(law: Law) -> int:
    """Checksum of the parts of a law and their numbers, by which one that could not be stored is known again.

    Formulas of parts from outside this library have no text: their classes stand for them.
    """
    rows = [[type(x).__name__, {name: _plain(v) for name, v in sorted(x.parameters.items())}] for x in law.terms]
    radii = [[type(g).__name__, _plain(g.appear_radius), _plain(g.break_radius)] for g in law.graphs]
    return zlib.crc32(json.dumps([rows, radii]).encode())


def _plain(value: object) -> object:
    """Numbers of a parameter as a list; of another one the name of its class, of gains that change all they have."""
    if isinstance(value, Schedule):
        return [_plain(value.times), *(_plain(x) for x in value.values)]
    try:
        return np.asarray(value, dtype=np.float64).tolist()
    except (TypeError, ValueError):
        return type(value).__name__
