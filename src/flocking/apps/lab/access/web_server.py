"""The server of the lab: its own files and one websocket, on the loopback address, each request checked first."""

from __future__ import annotations

import asyncio
import logging
import threading
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from flocking.apps.lab.access.peer_users import may_come_from_another_user
from flocking.apps.lab.access.request_checks import (
    MESSAGES_A_SECOND,
    MOST_MESSAGES,
    MOST_TABS,
    OTHER_USER,
    AccessCheck,
    RateLimit,
    Refusal,
)

if TYPE_CHECKING:
    from websockets.asyncio.server import ServerConnection
    from websockets.http11 import Request, Response

HOST = "127.0.0.1"
LIVE = "/live"
"""Path of the websocket."""

LARGEST_MESSAGE = 2**20
"""Bytes of the longest message that a page may send."""
CLOSING_SECONDS = 1.0
"""Seconds that a connection has to close when the server ends."""
STARTING_SECONDS = 30.0
"""Seconds in which the server must listen; it takes a few milliseconds on a free machine."""

SAFER = {
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "Cross-Origin-Resource-Policy": "same-origin",
}
"""Headers of every answer: the token is not passed on, and nothing is stored or read by other sites."""

SOURCES = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; font-src 'self'; "
    "img-src 'self' blob: data:; connect-src 'self'; base-uri 'none'; form-action 'none'; "
)
"""What a page may load: files of this server. Styles may stand in elements, as those of formulas do."""
NOTEBOOKS = "http://localhost:* http://127.0.0.1:* vscode-webview:"
"""Pages that may show the lab inside them once a notebook displays it: notebooks on this machine."""

Handler = Callable[["ServerConnection"], Awaitable[None]]


@dataclass(frozen=True)
class Content:
    """A file that the server answers with.

    Parameters
    ----------
    kind
        Its media type.
    data
        Its bytes.
    """

    kind: str
    data: bytes


class WebServer:
    """Serves files and a websocket on the loopback address, in a thread of its own.

    Parameters
    ----------
    port
        A free port.
    access
        Checks every request before anything else is looked at.
    contents
        Files by their paths, which begin with a slash; ``"/"`` is the page.
    """

    def __init__(self, port: int, access: AccessCheck, contents: Mapping[str, Content]) -> None:
        self.port, self.access = port, access
        self.in_notebooks = False
        """Whether notebooks on this machine may show the page inside them."""
        self._contents = dict(contents)
        self._handler: Handler | None = None
        self.loop = asyncio.new_event_loop()
        """The event loop of the server's thread."""
        self._end = asyncio.Event()
        self._ready = threading.Event()
        self._fault: BaseException | None = None
        access.ports.add(port)
        self._thread = threading.Thread(target=self._run, name="flocking-lab-server", daemon=True)

    @property
    def address(self) -> str:
        """Where the page is, with the token."""
        return f"http://{HOST}:{self.port}/{self.access.token}/"

    def start(self) -> None:
        """Listen.

        Raises
        ------
        OSError
            When the port was taken meanwhile.
        """
        self._thread.start()
        self._ready.wait(STARTING_SECONDS)
        if self._fault is not None:
            raise self._fault

    def connect(self, handler: Handler) -> None:
        """Let a ``handler`` serve the websockets."""
        self._handler = handler

    def stop(self) -> None:
        """Close all connections and wait for the thread."""
        if self._thread.is_alive():
            self.loop.call_soon_threadsafe(self._end.set)
            self._thread.join()

    def _run(self) -> None:
        try:
            self.loop.run_until_complete(self._serve())
        except BaseException as fault:  # shown by `start`
            self._fault = fault
        finally:
            self._ready.set()
            self.loop.close()

    async def _serve(self) -> None:
        from websockets.asyncio.server import serve

        # Connections that end early are no reason for a traceback.
        quiet = logging.getLogger("flocking.lab.server")
        quiet.setLevel(logging.CRITICAL)
        async with serve(
            self._connected, HOST, self.port, process_request=self._answer, max_size=LARGEST_MESSAGE,
            compression=None, close_timeout=CLOSING_SECONDS, logger=quiet,
        ):  # fmt: skip
            self._ready.set()
            await self._end.wait()

    def _answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """The answer to a request; None lets a checked handshake go on."""
        found: Refusal | str = OTHER_USER
        # Files of the page are those of the library: only the websocket shows and steers something.
        is_handshake = "upgrade" in request.headers
        if not (is_handshake and may_come_from_another_user(connection.remote_address[:2], (HOST, self.port))):
            found = self.access.judge(request.path, request.headers.raw_items())
        if isinstance(found, Refusal):
            return self._respond(connection, found.status, Content("text/plain; charset=utf-8", found.words.encode()))
        if is_handshake:
            if found == LIVE:
                return None
            return self._respond(connection, 404, Content("text/plain", b"There is no such connection.\n"))
        if found == "/" and not request.path.partition("?")[0].endswith("/"):
            # Relative addresses of the page's files need the slash.
            return self._respond(connection, 301, Content("text/plain", b""), Location=f"/{self.access.token}/")
        content = self._contents.get(found)
        if content is None:
            return self._respond(connection, 404, Content("text/plain", b"There is no such file.\n"))
        return self._respond(connection, 200, content)

    def _respond(self, connection: ServerConnection, status: int, content: Content, **more: str) -> Response:
        response = connection.respond(status, "")
        ancestors = NOTEBOOKS if self.in_notebooks else "'none'"
        headers: dict[str, str] = {
            **SAFER, **more, "Content-Type": content.kind, "Content-Length": str(len(content.data)),
            "Content-Security-Policy": f"{SOURCES}frame-ancestors {ancestors}",
        }  # fmt: skip
        for name, value in headers.items():
            if name in response.headers:
                del response.headers[name]
            response.headers[name] = value
        response.body = content.data
        return response

    async def _connected(self, connection: ServerConnection) -> None:
        handler = self._handler
        if self.access.tabs >= MOST_TABS or handler is None:
            await connection.close(1013, "too many tabs")
            return
        self._limit(connection)
        self.access.tabs += 1
        try:
            await handler(connection)
        finally:
            self.access.tabs -= 1

    @staticmethod
    def _limit(connection: Any) -> None:
        """Let messages that come too fast wait."""
        receive, limit = connection.recv, RateLimit(MESSAGES_A_SECOND, MOST_MESSAGES)

        async def received(*given: object, **options: object) -> object:
            message = await receive(*given, **options)
            wait = limit.wait()
            if wait > 0:
                await asyncio.sleep(wait)
            return message

        connection.recv = received
