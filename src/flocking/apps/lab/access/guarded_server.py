"""The access check in front of viser's server, which has none.

Viser serves pages and websockets through ``websockets.asyncio.server.serve``. While the server of a lab is made, that
function is replaced by one that adds a check of every request; nothing else of viser is changed. Requests to the
server then test the check, so that a version of viser that serves in another way is refused.
"""

from __future__ import annotations

import asyncio
import http.client
import threading
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from flocking.apps.lab.access.request_checks import (
    MESSAGES_A_SECOND,
    MOST_MESSAGES,
    MOST_TABS,
    AccessCheck,
    RateLimit,
    Refusal,
)

if TYPE_CHECKING:
    from viser import ViserServer
    from websockets.asyncio.server import ServerConnection
    from websockets.http11 import Request

SERVED_BY = "viser."
"""Modules whose servers are guarded."""

LARGEST_MESSAGE = 2**20
"""Bytes of the longest message that a page may send."""

SAFER = {
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "Content-Security-Policy": "frame-ancestors 'none'",
}
"""Headers of every answer: the token is not passed on, and no page can embed the lab."""

_one_at_a_time = threading.Lock()


@dataclass(frozen=True, eq=False)
class Guarded:
    """A viser server, and the check of who may connect to it.

    Parameters
    ----------
    server
        The viser server.
    access
        The check.
    """

    server: ViserServer
    access: AccessCheck

    @property
    def address(self) -> str:
        """Where the page is, with the token."""
        return f"http://{self.server.get_host()}:{self.server.get_port()}/{self.access.token}/"


@contextmanager
def guarding(access: AccessCheck) -> Iterator[None]:
    """Within it, a viser server that is made checks its requests.

    Parameters
    ----------
    access
        The check.
    """
    import rich
    import websockets.asyncio.server as place

    with _one_at_a_time:
        before, console = place.serve, rich.get_console()
        quiet = console.quiet

        def serve(handler: Any, *given: Any, process_request: Any = None, **options: Any) -> object:
            if not getattr(process_request, "__module__", "").startswith(SERVED_BY):
                return before(handler, *given, process_request=process_request, **options)
            options["max_size"] = LARGEST_MESSAGE
            return before(_served(access, handler), *given, process_request=_judged(access, process_request), **options)

        place.serve = serve
        console.quiet = True  # viser prints its address, which lacks the token
        try:
            yield
        finally:
            place.serve, console.quiet = before, quiet


def _judged(access: AccessCheck, answer: Callable[[object, object], object]) -> Callable[[object, object], object]:
    def judge(connection: ServerConnection, request: Request) -> object:
        found = access.judge(request.path, request.headers.raw_items())
        if isinstance(found, Refusal):
            response = connection.respond(found.status, found.words)
        else:
            request.path = found
            response = answer(connection, request)
        if response is not None:
            for name, value in SAFER.items():
                response.headers[name] = value
        return response

    return judge


def _served(access: AccessCheck, handler: Callable[[ServerConnection], Awaitable[None]]) -> Callable[[object], object]:
    async def serve(connection: ServerConnection) -> None:
        if access.tabs >= MOST_TABS:
            await connection.close(1013, "too many tabs")
            return
        receive, limit = connection.recv, RateLimit(MESSAGES_A_SECOND, MOST_MESSAGES)

        async def received(*given: object, **options: object) -> object:
            message = await receive(*given, **options)
            wait = limit.wait()
            if wait > 0:
                await asyncio.sleep(wait)
            return message

        connection.recv = received
        access.tabs += 1
        try:
            await handler(connection)
        finally:
            access.tabs -= 1

    return serve


def is_guarded(host: str, port: int, token: str) -> bool:
    """Whether a server refuses wrong requests and answers right ones.

    Parameters
    ----------
    host, port
        Where it is.
    token
        What its address begins with.
    """
    own, elsewhere = f"{host}:{port}", "http://elsewhere.invalid"
    upgrade = {
        "Connection": "Upgrade", "Upgrade": "websocket", "Sec-WebSocket-Version": "13",
        "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
    }  # fmt: skip
    statuses = [
        _status(host, port, "/", {"Host": own}),
        _status(host, port, f"/{token}/", {"Host": "elsewhere.invalid"}),
        _status(host, port, f"/{token}/", {"Host": own, "Origin": elsewhere}),
        _status(host, port, f"/{token}/", {"Host": own, "Origin": elsewhere, **upgrade}),
        _status(host, port, "/", {"Host": own, "Origin": f"http://{own}", **upgrade}),
    ]
    return statuses == [403] * len(statuses) and _status(host, port, f"/{token}/", {"Host": own}) == 200


def _status(host: str, port: int, path: str, headers: dict[str, str]) -> int:
    connection = http.client.HTTPConnection(host, port, timeout=10)
    try:
        connection.putrequest("GET", path, skip_host=True, skip_accept_encoding=True)
        for name, value in headers.items():
            connection.putheader(name, value)
        connection.endheaders()
        return connection.getresponse().status
    except (OSError, http.client.HTTPException):
        return 0
    finally:
        connection.close()
