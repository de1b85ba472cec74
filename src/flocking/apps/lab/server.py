"""The lab's server: a page on the loopback address, with a token in its address."""

from __future__ import annotations

import socket
import time
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from flocking.apps.lab.access.page_files import page_files
from flocking.apps.lab.access.request_checks import AccessCheck
from flocking.apps.lab.access.web_server import HOST, WebServer
from flocking.engine import interruption
from flocking.engine.driver.notebook_line import in_notebook
from flocking.errors import InvalidInput
from flocking.model.checks import integer
from flocking.model.law import Scenario

if TYPE_CHECKING:
    from flocking.apps.lab.page import Page

PORT = 8080
"""First port that is tried: the usual one of local web servers."""
TRIES = 50
"""Number of ports that are tried: as many labs can run on one machine."""

LARGEST_PORT = 65535
"""The largest number of a port, which has 16 bits."""

LOOK = 0.5
"""Seconds between two checks for a signal."""


def lab(
    scenario: Scenario | str | None = None,
    *,
    port: int | None = None,
    folder: str | Path | None = None,
    browser: bool | None = None,
    wait: bool | None = None,
) -> Page:
    """Open the live lab: a page in which a running scenario can be changed.

    The page is served on the loopback address alone and needs no network. Its address has a random token in it;
    requests without the token, of another page or for another host are refused.

    Parameters
    ----------
    scenario
        What to start with: a scenario, a name that ``flocking list`` shows, or a TOML file; a scenario of
        Olfati-Saber when absent, where there is one.
    port
        Port of the page; the first free one from 8080 on when absent.
    folder
        The only folder in which the page opens and saves files; the working folder when absent.
    browser
        Open the page in a browser; true when absent, but in a notebook, whose cell shows the page.
    wait
        Print the address and wait until interrupted; false when absent.

    Returns
    -------
    Page
        The page, with its ``address``; ``close()`` ends it.

    Raises
    ------
    InvalidInput
        When websockets is not installed, the port is taken, or there is no such scenario or folder.
    """
    from flocking.apps.lab.page import Page

    if not isinstance(scenario, Scenario | str | Path | None):
        raise InvalidInput(
            "lab", "scenario", "must be a Scenario, a name that `flocking list` shows, or a file", scenario
        )
    if folder is not None and not Path(folder).is_dir():
        raise InvalidInput("lab", "folder", "must be an existing folder", str(folder))
    page: Page | None = None
    try:
        # Ctrl-C waits: raised while this thread holds a lock of the server, it would leave it held.
        with interruption.uninterrupted():
            opened_server = opened(port)
            try:
                page = Page(opened_server, scenario, folder)
            except BaseException:
                opened_server.stop()
                raise
        if wait:
            print(f"The lab is open at {page.address}", flush=True)
        if browser or (browser is None and not in_notebook()):
            import webbrowser

            webbrowser.open(page.address)
        if wait:
            _wait()
    except BaseException:
        if page is not None:
            page.close()
        raise
    if wait:
        page.close()
    return page


def _wait() -> None:
    """Wait until interrupted."""
    try:
        # A signal just before a wait does not end it, and a library may swallow the interrupt.
        while not interruption.RAISED:
            time.sleep(LOOK)
    except KeyboardInterrupt:
        interruption.answered()


def opened(port: int | None) -> WebServer:
    """A server on the loopback address that checks every request.

    Raises
    ------
    InvalidInput
        When websockets is not installed, or the port is taken or none.
    """
    if port is not None and integer("lab", "port", port, least=1) > LARGEST_PORT:
        raise InvalidInput("lab", "port", f"must be from 1 to {LARGEST_PORT}", port)
    if find_spec("websockets") is None:
        raise InvalidInput(
            "lab", "websockets", "must be installed", "no module named websockets",
            "Install it: pip install 'flocking[lab]'.",
        )  # fmt: skip
    for candidate in range(PORT, PORT + TRIES) if port is None else [port]:
        if not _is_free(candidate):
            continue
        server = WebServer(candidate, AccessCheck(), page_files())
        try:
            server.start()
        except OSError:
            continue  # another process took it meanwhile
        return server
    raise InvalidInput("lab", "port", "must be free", port or f"{PORT} to {PORT + TRIES - 1}", "Give another --port.")


def _is_free(port: int) -> bool:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # as the server itself does
        try:
            probe.bind((HOST, port))
        except (OSError, OverflowError):
            return False
    return True
