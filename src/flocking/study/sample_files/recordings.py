"""Files of robots' logs: MCAP, as ``flocking nodes`` records it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from flocking.engine.storage.export_formats import missing_package
from flocking.errors import InvalidInput
from flocking.model.checks import Array
from flocking.study.sample_files.samples import Columns, Samples, check_size, check_times, finite_array

TOPIC = "/state"
"""Topic whose messages are read: JSON with the time ``t`` and the rows of ``q`` and, where there are any, of ``p``."""


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
        from mcap.exceptions import McapError
        from mcap.reader import make_reader
    except ImportError:
        raise missing_package("mcap", "MCAP") from None
    rows: list[dict[str, object]] = []
    size = 0
    try:
        with path.open("rb") as file:
            for _, channel, message in make_reader(file).iter_messages(topics=[TOPIC]):
                if channel.message_encoding != "json":
                    raise ValueError(f"messages of {TOPIC} are {channel.message_encoding}, not JSON")
                size += len(message.data)
                check_size(path, size, "its messages")
                found = json.loads(message.data)
                if not isinstance(found, dict):
                    raise ValueError(f"a message of {TOPIC} is no object")
                rows.append(found)
    except InvalidInput:
        raise
    except (McapError, ValueError, OSError, RuntimeError, KeyError, EOFError, RecursionError) as error:
        raise InvalidInput(str(path), "file", f"must be a finished MCAP file ({error})", path.name) from None
    if not rows:
        raise InvalidInput(str(path), "file", f"must have messages of the topic {TOPIC}", "none")
    names = list(rows[0])
    for ours in ("t", "q"):
        if columns.name(ours) not in names:
            raise columns.missing(ours, names)

    def values(ours: str, axes: int) -> Array:
        name = columns.name(ours)
        try:
            array = np.array([row[name] for row in rows], dtype=np.float64)
        except (KeyError, TypeError, ValueError) as error:
            raise InvalidInput(
                str(path), name, f"must be numbers of one shape in all messages ({error})", name
            ) from None
        return finite_array(path, name, array, axes)

    t, q = values("t", 1), values("q", 3)
    p = values("p", 3) if columns.present("p", names) else None
    if p is not None and p.shape != q.shape:
        raise InvalidInput(str(path), columns.name("p"), f"must have the shape of q, {q.shape}", p.shape)
    check_times(path, t, f"field {columns.name('t')}")
    return Samples(t, q, p, tuple(map(str, range(q.shape[1]))))
