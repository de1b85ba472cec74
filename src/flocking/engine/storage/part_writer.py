"""Chunks of the frames of a run that several processes write, each those of its agents."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import Times
from flocking.engine.runs.columns import COLUMN
from flocking.engine.runs.frame_parts import FramePart
from flocking.engine.storage.atomic_files import atomic_store, checksum, settle, storage_errors
from flocking.engine.storage.joined_checksums import joined
from flocking.engine.storage.record import RECORD
from flocking.engine.storage.zarr_thread import zarr_calls

PartSums = dict[str, tuple[int, int]]
"""CRC-32 and number of bytes of one part of a frame, by the name of its array."""


def sees(folder: Path, record: int) -> bool:
    """Whether this process can read a run that another one writes.

    Parameters
    ----------
    folder
        The folder of the run.
    record
        Checksum of its record, as the other process reads it.
    """
    try:
        return checksum(folder / RECORD) == record
    except OSError:
        return False


def joined_sums(t: Times, written: Sequence[Sequence[PartSums]], columns: int) -> tuple[NDArray[np.uint32], int]:
    """Checksums of whole frames, as of frames that one process writes, and of all further columns until then.

    Parameters
    ----------
    t
        Times of the frames.
    written
        What `write_parts` gave in each process, in the order of the agents.
    columns
        Checksum of the further columns of all frames before.
    """
    found = np.empty((len(t), 2), np.uint32)
    for frame, time in enumerate(t):
        q = zlib.crc32(time.tobytes())
        p = 0
        for sums in written:
            q, p = joined(q, *sums[frame]["position"]), joined(p, *sums[frame]["velocity"])
            columns = joined(columns, *sums[frame].get(COLUMN, (0, 0)))
        found[frame] = q, p
    return found, columns


def write_parts(folder: Path, parts: Sequence[FramePart], frame: int) -> list[PartSums]:
    """Write parts of frames, whose chunks no other process writes; the arrays have room for them.

    Parameters
    ----------
    folder
        The folder of the run.
    parts
        One of each frame.
    frame
        Number of the first frame.

    Returns
    -------
    list
        What was written of each frame.

    Raises
    ------
    StorageError
        If the disk is full or missing.
    """
    import zarr

    found: list[PartSums] = []
    with zarr_calls(), storage_errors(folder, "append to the run"):
        store = atomic_store(folder)
        arrays = {
            name: zarr.open_array(store, path=name, mode="r+", zarr_format=3)
            for name in ("position", "velocity", *((COLUMN,) if any(x.columns.shape[1] for x in parts) else ()))
        }
        for number, part in enumerate(parts, frame):
            values = {"position": part.q, "velocity": part.p, COLUMN: part.columns}
            sums: PartSums = {}
            for name, array in arrays.items():
                rows = np.ascontiguousarray(values[name], dtype=array.dtype)
                if len(rows):
                    array[number, part.first : part.first + len(rows)] = rows
                sums[name] = (zlib.crc32(rows.data), rows.nbytes)
            found.append(sums)
        settle(store.touched)
    return found
