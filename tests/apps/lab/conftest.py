"""A browser, a page that runs here, and a tab that shows it."""

import re
import shutil

import pytest

import flocking as fk
from tests.apps.lab.tabs import FLAGS, NAMES, LabTab


@pytest.fixture(scope="package")
def browser(tmp_path_factory):
    """Chromium; its own record of the network must name no other machine."""
    record = tmp_path_factory.mktemp("network") / "log.json"
    found = next((shutil.which(name) for name in NAMES if shutil.which(name)), None)
    assert found, "no Chromium here: install it (make test-browser does) or put it on PATH"
    from playwright.sync_api import sync_playwright

    with sync_playwright() as play:
        opened = play.chromium.launch(executable_path=found, args=[*FLAGS, f"--log-net-log={record}"])
        yield opened
        opened.close()
    hosts = connected_to(record)
    assert hosts == {"127.0.0.1"}, hosts


def connected_to(record):
    """Addresses that a network log says a TCP connection was tried to."""
    text = record.read_text(encoding="utf-8", errors="replace")
    number = re.search(r'"TCP_CONNECT_ATTEMPT":(\d+)', text).group(1)
    tried = [line for line in text.splitlines() if f'"type":{number}}}' in line or f'"type":{number},' in line]
    return {address.rsplit(":", 1)[0] for line in tried for address in re.findall(r'"address":"([^"]+)"', line)}


@pytest.fixture
def scenario():
    """What the page starts with."""
    return ten()


@pytest.fixture
def page(tmp_path, scenario):
    from flocking.apps.lab.page import Page
    from flocking.apps.lab.server import opened

    found = Page(opened(None), scenario, folder=tmp_path)
    yield found
    found.close()


@pytest.fixture
def tab(browser, page):
    found = LabTab(browser, page)
    yield found
    found.close()


def ten():
    """Ten agents and an obstacle."""
    law = fk.Law(
        fk.Hysteresis(4.0, 0.1),
        [
            fk.Gradient(fk.Potential("1/r + 1/(R - r)", R=4)),
            fk.Consensus(1.0),
            fk.Avoid((fk.Ball([7.0, 0.0], 1.5),), range=2.0, gamma_agents=False),
        ],
    )
    start = fk.start.box(10, side=6, speed=2, seed=1, connected_under=law.graph)
    return fk.Scenario(law, start, t_end=40.0, name="ten", seed=1)
