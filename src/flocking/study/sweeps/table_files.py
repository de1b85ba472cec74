"""Tables of sweeps as files: CSV, and columns for Parquet."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path


def alike(column: Sequence[object]) -> Sequence[object]:
    """A column whose entries have one type: numbers of several types become floats.

    Parameters
    ----------
    column
        The entries; None where there is none.
    """
    kinds = {type(entry) for entry in column if entry is not None}
    if str in kinds:
        return [_encodable(entry) if isinstance(entry, str) else entry for entry in column]
    if len(kinds) < 2:
        return column
    return [float(entry) if isinstance(entry, bool | int | float) else None for entry in column]


def write_csv(path: Path, rows: Sequence[Mapping[str, object]], head: Sequence[str] | None = None) -> Path:
    """Write a table to the file ``path``, one line for each of ``rows``, under the names in ``head`` or their own.

    Raises
    ------
    StorageError
        When it cannot be written.
    """
    text = io.StringIO()
    names = list(rows[0]) if head is None else list(head)
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    for row in rows:
        writer.writerow(["" if row[name] is None else row[name] for name in names])
    return put(path, _encodable(text.getvalue()).encode())


def _encodable(text: str) -> str:
    """A text with what UTF-8 has no bytes for as escapes, as half a pair of surrogates in the message of an error."""
    return text.encode("utf-8", "backslashreplace").decode()


def put(path: Path, content: bytes) -> Path:
    """Write the content of a table to a file.

    Parameters
    ----------
    path, content
        The file, and its bytes.

    Raises
    ------
    StorageError
        When it cannot be written.
    """
    from flocking.engine.storage.atomic_files import write_file

    return write_file(path, content, "write the table")
