"""Open pages and their messages: each is sent the last frame when it has drawn the one before."""

from __future__ import annotations

import asyncio
import contextlib
import json
import math
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import TYPE_CHECKING, Any

from flocking.apps.lab.access.web_server import WebServer
from flocking.apps.lab.experiment.clock import Clock, Frame
from flocking.apps.lab.live.frame_bytes import RequestedParts, packed

if TYPE_CHECKING:
    from websockets.asyncio.server import ServerConnection

Message = Mapping[str, object]
"""A message to a page: ``kind`` and more, all of it JSON data."""

FASTEST_PAINT = 1 / 40
"""Seconds between two frames that are sent, at least: 30 a second are required, and a late one costs none of them."""
MOST_WAITING = 400
"""Messages that wait for a page that does not read them, a bound on memory; then the connection is closed."""
SLOW_ORDERS = 4
"""Threads for orders that compute: opening, branching, drawing and checking do not hold up play and pause."""


class Tab:
    """One open page.

    Parameters
    ----------
    loop
        The event loop of its connection.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self.wake = asyncio.Event()
        self.messages: deque[str | bytes] = deque()
        self.frame: bytes | None = None
        self.record: str | None = None
        """The last record, for a page that is ready for it: one that is slow is not sent all that it never shows."""
        self.drawn = True
        """Whether the page has drawn the last frame that it was sent."""
        self.looking: float | None = None
        """Time of the record that it looks at; None for the present."""
        self.requested = RequestedParts()

    def tell(self, message: Message | bytes) -> None:
        """Send a message, from any thread."""
        data = message if isinstance(message, bytes) else json.dumps(message, allow_nan=False, separators=(",", ":"))
        if not isinstance(message, bytes) and message["kind"] == "record":
            self._soon(partial(self._put_record, str(data)))
        else:
            self._soon(partial(self._put, data))

    def _put_record(self, data: str) -> None:
        self.record = data

    def _put(self, data: str | bytes) -> None:
        # A record that waits is older than this message: pages take them in the order in which they came about.
        if self.record is not None:
            self.messages.append(self.record)
            self.record = None
        self.messages.append(data)

    def show(self, frame: bytes, *, present: bool = True) -> None:
        """Send a frame when the page is ready for it; of those that wait only the last is sent. From any thread.

        Parameters
        ----------
        frame
            The frame.
        present
            Whether it is one of the present, which a page that looks at the record by then is not sent.
        """

        def put() -> None:
            if not present or self.looking is None:
                self.frame = frame

        self._soon(put)

    def acknowledge(self) -> None:
        """Note that the page has drawn its frame. In the thread of the loop."""
        self.drawn = True
        self.wake.set()

    def _soon(self, change: Callable[[], None]) -> None:
        def act() -> None:
            change()
            self.wake.set()

        with contextlib.suppress(RuntimeError):  # the server has ended meanwhile
            self._loop.call_soon_threadsafe(act)


Obey = Callable[[Tab, dict[str, Any]], None]


class Hub:
    """Connects open pages with a clock.

    Parameters
    ----------
    server
        The server of their connections.
    clock
        The clock.
    greeted
        Called with a page that has just connected.
    """

    def __init__(self, server: WebServer, clock: Clock, greeted: Callable[[Tab], None]) -> None:
        self._server, self._clock, self._greeted = server, clock, greeted
        self.tabs: set[Tab] = set()
        self.sent = 0
        """Frames that were sent to pages."""
        self._last: tuple[Frame, RequestedParts, bytes] | None = None
        self._quick = ThreadPoolExecutor(1, "flocking-lab-orders")
        self._slow = ThreadPoolExecutor(SLOW_ORDERS, "flocking-lab-slow-orders")
        self._thread = threading.Thread(target=self._run, name="flocking-lab-frames", daemon=True)

    def begin(self, obey: Obey, is_slow: Callable[[object], bool]) -> None:
        """Let pages connect.

        Parameters
        ----------
        obey
            Carries out an order of a page.
        is_slow
            Whether an order of this kind computes for long.
        """
        self._obey, self._is_slow = obey, is_slow
        self._thread.start()
        self._server.connect(self._serve)

    def join(self) -> None:
        """Wait for the threads; the clock must be closed."""
        if self._thread.is_alive():
            self._thread.join()
        self._quick.shutdown(cancel_futures=True)
        self._slow.shutdown(cancel_futures=True)

    def tell(self, message: Message) -> None:
        """Send a message to all pages."""
        for tab in tuple(self.tabs):
            tab.tell(message)

    def repaint(self, tab: Tab) -> None:
        """Send the last frame to the page of a ``tab`` again."""
        frame = None
        # A frame that comes while this one is packed may be shown before it, and would be replaced by it.
        while frame is not self._clock.frame:
            frame = self._clock.frame
            tab.show(self._bytes(frame))

    def _bytes(self, frame: Frame) -> bytes:
        every = [tab.requested for tab in tuple(self.tabs)]
        requested = RequestedParts(
            any(w.energies for w in every), any(w.virtual_agents for w in every), any(w.flocks for w in every)
        )
        last = self._last
        if last is not None and last[0] is frame and last[1] == requested:
            return last[2]
        data = packed(frame, requested)
        self._last = frame, requested, data
        return data

    def _run(self) -> None:
        number, due = 0, time.perf_counter()
        while not self._clock.closed:
            frame = self._clock.next_frame(number, timeout=0.5)
            if frame is None:
                continue
            number = frame.number
            begin = time.perf_counter()
            looking_on = [tab for tab in tuple(self.tabs) if tab.looking is None]
            if looking_on:
                data = self._bytes(frame)
                for tab in looking_on:
                    tab.show(data)
            now = time.perf_counter()
            due = next_due(due, begin, now)
            time.sleep(max(due - now, 0.0))

    async def _serve(self, connection: ServerConnection) -> None:
        tab = Tab(asyncio.get_running_loop())
        self.tabs.add(tab)
        try:
            self._greeted(tab)
            self.repaint(tab)
            sender = asyncio.create_task(self._send(connection, tab))
            receiver = asyncio.create_task(self._receive(connection, tab))
            done, other = await asyncio.wait((sender, receiver), return_when=asyncio.FIRST_COMPLETED)
            for task in other:
                task.cancel()
            await asyncio.gather(*done, *other, return_exceptions=True)
        finally:
            self.tabs.discard(tab)

    async def _send(self, connection: ServerConnection, tab: Tab) -> None:
        while True:
            await tab.wake.wait()
            tab.wake.clear()
            if len(tab.messages) > MOST_WAITING:
                await connection.close(1013, "too slow")
                return
            while tab.messages:
                await connection.send(tab.messages.popleft())
            if tab.drawn and tab.record is not None:
                record, tab.record = tab.record, None
                await connection.send(record)
            if tab.drawn and tab.frame is not None:
                data, tab.frame, tab.drawn = tab.frame, None, False
                self.sent += 1
                await connection.send(data)

    async def _receive(self, connection: ServerConnection, tab: Tab) -> None:
        from websockets.exceptions import ConnectionClosed

        loop = asyncio.get_running_loop()
        while True:
            try:
                text = await connection.recv()
            except ConnectionClosed:
                return
            order = _order(text)
            if order is None:
                continue
            if order["kind"] == "drawn":
                tab.acknowledge()
            else:
                workers = self._slow if self._is_slow(order["kind"]) else self._quick
                loop.run_in_executor(workers, self._obey, tab, order)


def next_due(due: float, begin: float, end: float) -> float:
    """When the next frame is due, in seconds of the same clock as the arguments.

    Frames keep to a schedule, so that what a frame is late does not add up; the pause leaves the simulation as much
    time as packing takes, and after a standstill the schedule begins anew.

    Parameters
    ----------
    due
        When this frame was due.
    begin, end
        When its packing began and ended.
    """
    return max(due + FASTEST_PAINT, 2 * end - begin)


def _order(text: object) -> dict[str, Any] | None:
    """An order as data; None for what is none."""
    if not isinstance(text, str):
        return None
    try:
        order = json.loads(text, parse_constant=_finite, parse_float=_finite)
    except (ValueError, RecursionError):
        return None
    return order if isinstance(order, dict) and isinstance(order.get("kind"), str) else None


def _finite(text: str) -> float:
    """A number of an order: pages write no others, and answers repeat the ``id`` of an order as JSON."""
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(text)
    return value
