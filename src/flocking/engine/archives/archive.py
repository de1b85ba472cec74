"""Arrays and a JSON text in one file, read without trusting the sizes that the file states."""

from __future__ import annotations

import io
import json
import lzma
import struct
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO, cast

import numpy as np

from flocking.arrays import AnyArray
from flocking.engine.archives.data_checks import MalformedError
from flocking.errors import HEADER_ERRORS

Arrays = dict[str, AnyArray]
"""Arrays by name."""

NUMBERS = "numbers"
"""Name of the array that holds the JSON text."""

PLAIN = "biuf"
"""NumPy kinds that arrays may have: truth values, integers and floating-point numbers."""

NPZ_ERRORS = (*HEADER_ERRORS, EOFError, zipfile.BadZipFile, zlib.error, lzma.LZMAError, struct.error)
"""What NumPy raises for ``.npz`` files that are damaged or crafted."""

UNREADABLE = (
    *NPZ_ERRORS, KeyError, TypeError, IndexError, AttributeError, ArithmeticError, OSError, NotImplementedError,
)  # fmt: skip
"""Errors of reading data that are no archive, or another one."""


def write_archive(file: BinaryIO, numbers: Mapping[str, object], arrays: Arrays) -> None:
    """Write ``numbers``, plain data for JSON, and ``arrays`` by name as an ``.npz`` file."""
    text = json.dumps(numbers, default=lambda x: x.item()).encode()
    named: dict[str, AnyArray] = {NUMBERS: np.frombuffer(text, dtype=np.uint8), **arrays}
    np.savez(file, allow_pickle=False, **named)


def read_archive(data: bytes | Path) -> tuple[dict[str, Any], Arrays]:
    """Numbers and arrays of an ``.npz`` file; nothing is decompressed, no array is larger than its part of the file.

    Parameters
    ----------
    data
        The file, or its bytes.

    Raises
    ------
    MalformedError, ValueError, KeyError, OSError, EOFError, RecursionError, zipfile.BadZipFile
        When it is no such file.
    """
    with zipfile.ZipFile(io.BytesIO(data) if isinstance(data, bytes) else data) as file:
        arrays = {entry.filename.removesuffix(".npy"): _array(file, entry) for entry in file.infolist()}
    numbers = json.loads(arrays.pop(NUMBERS).tobytes())
    if not isinstance(numbers, dict):
        raise MalformedError("the numbers must have names")
    return numbers, arrays


def _array(file: zipfile.ZipFile, entry: zipfile.ZipInfo) -> AnyArray:
    if entry.compress_type != zipfile.ZIP_STORED:
        raise MalformedError(f"{entry.filename} must not be compressed")
    with file.open(entry) as part:
        version = np.lib.format.read_magic(part)
        read = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
        shape, columns, dtype = read[version](part)
        if dtype.kind not in PLAIN or dtype.hasobject:
            raise MalformedError(f"{entry.filename} must hold plain numbers, not {dtype}")
        begin, count = part.tell(), 1
        for length in shape:
            count *= length
        if begin + count * dtype.itemsize != entry.file_size:
            raise MalformedError(f"{entry.filename} states that it holds {count} numbers, and does not")
        values = np.empty(count, dtype)
        if count:
            room, source = memoryview(values.view(np.uint8).data), io.BufferedReader(cast(io.RawIOBase, part))
            while len(room) and (read_now := source.readinto(room)):
                room = room[read_now:]
            if len(room):
                raise MalformedError(f"{entry.filename} ends too early")
    if dtype.kind == "b" and count and values.view(np.uint8).max() > 1:
        raise MalformedError(f"{entry.filename} must hold truth values, 0 or 1")
    return values.reshape(shape[::-1]).T if columns else values.reshape(shape)
