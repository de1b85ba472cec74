"""Recordings of runs of agents as MCAP, the file format of robots' logs: messages of JSON with the time of each."""

from __future__ import annotations

import json
from pathlib import Path
from types import TracebackType
from typing import Self

from flocking.arrays import Reals
from flocking.engine.nodes.nodes import Sample
from flocking.errors import EngineMissing, StorageError
from flocking.model.world.times import PER_SECOND

STATE, SAMPLE = "/state", "/sample"
"""Topics: frames of the true motion, and samples that agents sent."""

NUMBERS = {"type": "array", "items": {"type": "number"}}
SCHEMAS = {
    STATE: {"t": {"type": "number"}, "q": {"type": "array", "items": NUMBERS},
            "p": {"type": "array", "items": NUMBERS}},
    SAMPLE: {"sender": {"type": "integer"}, "number": {"type": "integer"}, "stamp": {"type": "integer"}, "q": NUMBERS,
             "p": NUMBERS},
}  # fmt: skip
"""Fields of the messages of each topic."""


class Recording:
    """A new file; it can be read once it is closed.

    Parameters
    ----------
    path
        The file.

    Raises
    ------
    EngineMissing
        When the package mcap is not installed.
    StorageError
        When the file is there already or cannot be written.
    """

    def __init__(self, path: Path) -> None:
        try:
            from mcap.writer import Writer
        except ImportError:
            raise EngineMissing("Recordings need the package mcap: pip install 'flocking[nodes]'.") from None
        if path.suffix != ".mcap":
            raise StorageError(f"{path}: recordings are MCAP files. Choose a name that ends in .mcap.")
        try:
            self._file = path.open("xb")
        except FileExistsError:
            raise StorageError(f"{path}: the file is there already. Choose another; nothing is overwritten.") from None
        except OSError as error:
            raise StorageError(f"{path}: cannot write the recording ({error}).") from None
        self._writer = Writer(self._file)
        self._writer.start(profile="", library="flocking")
        self._channels: dict[str, int] = {}
        for topic, fields in SCHEMAS.items():
            schema = json.dumps({"type": "object", "properties": fields}).encode()
            number = self._writer.register_schema(name=topic[1:], encoding="jsonschema", data=schema)
            self._channels[topic] = self._writer.register_channel(
                topic=topic, message_encoding="json", schema_id=number
            )

    def _add(self, topic: str, nanoseconds: int, data: object) -> None:
        self._writer.add_message(
            channel_id=self._channels[topic], log_time=nanoseconds, publish_time=nanoseconds,
            data=json.dumps(data).encode(),
        )  # fmt: skip

    def frame(self, t: float, q: Reals, p: Reals | None, *, start: float) -> None:
        """Add a frame of the true motion; its message is logged as samples are, in nanoseconds from the start.

        Parameters
        ----------
        t
            Time of the scenario.
        q, p
            Positions and velocities, shape (N, m); None for agents of order 1, which have no velocities of their own.
        start
            When the scenario starts.
        """
        speeds = {} if p is None else {"p": p.tolist()}
        self._add(STATE, round((t - start) * PER_SECOND), {"t": t, "q": q.tolist(), **speeds})

    def sample(self, sample: Sample) -> None:
        """Add a sample that an agent sent.

        Parameters
        ----------
        sample
            The sample.
        """
        self._add(SAMPLE, sample.stamp, vars(sample))

    def close(self) -> None:
        """Finish the file."""
        self._writer.finish()
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
