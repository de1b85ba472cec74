"""A sweep on disk: its record, written first, and chunks of rows, each appended atomically."""

from __future__ import annotations

import json
import re
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal, TypeGuard

from flocking.engine.storage import atomic_files
from flocking.engine.storage.left_overs import PARTIAL
from flocking.errors import StorageError, said
from flocking.study.sweeps.plan import LARGEST_COUNT
from flocking.study.sweeps.sampling import Sample
from flocking.study.sweeps.worker_tasks import LONGEST_MESSAGE, Row

FORMAT = 1
"""Version of the layout on disk; a reader refuses newer ones."""

RECORD = "sweep.json"
ROWS = "rows"
VERSIONS = "versions"
"""Name of the versions that made the rows of a chunk."""
SCENARIO: Literal["scenario"] = "scenario"
SCENARIOS = "scenarios"
"""Names of the digest of a row's scenario, and of those of a chunk by the numbers of their rows: older versions read no
more entries in a row.
"""
PLAN, RANGES, FIRST = "plan", "plan.sample.ranges", "plan.sample.first"
"""Places in a record: of what fixes the runs; of the ranges of drawn points, whose order fixes which column of a draw
is that of a parameter; and of the first of these points.
"""
MOST_DIFFERENCES, LONGEST_SHOWN = 20, 100
"""Differences that a message lists, and characters of each value: a message fits on a screen."""
LARGEST_FILE = 64 * 2**20
"""Bytes of a file of results that is read, a bound on memory: 64 MiB."""
_CHUNK = re.compile(r"\d{8}\.json")
_FIELDS = {"index", "status", "values", "verdicts", "message", "tries", "seconds"}


@contextmanager
def open_store(folder: Path, record: Mapping[str, object], sample: Sample | None = None) -> Iterator[Store]:
    """Open the store of a sweep, new or existing, for one writer.

    Parameters
    ----------
    folder
        The folder.
    record
        Record of the sweep.
    sample
        Its drawn points, where there are any.

    Raises
    ------
    StorageError
        When the folder cannot be used, holds other files or another sweep, or is being written.
    """
    with atomic_files.storage_errors(folder, "make the folder of the sweep", full=atomic_files.NOTHING_WRITTEN):
        folder.mkdir(parents=True, exist_ok=True)
        foreign = [p.name for p in folder.iterdir() if p.name not in (RECORD, ROWS, ".lock")]
    fresh = not (folder / RECORD).exists()
    if fresh and [name for name in foreign if not name.endswith(PARTIAL)]:
        raise StorageError(f"{folder}: holds other files already ({foreign[0]}). Choose an empty or new folder.")
    if (folder / ROWS).is_symlink():
        raise StorageError(f"{folder}: its {ROWS} is a link to elsewhere; nothing is written through it.")
    with (
        atomic_files.storage_errors(folder, "write the sweep", full=atomic_files.SWEEP_STAYS),
        atomic_files.only_writer(folder),
    ):
        if fresh:
            atomic_files.sweep(folder)
            atomic_files.put(folder / RECORD, _sealed(dict(record)))
            atomic_files.settle({folder})
        else:
            stored = read_record(folder)
            _compare(folder, stored, json.loads(json.dumps(record)))
            check_draws(folder, stored, sample)
            atomic_files.sweep(folder)
        yield Store(folder, record.get("provenance"))


