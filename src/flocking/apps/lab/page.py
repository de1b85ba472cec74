"""A running lab as `fk.lab` returns it: the lab, obeying its pages."""

from __future__ import annotations

from pathlib import Path

from flocking.apps.lab.access.web_server import WebServer
from flocking.apps.lab.live.lab import Lab
from flocking.apps.lab.live.orders import Orders
from flocking.engine.interruption import uninterrupted
from flocking.model.law import Scenario


class Page(Lab):
    """A running lab.

    Parameters
    ----------
    server
        The server of its files and connections.
    scenario
        What to start with, as in `flocking.apps.lab.server.lab`; an event log is replayed.
    folder
        The only folder in which the page opens and saves files; the working folder when absent.
    """

    def __init__(
        self, server: WebServer, scenario: Scenario | str | None = None, folder: str | Path | None = None
    ) -> None:
        super().__init__(server, scenario, folder)
        orders = Orders(self)
        self.clock.begin()
        self.hub.begin(orders.obey, orders.is_slow)
        self.measuring.begin()
        self.clock.post(lambda: None)

    @property
    def address(self) -> str:
        """Address of the page, with the token that it opens with."""
        return self.server.address

    def __repr__(self) -> str:
        return f"Page({self.address!r})"

    def _repr_html_(self) -> str:
        """The page itself, in a notebook on this machine."""
        self.server.in_notebooks = True
        return (
            f'<iframe src="{self.address}" title="flocking lab" style="width:100%;height:640px;border:0;'
            'border-radius:8px"></iframe>'
        )

    def close(self) -> None:
        """End the lab; Ctrl-C waits until it has ended."""
        with uninterrupted():
            self.clock.close()
            self.server.stop()
            self.hub.join()
            self.measuring.join()
