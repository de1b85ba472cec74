"""The lab's server: a page on the loopback address alone."""

from __future__ import annotations

import logging
import socket
import threading
from typing import Any

from flocking.errors import InvalidInput
from flocking.model.law import Scenario

HOST = "127.0.0.1"
PORT = 8080
TRIES = 50


def lab(
    scenario: Scenario | str | None = None, *, port: int | None = None, browser: bool = True, wait: bool | None = None
) -> Any:
    """Open the live lab: a page in which a scenario runs, and everything about it can be changed as it does.

    The page is served on the loopback address alone and needs no network.

    Parameters
    ----------
    scenario
        What to start with: a scenario, a name that ``flocking list`` shows, or a TOML file; a scenario of
        Olfati-Saber when absent, where there is one.
    port
        Port of the page; the first free one from 8080 on when absent.
    browser
        Open the page in a browser.
    wait
        Stay until interrupted. When absent: no, so that a notebook goes on.

    Returns
    -------
    Page
        The page; its ``close()`` ends it.

    Raises
    ------
    InvalidInput
        When viser is not installed, the port is taken, or there is no such scenario.
    """
    from flocking.apps.lab.page import Page

    page = Page(opened(port), scenario)
    address = page.address
    if browser:
        import webbrowser

        webbrowser.open(address)
    if wait:
        try:
            threading.Event().wait()
        except KeyboardInterrupt:
            page.close()
    return page


def opened(port: int | None) -> Any:
    """A viser server on the loopback address, without its share button.

    Raises
    ------
    InvalidInput
        When viser is not installed or the port is taken.
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
    # A connection that ends before it began is nobody's fault, and no reason for a traceback.
    logging.getLogger("websockets.server").setLevel(logging.CRITICAL)
    server = viser.ViserServer(host=HOST, port=free, label="flocking lab", verbose=False)
    server.gui.configure_theme(show_share_button=False, show_logo=False, control_width="large")
    server.gui.main_panel.dock_right()
    # The share button is one way to the outside tunnel; a page of the lab has none at all.
    server.request_share_url = _no_tunnel
    return server


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
