"""``flocking lab``."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter


def lab(
    scenario: str | None = None,
    *,
    port: int | None = None,
    browser: Annotated[bool, Parameter(negative="--no-browser")] = True,
) -> int:
    """Open the live lab in a browser. Ctrl-C ends it.

    Parameters
    ----------
    scenario
        A name that 'flocking list' shows, a TOML file, or a saved event log to replay.
    port
        Port on the loopback address; the first free one from 8080 on by default.
    browser
        Open a browser.
    """
    from flocking.apps.lab.server import lab as open_lab

    open_lab(scenario, port=port, browser=browser, wait=True)
    return 0
