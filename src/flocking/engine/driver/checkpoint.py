"""Checkpoints: all a session needs to go on bit for bit, but its records, in one file; each engine packs its own."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from flocking.engine.archives.archive import UNREADABLE, read_archive, write_archive
from flocking.engine.exact.checkpoint import pack_exact, restore_exact
from flocking.engine.exact.session import ExactSession
from flocking.engine.runs.columns import GROWING
from flocking.engine.runs.run import Run
from flocking.errors import StorageError
from flocking.model.law import Law

if TYPE_CHECKING:
    from flocking.engine.tiles.session import TilesSession


def write_checkpoint(session: ExactSession | TilesSession, file: BinaryIO) -> None:
    """Write the state of a session as an ``.npz`` file: arrays, and one JSON text of numbers."""
    if isinstance(session, ExactSession):
        numbers, arrays = pack_exact(session.snapshot(records=False))
    else:
        from flocking.engine.tiles.checkpoint import pack_tiles

        numbers, arrays = pack_tiles(session)
    write_archive(file, {"engine": session.engine, **numbers}, arrays)


def pack(session: ExactSession | TilesSession) -> bytes:
    """State of a session as bytes, see `write_checkpoint`."""
    file = io.BytesIO()
    write_checkpoint(session, file)
    return file.getvalue()


def unpack(
    data: bytes | Path,
    records: Run,
    plant: Law | None,
    where: Path,
    *,
    stored: dict[str, int] | None = None,
    threads: int | None = None,
) -> ExactSession | TilesSession:
    """The session that was packed, with its records from a run read back.

    Parameters
    ----------
    data
        What `pack` gave, or the file that `write_checkpoint` wrote.
    records
        The run as of the same commit; the tiled engine takes its scenario alone.
    plant
        The law the agents really obey, where it is not the scenario's.
    where
        Where the data come from, for messages.
    stored
        Numbers of records on disk, of each kind, that the tiled engine goes on after.
    threads
        Number of threads of the tiled engine; that of before when absent.

    Raises
    ------
    StorageError
        When the data are no checkpoint.
    """
    try:
        numbers, arrays = read_archive(data)
        if numbers["engine"] == "tiles":
            from flocking.engine.tiles.checkpoint import restore_tiles

            counts = stored or dict.fromkeys(GROWING, 0)
            return restore_tiles(numbers, arrays, records.scenario, counts, threads, plant)
        return ExactSession.resume(restore_exact(numbers, arrays, records, plant))
    except UNREADABLE as error:
        raise StorageError(f"{where}: no checkpoint this version can go on from ({str(error)[:200]}).") from None
