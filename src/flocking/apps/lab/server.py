"""The lab's server: a page on the loopback address, with a token in its address."""

from __future__ import annotations

import logging
import socket
import time
from pathlib import Path
from typing import TYPE_CHECKING

from flocking.apps.lab.access.guarded_server import Guarded, guarding, is_guarded
from flocking.apps.lab.access.request_checks import AccessCheck
from flocking.engine import interruption
from flocking.errors import InvalidInput
from flocking.model.law import Scenario

if TYPE_CHECKING:
    from flocking.apps.lab.page import Page

HOST = "127.0.0.1"
PORT = 8080
"""First port that is tried: the usual one of local web servers."""
TRIES = 50
"""Number of ports that are tried: as many labs can run on one machine."""

LOOK = 0.5
"""Seconds between two checks for a signal."""


def lab(
    scenario: Scenario | str | None = None,
    *,
    port: int | None = None,
    folder: str | Path | None = None,
    browser: bool = True,
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
        Open the page in a browser.
    wait
        Print the address and wait until interrupted; false when absent.

    Returns
    -------
    Page
        The page, with its ``address``; ``close()`` ends it.

    Raises
    ------
    InvalidInput
        When viser is not installed, the port is taken, or there is no such scenario or folder.
    """
    from flocking.apps.lab.page import Page

    if folder is not None and not Path(folder).is_dir():
        raise InvalidInput("lab", "folder", "must be an existing folder", str(folder))
    page: Page | None = None
    try:
        # Ctrl-C waits: raised while this thread holds a lock of the server, it would leave it held.
        with interruption.uninterrupted():
            guarded = opened(port)
            try:
                page = Page(guarded, scenario, folder)
            except BaseException:
                guarded.server.stop()
                raise
        if wait:
            print(f"The lab is open at {page.address}", flush=True)
        if browser:
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


def opened(port: int | None) -> Guarded:
    """A viser server on the loopback address behind an access check, without its share button.

    Raises
    ------
    InvalidInput
        When viser is not installed, its connections cannot be checked, or the port is taken.
    """
    try:
        import viser
    except ImportError:
        raise InvalidInput(
            "lab", "viser", "must be installed", "no module named viser", "Install it: pip install 'flocking[lab]'."
        ) from None
    free = next((p for p in ([port] if port else range(PORT, PORT + TRIES)) if _is_free(p)), None)
    if free is None:
        raise InvalidInput(
            "lab", "port", "must be free", port or f"{PORT} to {PORT + TRIES - 1}", "Give another --port."
        )
    # Connections that end early are no reason for a traceback.
    logging.getLogger("websockets.server").setLevel(logging.CRITICAL)
    access = AccessCheck()
    with guarding(access):
        server = viser.ViserServer(host=HOST, port=free, label="flocking lab", verbose=False)
    access.ports.add(server.get_port())
    if not is_guarded(HOST, server.get_port(), access.token):
        server.stop()
        raise InvalidInput(
            "lab", "viser", "must be a version whose connections can be checked", viser.__version__,
            "Install another one: pip install 'viser>=1.1,<2'.",
        )  # fmt: skip
    server.gui.configure_theme(show_share_button=False, show_logo=False, control_width="large")
    server.gui.main_panel.dock_right()
    # No other way to the public tunnel either.
    server.request_share_url = _no_tunnel
    return Guarded(server, access)


def _no_tunnel(verbose: bool = True) -> None:
    raise InvalidInput("lab", "share", "is not possible: the lab stays on this machine", "a share URL")


def _is_free(port: int) -> bool:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # as the server itself does
        try:
            probe.bind((HOST, port))
        except (OSError, OverflowError):
            return False
    return True