class Store:
    """Rows of a sweep in its folder.

    Parameters
    ----------
    folder
        The folder, which `open_store` has prepared.
    versions
        Versions that make the rows which are appended.
    """

    def __init__(self, folder: Path, versions: object = None) -> None:
        self._rows = folder / ROWS
        self._versions = versions
        self._folder = folder
        with atomic_files.storage_errors(folder, "write the sweep", full=atomic_files.SWEEP_STAYS):
            self._rows.mkdir(exist_ok=True)
        numbers = [int(path.stem) for path in _chunks(folder)]
        self._next = max(numbers, default=-1) + 1

    def append(self, rows: Sequence[Row]) -> None:
        """Commit rows; they are on the disk when this returns.

        Raises
        ------
        StorageError
            When they cannot be written; earlier rows stay.
        """
        with atomic_files.storage_errors(self._folder, "write results of the sweep", full=atomic_files.SWEEP_STAYS):
            atomic_files.put(self._rows / f"{self._next:08d}.json", self._chunk(rows))
            atomic_files.settle({self._rows})
        self._next += 1

    def _chunk(self, rows: Sequence[Row]) -> bytes:
        plain = [{name: entry for name, entry in row.items() if name != SCENARIO} for row in rows]
        digests = {str(row["index"]): row[SCENARIO] for row in rows if SCENARIO in row}
        return _sealed({"rows": plain, VERSIONS: self._versions, SCENARIOS: digests})


def read_record(folder: Path) -> dict[str, Any]:
    """Record of a stored sweep.

    Raises
    ------
    StorageError
        When there is none, it is damaged, or a newer version wrote it.
    """
    path = folder / RECORD
    if not path.is_file():
        raise StorageError(f"{folder}: no sweep here. A sweep is a folder with a {RECORD}.")
    record = _opened(path, check_format=True)
    if record.get("format") != FORMAT or not isinstance(record.get("plan"), dict):
        raise StorageError(f"{path}: not the record of a sweep, or damaged.")
    return record


def read_rows(folder: Path, size: int) -> dict[int, Row]:
    """Committed rows by the number of their run; where a run has several, the first.

    Parameters
    ----------
    folder
        Folder of the sweep.
    size
        Number of runs of the sweep.

    Raises
    ------
    StorageError
        When a chunk is damaged.
    """
    found: dict[int, Row] = {}
    for path in _chunks(folder):
        chunk = _opened(path)
        rows, digests = chunk.get("rows"), chunk.get(SCENARIOS, {})
        if not isinstance(rows, list) or not all(_is_row(row, size) for row in rows) or not isinstance(digests, dict):
            raise _damaged(path)
        for row in rows:
            if isinstance(digest := digests.get(str(row["index"])), str) and digest:
                row[SCENARIO] = digest
            found.setdefault(row["index"], row)
    return found


def read_versions(folder: Path, record: Mapping[str, object]) -> list[object]:
    """Versions that made the committed rows, each once, in the order of their first rows.

    Parameters
    ----------
    folder
        Folder of the sweep.
    record
        Its record, which names the versions of rows that name none.

    Raises
    ------
    StorageError
        When a chunk is damaged.
    """
    found: list[object] = []
    for path in _chunks(folder):
        versions = _opened(path).get(VERSIONS) or record.get("provenance")
        if versions not in found:
            found.append(versions)
    return found


def _chunks(folder: Path) -> list[Path]:
    rows = folder / ROWS
    if rows.is_symlink() or not rows.is_dir():
        return []
    with atomic_files.storage_errors(folder, "read the sweep"):
        return sorted(path for path in rows.iterdir() if _CHUNK.fullmatch(path.name))


def _is_row(row: object, size: int) -> TypeGuard[Row]:
    if not isinstance(row, dict) or set(row) != _FIELDS:
        return False
    index, values, verdicts = row["index"], row["values"], row["verdicts"]
    return (
        type(index) is int and 0 <= index < size
        and row["status"] in ("ok", "failed")
        and isinstance(row["message"], str) and len(row["message"]) <= LONGEST_MESSAGE
        and type(row["tries"]) is int and abs(row["tries"]) <= LARGEST_COUNT and isinstance(row["seconds"], float)
        and isinstance(values, dict) and all(map(_is_value, values.values()))
        and isinstance(verdicts, dict) and all(isinstance(v, str) for v in verdicts.values())
    )  # fmt: skip


def _is_value(value: object) -> bool:
    return isinstance(value, bool | float) or (isinstance(value, int) and abs(value) <= LARGEST_COUNT)


