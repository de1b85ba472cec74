"""The user of this machine who has opened a connection, from the tables of sockets of Linux."""

from __future__ import annotations

import os
import socket
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

TABLES = (Path("/proc/net/tcp"), Path("/proc/net/tcp6"))
"""Tables of the sockets of this machine, where it has them."""
ESTABLISHED, LISTENING = 1, 10
"""States of a socket, as the kernel numbers them."""
ROOT = 0
"""Number of the user who may read and steer everything anyway."""
MAPPED = "0000000000000000FFFF0000"
"""What stands before an IPv4 address in the table of IPv6."""


@dataclass(frozen=True)
class Socket:
    """A line of a table.

    Parameters
    ----------
    own, other
        Its address and that of its peer, as the kernel writes them: hexadecimal address and port.
    state
        Number of its state.
    user
        Number of the user who made it; 0 for one that its process has closed.
    inode
        Number of its inode; 0 for one that its process has closed.
    """

    own: str
    other: str
    state: int
    user: int
    inode: int


WORDS = 10
"""Words of a line up to the inode."""


def sockets(lines: Iterable[str]) -> Iterator[Socket]:
    """Sockets of a table; other lines, as its heading, are passed over."""
    for line in lines:
        words = line.split()
        if len(words) >= WORDS and words[0].endswith(":"):
            own, other = words[1].removeprefix(MAPPED), words[2].removeprefix(MAPPED)
            yield Socket(own, other, int(words[3], 16), int(words[7]), int(words[9]))


def written(host: str, port: int) -> str:
    """An address and a port as the kernel writes them.

    Parameters
    ----------
    host
        Address of IPv4; the kernel writes it in the order of this machine's bytes.
    port
        Number of the port.
    """
    return f"{int.from_bytes(socket.inet_aton(host), sys.byteorder):08X}:{port:04X}"


def may_come_from_another_user(
    client: tuple[str, int], server: tuple[str, int], lines: Iterable[str] | None = None
) -> bool:
    """Whether a connection is not known to be of the user of this process, or of root.

    Parameters
    ----------
    client, server
        Host and port of its two ends.
    lines
        Lines of the tables; those of this machine when absent.

    Returns
    -------
    bool
        False on a machine that has no such tables, or whose tables do not list the server's own socket: there nothing
        is known. True where they do, and the socket of the client is of another user, closed or not listed.
    """
    if lines is None:
        lines = [
            line for table in TABLES if table.exists() for line in table.read_text("ascii", "replace").splitlines()
        ]
    listed = list(sockets(lines))
    here, there = written(*server), written(*client)
    me = os.getuid() if hasattr(os, "getuid") else None
    if not any(x.own == here and x.state == LISTENING and x.user == me for x in listed):
        return False
    # A socket that was closed is shown as one of root, but without an inode.
    return not any(
        (x.own, x.other, x.state) == (there, here, ESTABLISHED) and x.user in (me, ROOT) and x.inode for x in listed
    )
