"""The requests that the lab accepts: those of its own pages, with its token, at its own address."""

from __future__ import annotations

import hmac
import secrets
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass

HOSTS = ("127.0.0.1", "localhost")
TOKEN_BYTES = 24
"""Random bytes of the token: 192 bits cannot be guessed at any rate of requests."""

HANDSHAKES_A_SECOND = 2.0
"""New connections that are accepted in a second in the long run: a page opens one."""
MOST_HANDSHAKES = 30
"""Connections that may be opened at once, and how many more each second."""

MESSAGES_A_SECOND = 500.0
"""Messages of a page that are accepted in a second in the long run: a pointer that is dragged sends one for each
frame of the screen, 60 to 240 in a second."""
MOST_MESSAGES = 2000
"""Messages of one tab that are read at once, and how many more each second; what comes faster waits."""

MOST_TABS = 16
"""Pages that may be open at once; each is sent every frame, so their number bounds the work."""


@dataclass(frozen=True)
class Refusal:
    """Why a request is refused.

    Parameters
    ----------
    status
        Status code of HTTP.
    words
        The answer, which does not depend on what is on this machine.
    """

    status: int
    words: str


FOREIGN = Refusal(403, "The lab answers the page that it opened itself, on this machine, and no other.\n")
NO_TOKEN = Refusal(403, "This address lacks the lab's token: open the address that was printed when the lab started.\n")
OTHER_USER = Refusal(403, "The lab answers the user of this machine who started it, and no other.\n")
TOO_MANY = Refusal(429, "Too many connections in a short time: try again in a few seconds.\n")


class RateLimit:
    """A rate limit: a token bucket.

    Parameters
    ----------
    each_second
        Rate per second.
    at_once
        Size of the bucket.
    now
        Gives the time in seconds.
    """

    def __init__(self, each_second: float, at_once: float, now: Callable[[], float] = time.monotonic) -> None:
        self._each_second, self._at_once, self._now = each_second, at_once, now
        self._left, self._since = float(at_once), now()

    def _refill(self) -> None:
        now = self._now()
        self._left = min(self._at_once, self._left + (now - self._since) * self._each_second)
        self._since = now

    def take(self) -> bool:
        """Take a token if there is one; whether there was."""
        self._refill()
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True

    def wait(self) -> float:
        """Take a token in any case; returns the seconds to wait for it."""
        self._refill()
        self._left -= 1.0
        return max(0.0, -self._left / self._each_second)


class AccessCheck:
    """Checks requests by their Origin, their Host and the token.

    A browser sends the page that opens a websocket (Origin), and the machine in the address of every request (Host). A
    page of another site can change neither, and cannot read the token.

    Parameters
    ----------
    token
        What an address must begin with; drawn at random when absent.
    """

    def __init__(self, token: str | None = None) -> None:
        self.token = token or secrets.token_urlsafe(TOKEN_BYTES)
        self.ports: set[int] = set()
        """Ports of the lab; without one every request is refused."""
        self.tabs = 0
        """Tabs that are connected."""
        self._handshakes = RateLimit(HANDSHAKES_A_SECOND, MOST_HANDSHAKES)

    def judge(self, path: str, headers: Iterable[tuple[str, str]]) -> Refusal | str:
        """Why a request is refused, or its path without the token.

        Parameters
        ----------
        path
            Path of the request with all that follows.
        headers
            Names and values, each as often as it was sent.
        """
        given: dict[str, list[str]] = {}
        for name, value in headers:
            given.setdefault(name.lower(), []).append(value)
        hosts, origins = given.get("host", []), given.get("origin", [])
        if len(hosts) != 1 or hosts[0] not in {f"{host}:{port}" for host in HOSTS for port in self.ports}:
            return FOREIGN
        is_handshake = any(name == "upgrade" or name.startswith("sec-websocket-") for name in given)
        own = [f"http://{hosts[0]}"]
        if origins != own and (is_handshake or origins):
            return FOREIGN
        token, _, rest = path.removeprefix("/").partition("?")[0].partition("/")
        if not hmac.compare_digest(token.encode(), self.token.encode()):
            return NO_TOKEN
        if is_handshake and (self.tabs >= MOST_TABS or not self._handshakes.take()):
            return TOO_MANY
        return f"/{rest}"
