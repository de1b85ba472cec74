"""SIGTERM and SIGINT at drawn moments of the lab, while it opens and while it waits: it ends, and so does its port."""

from __future__ import annotations

import re
import socket
from pathlib import Path

import pytest

from tests.machines.starting import Machines
from tests.machines.striking import LongCommand, moments

pytestmark = pytest.mark.server

OPEN = "The lab is open at"


@pytest.fixture(scope="module")
def lab(machines: Machines, file: Path) -> LongCommand:
    """A lab that nobody looks at."""
    for module in ("websockets", "flocking.apps.lab.page"):
        machines.ask("load", name=module)
    return LongCommand(machines, 28, lambda at: ("lab", file, "--folder", at, "--no-browser"), waits=OPEN)


@moments(default=0)
def test_a_lab_ends(lab: LongCommand, memory: Path, moment: int) -> None:
    struck = lab.struck(memory, moment)
    assert struck.early or OPEN in struck.ended.out
    assert list((memory / "struck").iterdir()) == []
    if port := re.search(r"127\.0\.0\.1:(\d+)", struck.ended.out):
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(("127.0.0.1", int(port[1])))
