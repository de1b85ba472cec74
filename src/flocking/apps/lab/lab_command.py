"""``flocking lab``."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter


def lab(
    scenario: str | None = None,
    *,
    port: int | None = None,
    folder: str | None = None,
    browser: Annotated[bool, Parameter(negative="--no-browser")] = True,
) -> int:
    """Open the live lab in a browser, at an address that is printed. Ctrl-C ends it.

    Parameters
    ----------
    scenario
        A name that 'flocking list' shows, a TOML file, or a saved event log to replay.
    port
        Port on the loopback address; the first free one from 8080 on by default.
    folder
        The only folder in which the page opens and saves files; the working folder by default.
    browser
        Open a browser.
    """
    from flocking.apps.lab.server import lab as open_lab

    open_lab(scenario, port=port, folder=folder, browser=browser, wait=True)
    return 0
