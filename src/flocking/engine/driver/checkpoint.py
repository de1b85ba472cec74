"""Checkpoints: the state of a session, without its records, in one file; packed by its engine."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import BinaryIO

from flocking.engine.archives.archive import UNREADABLE, read_archive, write_archive
from flocking.engine.archives.data_checks import SHOWN, MalformedError
from flocking.engine.protocol.engine import Engine
from flocking.engine.protocol.session import Packed, Session, Stored
from flocking.errors import StorageError
from flocking.model.law import Scenario

ENGINE = "engine"
"""Key of the engine's name in a checkpoint."""

MOST_OF_REASON = 200
"""Most characters of another library's reason: those that quote data would fill the screen."""

ROOM, ROOM_OF_AGENT, ROOM_OF_PAIR = 2**30, 2**17, 2**9
"""Bytes that a checkpoint may have, for each agent, and for each ordered pair and graph, a bound on what is read.
That is 64 numbers of a pair, and 16,000 of an agent, such as forces. Engines write fewer."""
ROOM_OF_HISTORY = 10**8
"""Bytes for each agent whose past is known, or on its way: 100,000 steps or messages of 1 kB within the delay."""


def largest_checkpoint(scenario: Scenario) -> int:
    """Bytes beyond which a file is no checkpoint of this scenario."""
    n = scenario.start.n
    history = 0 if scenario.information.ideal else ROOM_OF_HISTORY
    return ROOM + (ROOM_OF_AGENT + history) * n + ROOM_OF_PAIR * n * n * len(scenario.law.graphs)


def write_checkpoint(engine: str, packed: Packed, file: BinaryIO) -> None:
    """Write the state of a session as an ``.npz`` file: arrays, and one JSON text of numbers.

    Parameters
    ----------
    engine
        Name of its engine.
    packed
        The result of `flocking.engine.protocol.session.Session.pack`.
    """
    numbers, arrays = packed
    write_archive(file, {ENGINE: engine, **numbers}, arrays)


def pack(session: Session) -> bytes:
    """State of a session as bytes, see `write_checkpoint`."""
    file = io.BytesIO()
    write_checkpoint(session.engine, session.pack(), file)
    return file.getvalue()


def read_checkpoint(data: bytes | Path, engine: str, where: Path) -> Packed:
    """The packed state in a checkpoint.

    Parameters
    ----------
    data
        The result of `pack`, or the file that `write_checkpoint` wrote.
    engine
        Name of the engine that the run states.

    Raises
    ------
    StorageError
        If the data are not a checkpoint, or of another engine; the message names the file ``where``.
    """
    try:
        numbers, arrays = read_archive(data)
        if (found := numbers.pop(ENGINE, None)) != engine:
            raise MalformedError(f"{ENGINE} must be {engine!r}, not {str(found)[:SHOWN]!r}")
    except UNREADABLE as error:
        raise _useless(where, error) from None
    return numbers, arrays


def restored(engine: Engine, packed: Packed, stored: Stored, where: Path, changes: Mapping[str, object]) -> Session:
    """The session of an ``engine`` from its ``packed`` state and its ``stored`` records of the same commit.

    Raises
    ------
    StorageError
        If the data do not fit this scenario; the message names the file ``where``.
    """
    try:
        return engine.unpack(packed, stored, changes)
    except UNREADABLE as error:
        raise _useless(where, error) from None


def _useless(where: Path, error: BaseException) -> StorageError:
    return StorageError(
        f"{where}: not a checkpoint from which this version can continue ({str(error)[:MOST_OF_REASON]})."
    )
