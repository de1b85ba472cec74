"""Tables with one row per agent and time: CSV and Parquet."""

from __future__ import annotations

import csv
import math
from array import array as buffer
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import AnyArray
from flocking.engine.storage.export_formats import missing_package
from flocking.errors import InvalidInput
from flocking.formula.safe_digits import given_text
from flocking.model.checks import Array
from flocking.study.sample_files.samples import (
    LARGEST_FILE,
    Columns,
    Samples,
    check_size,
    check_times,
    number,
    reason,
    storage_rounding,
)
from flocking.study.sample_files.written_digits import WrittenDigits, written_rounding

if TYPE_CHECKING:
    from _csv import Reader

TABLE_COLUMNS = ("t", "id", "x", "y", "z", "vx", "vy", "vz")
"""Columns of a table: time, agent, position and velocity by axis."""


SEPARATORS = {";": "semicolons", "\t": "tabulators", "|": "vertical bars"}
"""Signs that other programs write between columns."""


def read_csv(path: Path, columns: Columns) -> Samples:
    """Read a CSV table, line by line.

    Parameters
    ----------
    path
        The file; UTF-8, with a header.
    columns
        Names of its columns.

    Raises
    ------
    InvalidInput
        When a column is missing, a value is not a number, or an agent has no row or two rows at a time. The message
        names the line and the column.
    """
    columns.check_names(TABLE_COLUMNS)
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            return _read_lines(path, csv.reader(file, strict=True), columns)
    except UnicodeDecodeError as error:
        raise InvalidInput(str(path), "file", "must be UTF-8 text", f"byte {error.object[error.start]:#x}") from None
    except (OSError, csv.Error) as error:
        raise InvalidInput(str(path), "file", f"must be a CSV table ({reason(error)})", path.name) from None


def _read_lines(path: Path, lines: Reader, columns: Columns) -> Samples:
    header = [name.strip() for name in next(lines, [])]
    if not header:
        raise InvalidInput(str(path), "file", "must have a header, and a row per agent and time", "an empty line")
    other = next((sign for sign in SEPARATORS if sign in header[0]), "") if len(header) == 1 else ""
    if other:
        fix = "Write the table with commas between columns, and points in numbers."
        raise InvalidInput(str(path), "line 1, columns", "must be separated by commas", SEPARATORS[other], fix)
    _check_names(path, "line 1, columns", header)
    axes, speeds = _axes(columns, header)
    needed = ["t", *axes, *speeds]
    places = [header.index(columns.name(ours)) for ours in needed]
    agent_place = header.index(columns.name("id"))
    values, numbers, agents, known = buffer("d"), buffer("q"), buffer("q"), dict[str, int]()
    # Times have a format of their own.
    written = [WrittenDigits() for _ in (*axes, *speeds)]
    for row in lines:
        if not row:
            continue
        if len(row) != len(header):
            raise InvalidInput(str(path), f"line {lines.line_num}", f"must have {len(header)} columns", len(row))
        for ours, place in zip(needed, places, strict=True):
            values.append(number(path, lines.line_num, columns.name(ours), row[place]))
        for digits, place in zip(written, places[1:], strict=True):
            if not digits.complete:
                digits.add(row[place])
        label = row[agent_place].strip()
        if not label:
            raise InvalidInput(
                str(path), f"line {lines.line_num}, column {columns.name('id')}", "must name an agent", "nothing"
            )
        agents.append(known.setdefault(label, len(known)))
        numbers.append(lines.line_num)
        if len(values) * values.itemsize > LARGEST_FILE:
            check_size(path, len(values) * values.itemsize, f"the numbers up to line {lines.line_num}")
    table = np.frombuffer(values, dtype=np.float64).reshape(-1, len(needed)) if values else np.zeros((0, len(needed)))
    rows = np.array(numbers, dtype=np.int64)
    samples = _pivoted(path, columns, table, np.array(agents, dtype=np.int64), list(known), rows, len(axes), "line")
    largest, m = np.abs(table[:, 1:]).max(axis=0, initial=0.0).tolist(), len(axes)
    rounding = written_rounding(written[:m], largest[:m]), written_rounding(written[m:], largest[m:])
    return replace(samples, rounding=rounding, unused=columns.unused([*needed, "id"], header))


