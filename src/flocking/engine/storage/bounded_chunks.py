"""Chunks of runs from others: each is unpacked only when it comes to no more than its array declares."""

from __future__ import annotations

import asyncio
import math
import struct
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from flocking.engine.runs.columns import LARGEST_CHUNK
from flocking.engine.storage.regular_files import bounded_content

if TYPE_CHECKING:
    from zarr.core.buffer import Buffer, BufferPrototype
    from zarr.storage import LocalStore

COMPRESSORS = ("gzip", "zstd")
"""Codecs whose output may be any number of times larger than their input."""
LARGEST_TEXTS = 2 * LARGEST_CHUNK
"""Bytes of a chunk of texts once it is unpacked: as many as any other chunk may have."""
LARGEST_FILE = 4 * LARGEST_CHUNK
"""Bytes of a file without a bound of its own: twice what a chunk may have."""
ADDED, ADDED_SHARE = 2**10, 128
"""Bytes, and the share of a chunk, that packing may add to one that cannot be made smaller: zstd adds a 256th and a few
bytes, gzip less, crc32c four bytes."""
PIECE = 2**20
"""Bytes that are unpacked at once to count them: small beside a chunk."""
ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
_ID_BYTES, _SIZE_FORMS = (0, 1, 2, 4), ("<B", "<H", "<I", "<Q")
_SMALL_TWO_BYTES = 256
"""RFC 8878, 3.1.1.1.4: a size of two bytes counts from 256."""


class Bound(NamedTuple):
    """Most bytes of a chunk once it is unpacked, and the codec that unpacks it; empty where it is not packed."""

    size: int
    compressor: str


def bounds_of(arrays: Mapping[str, Mapping[str, Any]]) -> dict[str, Bound]:
    """Bounds of the chunks of each array.

    Parameters
    ----------
    arrays
        Checked metadata of arrays by name, see `flocking.engine.storage.metadata.check_metadata`.
    """
    found = {}
    for name, data in arrays.items():
        size = LARGEST_TEXTS
        if data["data_type"] != "string":
            shape = data["chunk_grid"]["configuration"]["chunk_shape"]
            size = math.prod(shape) * np.dtype(data["data_type"]).itemsize
        packed = [codec["name"] for codec in data["codecs"] if codec["name"] in COMPRESSORS]
        found[name] = Bound(size, packed[0] if packed else "")
    return found


def bounded_store(bounds: Mapping[str, Bound]) -> type[LocalStore]:
    """The class of Zarr stores that read regular files alone, and chunks that unpack to no more than their bound.

    Parameters
    ----------
    bounds
        Bounds of the chunks of each array, see `bounds_of`; chunks of others are bounded as files alone.
    """
    from zarr.core.buffer import default_buffer_prototype
    from zarr.storage import LocalStore

    class BoundedStore(LocalStore):  # type: ignore[misc]
        """LocalStore whose files are checked before they are unpacked."""

        def get_sync(
            self, key: str, *, prototype: BufferPrototype | None = None, byte_range: object = None
        ) -> Buffer | None:
            """Content of one file."""
            if byte_range is not None:
                raise ValueError("chunks are read as a whole")
            data = _content(self.root / key, None if key.endswith("zarr.json") else bounds.get(key.partition("/")[0]))
            return None if data is None else (prototype or default_buffer_prototype()).buffer.from_bytes(data)

        async def get(
            self, key: str, prototype: BufferPrototype | None = None, byte_range: object = None
        ) -> Buffer | None:
            """Content of one file."""
            return await asyncio.to_thread(self.get_sync, key, prototype=prototype, byte_range=byte_range)

    return BoundedStore


def _content(path: Path, bound: Bound | None) -> bytes | None:
    """Content of a file, and None where there is none: Zarr fills in what was never written."""
    most = LARGEST_FILE if bound is None else bound.size + bound.size // ADDED_SHARE + ADDED
    try:
        data = bounded_content(path, most)
    except (FileNotFoundError, IsADirectoryError, NotADirectoryError):
        return None
    if bound is not None:
        check_unpacked(data, bound)
    return data


def check_unpacked(data: bytes, bound: Bound) -> None:
    """Refuse a packed chunk that would come to more bytes than its ``bound``; it is not unpacked as a whole.

    Raises
    ------
    ValueError
        If it would, or does not state how many.
    """
    if bound.compressor == "zstd":
        size = _declared_by_zstd(data)
    elif bound.compressor == "gzip":
        size = _counted_of_gzip(data, bound.size)
    else:
        return
    if size > bound.size:
        raise ValueError(f"unpacked it is larger than the {bound.size} bytes of a chunk")


def _declared_by_zstd(data: bytes) -> int:
    """Size that the first frame declares, RFC 8878, 3.1.1.1; Zarr allots it and refuses frames of other sizes."""
    if data[:4] != ZSTD_MAGIC or len(data) < 5:
        raise ValueError("it is not packed by zstd")
    how = data[4]
    kind, single = how >> 6, how >> 5 & 1
    begin = 5 + (not single) + _ID_BYTES[how & 3]
    if kind == 0 and not single:
        raise ValueError("it does not declare its size")
    try:
        (size,) = struct.unpack_from(_SIZE_FORMS[kind], data, begin)
    except struct.error:
        raise ValueError("it ends too early") from None
    return int(size) + (_SMALL_TWO_BYTES if kind == 1 else 0)


def _counted_of_gzip(data: bytes, most: int) -> int:
    """Bytes of all members, counted no further than just beyond ``most``."""
    size, rest = 0, data
    while rest and size <= most:
        unpacking = zlib.decompressobj(zlib.MAX_WBITS | 16)
        try:
            piece = unpacking.decompress(rest, PIECE)
            size += len(piece)
            while not unpacking.eof and size <= most and (piece or unpacking.unconsumed_tail):
                piece = unpacking.decompress(unpacking.unconsumed_tail, PIECE)
                size += len(piece)
        except zlib.error:
            return size  # Zarr reports what is wrong with it.
        if not unpacking.eof:
            return size
        rest = unpacking.unused_data
    return size
