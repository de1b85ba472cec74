"""Files of robots' logs: MCAP, as ``flocking nodes`` records it."""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from flocking.engine.storage.export_formats import missing_package
from flocking.errors import InvalidInput
from flocking.model.checks import Array
from flocking.study.sample_files.samples import (
    LARGEST_FILE,
    Columns,
    Samples,
    check_size,
    check_times,
    finite_array,
    reason,
)

if TYPE_CHECKING:
    from mcap.records import Chunk

TOPIC = "/state"
"""Topic whose messages are read: JSON with the time ``t`` and the rows of ``q`` and, where there are any, of ``p``."""


MOST_RECORDS = 1_000_000
"""Records of a file, those within its chunks included: a bound on the time that reading takes."""

RECORD_HEAD = struct.Struct("<BQ")
"""Kind of a record and bytes of its content, which follow."""


def read_mcap(path: Path, columns: Columns) -> Samples:
    """Read the frames of an MCAP file.

    Parameters
    ----------
    path
        The file.
    columns
        Names of the fields ``t``, ``q`` and ``p`` of its messages.

    Raises
    ------
    StorageError
        When the package mcap is missing.
    InvalidInput
        When it is no finished MCAP file, has no such messages, or their values are not of this form.
    """
    columns.check_names(("t", "q", "p"))
    try:
        # Chunks are compressed by one of the other two, or not at all.
        import lz4.frame  # noqa: F401
        import mcap.exceptions
        import zstandard  # noqa: F401
    except ImportError as error:
        raise missing_package(str(error.name).split(".")[0], "MCAP", "nodes") from None
    rows: dict[str, list[Array]] = {}
    names: list[str] = []
    try:
        for data in _messages(path):
            found = json.loads(data)
            if not isinstance(found, dict):
                raise ValueError(f"a message of {TOPIC} is no object")
            if not rows:
                names = list(found)
                for ours in ("t", "q"):
                    if columns.name(ours) not in names:
                        raise columns.missing(ours, names)
                rows = {ours: [] for ours in ("t", "q", "p") if columns.present(ours, names)}
            # Lists of Python take many times the memory of their text: those of one message are held at a time.
            for ours, arrays in rows.items():
                arrays.append(_numbers(path, columns.name(ours), found))
    except InvalidInput:
        raise
    except (
        mcap.exceptions.McapError, ValueError, OSError, RuntimeError, LookupError, TypeError, EOFError, MemoryError,
        OverflowError, struct.error, *_decompression_errors(),
    ) as error:  # fmt: skip
        raise InvalidInput(str(path), "file", f"must be a finished MCAP file ({reason(error)})", path.name) from None
    if not rows:
        raise InvalidInput(str(path), "file", f"must have messages of the topic {TOPIC}", "none")

    def values(ours: str, axes: int) -> Array:
        name = columns.name(ours)
        shapes = {array.shape for array in rows[ours]}
        if len(shapes) > 1:
            said = (
                f"must be numbers of one shape in all messages (shapes are {', '.join(map(str, sorted(shapes)[:3]))})"
            )
            raise InvalidInput(str(path), name, said, name)
        return finite_array(path, name, np.array(rows[ours]), axes)

    t, q = values("t", 1), values("q", 3)
    p = values("p", 3) if "p" in rows else None
    if p is not None and p.shape != q.shape:
        raise InvalidInput(str(path), columns.name("p"), f"must have the shape of q, {q.shape}", p.shape)
    check_times(path, t, f"field {columns.name('t')}")
    return Samples(t, q, p, tuple(map(str, range(q.shape[1]))), unused=columns.unused(rows, names))


def _numbers(path: Path, name: str, message: Mapping[str, object]) -> Array:
    try:
        found = np.array(message[name])
        # Texts that look like numbers, and truth values, are none.
        if found.dtype.kind not in "fiu":
            raise TypeError(f"it holds {found.dtype.name}")
        return np.asarray(found, dtype=np.float64)
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        said = f"must be numbers of one shape in all messages ({reason(error)})"
        raise InvalidInput(str(path), name, said, name) from None


def _messages(path: Path) -> list[bytes]:
    """The messages of the topic in order of their times; no more is unpacked than `LARGEST_FILE`."""
    from mcap.records import Channel, Chunk, Message
    from mcap.stream_reader import StreamReader, breakup_chunk

    channels: dict[int, Channel] = {}
    found: list[tuple[int, bytes]] = []
    size = count = 0
    with path.open("rb") as file:
        for record in StreamReader(file, emit_chunks=True, validate_crcs=True, record_size_limit=LARGEST_FILE).records:
            parts = [record]
            count += 1
            if isinstance(record, Chunk):
                size += record.uncompressed_size
                check_size(path, size, "its messages unpacked")
                record = _unpacked(record)
                count += _records(record.data, MOST_RECORDS - count)
                parts = breakup_chunk(record, validate_crc=True) if count <= MOST_RECORDS else []
            if count > MOST_RECORDS:
                raise ValueError(f"it has more than {MOST_RECORDS} records")
            for part in parts:
                if isinstance(part, Channel):
                    channels[part.id] = part
                elif isinstance(part, Message) and channels[part.channel_id].topic == TOPIC:
                    encoding = channels[part.channel_id].message_encoding
                    if encoding != "json":
                        raise ValueError(f"messages of {TOPIC} are {encoding}, not JSON")
                    found.append((part.log_time, part.data))
    return [data for _, data in sorted(found, key=lambda message: message[0])]


def _records(data: bytes, most: int) -> int:
    """Number of records in a chunk without compression, counted up to one more than ``most``."""
    place = found = 0
    while place + RECORD_HEAD.size <= len(data) and found <= most:
        place += RECORD_HEAD.size + RECORD_HEAD.unpack_from(data, place)[1]
        found += 1
    return found


def _unpacked(chunk: Chunk) -> Chunk:
    """A chunk without compression, of the size that it declares: the package's own reader has no bound."""
    most = chunk.uncompressed_size + 1
    if chunk.compression == "zstd":
        import zstandard

        with zstandard.ZstdDecompressor().stream_reader(chunk.data) as stream:
            data = stream.read(most)
    elif chunk.compression == "lz4":
        import lz4.frame

        data = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=most)
    elif not chunk.compression:
        data = chunk.data
    else:
        raise ValueError(f"compression {chunk.compression!r} is not known")
    if len(data) != chunk.uncompressed_size:
        raise ValueError(f"a chunk is not of the {chunk.uncompressed_size} bytes that it declares")
    return replace(chunk, compression="", data=data)


def _decompression_errors() -> tuple[type[Exception], ...]:
    """The error of zstandard, a class of its own; lz4 raises ``RuntimeError``."""
    from zstandard import ZstdError

    return (ZstdError,)