def read_parquet(path: Path, columns: Columns) -> Samples:
    """Read a Parquet table; only the columns that are needed are read.

    Parameters
    ----------
    path
        The file.
    columns
        Names of its columns.

    Raises
    ------
    StorageError
        When the package pyarrow is missing.
    InvalidInput
        As `read_csv`; rows count from 1.
    """
    columns.check_names(TABLE_COLUMNS)
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError:
        raise missing_package("pyarrow", "Parquet") from None
    try:
        with parquet.ParquetFile(path) as file:
            schema = file.schema_arrow
            names = [str(name) for name in schema.names]
            _check_names(path, "columns", names)
            axes, speeds = _axes(columns, names)
            needed = ["t", *axes, *speeds]
            check_size(path, file.metadata.num_rows * 8 * (len(needed) + 1), "its columns")
            groups = [file.metadata.row_group(k) for k in range(file.metadata.num_row_groups)]
            check_size(path, sum(max(group.total_byte_size, 0) for group in groups), "its columns unpacked")
        kinds = [(name, schema.types[names.index(name)]) for name in map(columns.name, (*needed, "id"))]
        for name, kind in kinds[:-1]:
            if not _is_number(kind):
                raise InvalidInput(str(path), f"column {name}", "must hold numbers", str(kind))
        if not _is_label(kinds[-1][1]):
            said = "must name agents by numbers or texts"
            raise InvalidInput(str(path), f"column {kinds[-1][0]}", said, str(kinds[-1][1]))
        # A label that many rows repeat is held once.
        with parquet.ParquetFile(path, read_dictionary=[columns.name("id")]) as file:
            found = file.read(columns=[name for name, _ in kinds])
        labels = found.column(columns.name("id")).dictionary_encode().combine_chunks()
        listed = labels.dictionary.to_pylist()
    except InvalidInput:
        raise
    except (pyarrow.ArrowException, OSError, MemoryError, LookupError, ValueError, OverflowError) as error:
        raise InvalidInput(str(path), "file", f"must be a Parquet table ({reason(error)})", path.name) from None
    stored = {ours: found.column(columns.name(ours)).to_numpy() for ours in needed}
    numbers = [
        _parquet_column(path, columns.name(ours), values, found.column(columns.name(ours)).type)
        for ours, values in stored.items()
    ]
    place, speed = (max((storage_rounding(stored[k]) for k in names), default=0.0) for names in (axes, speeds))
    known: dict[str, int] = {}
    numbered = np.array([known.setdefault(str(x), len(known)) for x in listed], dtype=np.int64)
    # No name, an empty one, and what stands for a missing number.
    nameless = [not x.strip() if isinstance(x, str) else isinstance(x, float) and math.isnan(x) for x in listed]
    missing = labels.is_null().to_numpy(zero_copy_only=False)
    if any(nameless):
        missing = missing | np.isin(labels.indices.to_numpy(zero_copy_only=False), np.flatnonzero(nameless))
    if missing.any():
        row = int(np.flatnonzero(missing)[0])
        raise InvalidInput(str(path), f"row {row + 1}, column {columns.name('id')}", "must name an agent", "nothing")
    agents = numbered[labels.indices.to_numpy()]
    rows = np.arange(1, len(agents) + 1)
    samples = _pivoted(path, columns, np.stack(numbers, axis=1), agents, list(known), rows, len(axes), "row")
    return replace(samples, rounding=(place, speed), unused=columns.unused([*needed, "id"], names))


def _check_names(path: Path, where: str, names: list[str]) -> None:
    for name, times in Counter(names).items():
        if times > 1:
            raise InvalidInput(str(path), where, "must have different names", name)