def _sealed(data: Mapping[str, object]) -> bytes:
    body = json.dumps(data)
    return json.dumps({"body": body, "seal": zlib.crc32(body.encode())}).encode()


def _opened(path: Path, *, check_format: bool = False) -> dict[str, object]:
    try:
        if path.is_symlink() or not path.is_file() or path.stat().st_size > LARGEST_FILE:
            raise _damaged(path)
        outer = json.loads(path.read_bytes())
        body = outer["body"]
        intact = zlib.crc32(body.encode()) == outer["seal"]
        inner = json.loads(body)
    except OSError as error:
        raise StorageError(f"{path}: cannot be read: {error.strerror}.") from None
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise _damaged(path) from None
    if not intact or not isinstance(inner, dict):
        raise _damaged(path)
    if check_format and isinstance(inner.get("format"), int) and inner["format"] > FORMAT:
        raise StorageError(
            f"{path.parent}: written by a newer version of flocking "
            f"(format {said(inner['format'])}; this one reads {FORMAT}). Update flocking to read it."
        )
    return inner


def _damaged(path: Path) -> StorageError:
    if path.name == RECORD:
        return StorageError(f"{path}: the record of the sweep is damaged or not one.")
    return StorageError(
        f"{path}: these results are damaged. Other chunks are not affected; delete this file and run the sweep again "
        "to repeat its runs."
    )


def check_draws(folder: Path, record: Mapping[str, Any], sample: Sample | None) -> None:
    """Refuse results whose points other versions drew: rows name points by their numbers.

    Parameters
    ----------
    folder, record
        Folder of the sweep, and its record.
    sample
        Its drawn points as this version draws them.

    Raises
    ------
    StorageError
        When they are others than those that the record keeps.
    """
    if sample is not None and not sample.draws(record[PLAN]["sample"].get("first")):
        raise StorageError(
            f"{folder}: its points were drawn by other versions of flocking, NumPy or SciPy, which draw others from "
            "the same seed. Read it with the versions that it names, or choose another folder."
        )


def _compare(folder: Path, stored: Mapping[str, object], requested: Mapping[str, object]) -> None:
    """Refuse to mix two sweeps, naming everything in which they differ."""
    different = []
    for name in sorted({*stored, *requested} - {"provenance", "title"}):
        different += _differences(name, stored.get(name), requested.get(name))
    if different:
        lines = "\n".join(f"  {line}" for line in different[:MOST_DIFFERENCES])
        raise StorageError(
            f"{folder}: holds another sweep, which differs in:\n{lines}\n"
            "Choose another folder, or repeat the same call."
        )


def _differences(place: str, stored: object, asked: object) -> list[str]:
    if isinstance(stored, dict) and isinstance(asked, dict):
        found = []
        for name in dict.fromkeys([*stored, *asked]):
            found += _differences(f"{place}.{name}", stored.get(name), asked.get(name))
        if not found and place == RANGES and list(stored) != list(asked):
            found.append(f"order of {place}: stored {_shown(list(stored))}, asked for {_shown(list(asked))}")
        return found
    return [] if _same(place, stored, asked) else [f"{place}: stored {_shown(stored)}, asked for {_shown(asked)}"]


def _same(place: str, stored: object, asked: object) -> bool:
    """Whether two entries are equal; of a plan also in type: ranges of integers are drawn otherwise than of floats."""
    if place.startswith(f"{FIRST}.") or place == FIRST:
        # It follows from the rest, see `check_draws`.
        return True
    if place.partition(".")[0] != PLAN:
        return stored == asked
    # NaN, which is not equal to itself, is the same text.
    return json.dumps(stored, sort_keys=True) == json.dumps(asked, sort_keys=True)


def _shown(value: object) -> str:
    text = "nothing" if value is None else json.dumps(value)
    return text if len(text) <= LONGEST_SHOWN else text[: LONGEST_SHOWN - 3] + "..."
