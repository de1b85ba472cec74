"""Messages between processes over zenoh: from peer to peer at stated places, nothing is searched for in the network."""

from __future__ import annotations

import json
import queue
from types import TracebackType
from typing import TYPE_CHECKING, Self

from flocking.errors import EngineMissing, StorageError

if TYPE_CHECKING:
    import zenoh

SHORTEST_WAIT = 1e-6
"""Seconds of the shortest wait: a queue accepts no negative ones, and a message that is there is returned at once."""

MISSING = "Processes of agents need the package eclipse-zenoh: pip install 'flocking[nodes]'."
"""Message where the package is not installed."""


class Bus:
    """A place where messages are published and heard.

    Parameters
    ----------
    listen
        Where others may connect, such as ``tcp/127.0.0.1:7447``; nobody may where it is empty.
    connect
        Where to connect; nowhere if empty.

    Attributes
    ----------
    heard
        Messages that have come: the end of their key, and their bytes.

    Raises
    ------
    EngineMissing
        When zenoh is not installed.
    StorageError
        When the place cannot be listened at or connected to.
    """

    def __init__(self, *, listen: str = "", connect: str = "") -> None:
        try:
            import zenoh
        except ImportError:
            raise EngineMissing(MISSING) from None
        config = zenoh.Config()
        settings = {
            "mode": '"peer"', "listen/endpoints": json.dumps([listen] if listen else []),
            "connect/endpoints": json.dumps([connect] if connect else []), "scouting/multicast/enabled": "false",
            "scouting/gossip/enabled": "false",
        }  # fmt: skip
        self.heard: queue.SimpleQueue[tuple[str, bytes]] = queue.SimpleQueue()
        self._subscribers: list[zenoh.Subscriber[None]] = []
        try:
            for name, value in settings.items():
                config.insert_json5(name, value)
            self._session = zenoh.open(config)
        except zenoh.ZError as error:
            # Its words end in places of its own source files.
            said = str(error).partition(" at /")[0].strip()
            raise StorageError(
                f"{listen or connect}: cannot open this place for messages ({said}). Name one as tcp/192.168.1.5:7447."
            ) from None

    def subscribe(self, key: str) -> None:
        """Receive messages under a key."""

        def came(sample: zenoh.Sample) -> None:
            self.heard.put((str(sample.key_expr).rsplit("/", 1)[-1], sample.payload.to_bytes()))

        self._subscribers.append(self._session.declare_subscriber(key, came))

    def publish(self, key: str, data: bytes) -> None:
        """Send a message under a key."""
        import zenoh

        self._session.put(key, data, congestion_control=zenoh.CongestionControl.BLOCK, express=True)

    def next(self, seconds: float) -> tuple[str, bytes] | None:
        """The next message; None where none comes for some seconds."""
        try:
            return self.heard.get(timeout=max(seconds, SHORTEST_WAIT))
        except queue.Empty:
            return None

    def close(self) -> None:
        """Leave."""
        self._session.close()  # type: ignore[no-untyped-call, unused-ignore]

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def free_endpoint() -> str:
    """A place on this machine at a port that was free just now."""
    import socket

    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"