def _is_number(kind: object) -> bool:
    """Whether a type of Arrow is one of numbers, or of a dictionary of numbers."""
    from pyarrow import types

    plain = kind.value_type if types.is_dictionary(kind) else kind  # type: ignore[attr-defined]
    return bool(types.is_integer(plain) or types.is_floating(plain))


def _is_label(kind: object) -> bool:
    """Whether a type of Arrow names agents; Python has no times of nanoseconds, and not every place on the clock."""
    from pyarrow import types

    plain = kind.value_type if types.is_dictionary(kind) else kind  # type: ignore[attr-defined]
    views = getattr(types, "is_string_view", types.is_string)  # Arrow has them since version 16.
    texts = (types.is_string, types.is_large_string, views, types.is_boolean, types.is_decimal)
    return _is_number(plain) or any(is_one(plain) for is_one in texts)


def _parquet_column(path: Path, name: str, values: AnyArray, kind: object) -> Array:
    if values.dtype.kind not in "fiu":
        raise InvalidInput(str(path), f"column {name}", "must hold numbers", str(kind))
    found = values.astype(np.float64)
    wrong = np.flatnonzero(~np.isfinite(found))
    if len(wrong):
        row = int(wrong[0])
        raise InvalidInput(str(path), f"row {row + 1}, column {name}", "must be a finite number", float(found[row]))
    return np.asarray(found)


def _axes(columns: Columns, found: list[str]) -> tuple[list[str], list[str]]:
    """Our names of the position columns and of the velocity columns that a table has."""
    for ours in ("t", "id", "x"):
        if columns.name(ours) not in found:
            raise columns.missing(ours, found)
    axes = [axis for axis in "xyz" if columns.present(axis, found)]
    if axes == ["x", "z"]:
        raise columns.missing("y", found)
    speeds = [f"v{axis}" for axis in "xyz" if columns.present(f"v{axis}", found)]
    for axis in axes if speeds else []:
        if f"v{axis}" not in speeds:
            raise columns.missing(f"v{axis}", found)
    for speed in speeds:
        if speed[1:] not in axes:
            raise columns.missing(speed[1:], found)
    return axes, speeds


def _pivoted(
    path: Path, columns: Columns, table: Array, agents: NDArray[np.int64], names: list[str],
    rows: NDArray[np.int64], m: int, place: str,
) -> Samples:  # fmt: skip
    """Arrays by time and agent from the rows of a table."""
    order = sorted(range(len(names)), key=lambda k: (len(names[k]), names[k]))
    rank = np.empty(len(names), dtype=np.int64)
    rank[order] = np.arange(len(names))
    agents = rank[agents]
    times, frame = np.unique(table[:, 0], return_inverse=True)
    key = frame.reshape(-1) * len(names) + agents
    used, first = np.unique(key, return_index=True)
    time_name = columns.name("t")
    if len(used) < len(key):
        twice = int(np.setdiff1d(np.arange(len(key)), first)[0])
        who, when = names[order[agents[twice]]], given_text(table[twice, 0])
        raise InvalidInput(
            str(path), f"{place} {rows[twice]}, columns {columns.name('id')} and {time_name}",
            "must give every agent one row per time", f"{who} at {when} again",
        )  # fmt: skip
    check_times(path, times, f"column {time_name}")
    if len(used) < len(times) * len(names):
        gap = int(np.argmax(np.append(used, -1) != np.arange(len(used) + 1)))
        raise InvalidInput(
            str(path), f"columns {columns.name('id')} and {time_name}", "must give every agent a row at every time",
            f"none of {names[order[gap % len(names)]]} at {given_text(times[gap // len(names)])}",
            "Interpolate to common times, or remove agents without a place at some times.",
        )  # fmt: skip
    shape = (len(times), len(names), m)
    q = table[first, 1 : 1 + m].reshape(shape)
    p = table[first, 1 + m :].reshape(shape) if table.shape[1] > 1 + m else None
    return Samples(times, q, p, tuple(names[k] for k in order))
