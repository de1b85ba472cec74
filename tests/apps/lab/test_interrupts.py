"""Ctrl-C while the lab opens, waits or closes: its parts are whole when it is raised, and its server ends."""

from __future__ import annotations

import signal
import sys
import threading
from types import SimpleNamespace
from typing import Any

import pytest

import flocking as fk
from flocking.apps.lab import page as pages
from flocking.apps.lab import server


@pytest.fixture
def seen(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What happens to a page and its server, both without a socket."""
    seen: list[str] = []

    class Page:
        address = "nowhere"

        def __init__(self, *_: object) -> None:
            signal.raise_signal(signal.SIGINT)
            seen.append("whole")

        def close(self) -> None:
            seen.append("closed")

    stopped = SimpleNamespace(stop=lambda: seen.append("stopped"))
    monkeypatch.setattr(server, "opened", lambda port: stopped)
    monkeypatch.setattr(pages, "Page", Page)
    return seen


def test_an_interrupt_while_the_lab_opens_waits_until_it_is_open_and_closes_it(seen: list[str]) -> None:
    with pytest.raises(KeyboardInterrupt):
        server.lab(browser=False)
    assert seen == ["whole", "closed"]


def test_an_interrupt_while_the_lab_waits_closes_it(seen: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pages.Page, "__init__", lambda *_: None)
    monkeypatch.setattr(server.time, "sleep", lambda _: signal.raise_signal(signal.SIGINT))
    server.lab(browser=False, wait=True)
    assert seen == ["closed"]


def test_the_server_of_a_scenario_that_is_refused_ends(seen: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: Any) -> None:
        raise fk.InvalidInput("lab", "scenario", "must be known", "x")

    monkeypatch.setattr(pages.Page, "__init__", refuse)
    with pytest.raises(fk.InvalidInput):
        server.lab("x", browser=False)
    assert seen == ["stopped"]


def test_an_interrupt_while_a_page_closes_waits_for_its_end() -> None:
    closing = SimpleNamespace(
        clock=SimpleNamespace(close=lambda: signal.raise_signal(signal.SIGINT)),
        hub=threading.Thread(target=int), measuring=threading.Thread(target=int),
        server=SimpleNamespace(stop=lambda: stopped.append(True)),
    )  # fmt: skip
    stopped: list[bool] = []
    closing.hub.start()
    closing.measuring.start()

    with pytest.raises(KeyboardInterrupt):
        pages.Page.close(closing)  # type: ignore[arg-type]
    assert stopped


def test_a_browser_is_opened_but_not_from_a_notebook_whose_cell_shows_the_page(
    seen: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pages.Page, "__init__", lambda *_: None)
    monkeypatch.setattr("webbrowser.open", lambda address: seen.append(f"opened {address}"))
    monkeypatch.delitem(sys.modules, "IPython", raising=False)
    server.lab()
    assert seen == ["opened nowhere"]
    shell = type("Shell", (), {"__module__": "ipykernel.zmqshell"})()
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: shell))
    server.lab()
    assert seen == ["opened nowhere"]
    server.lab(browser=True)
    assert seen == ["opened nowhere"] * 2
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: None))
    server.lab()
    assert seen == ["opened nowhere"] * 3


@pytest.mark.server
def test_a_port_that_is_taken_between_the_look_and_the_start_is_passed_over(monkeypatch: pytest.MonkeyPatch) -> None:
    """As when two labs start at once."""
    from flocking.apps.lab.access.web_server import WebServer

    begun: list[int] = []
    start = WebServer.start

    def late(self: WebServer) -> None:
        begun.append(self.port)
        if len(begun) == 1:
            raise OSError("taken")
        start(self)

    monkeypatch.setattr(WebServer, "start", late)
    found = server.opened(None)
    found.stop()
    assert found.port == begun[1] > begun[0]
    begun.clear()
    with pytest.raises(fk.InvalidInput, match="must be free"):
        server.opened(found.port)
