"""A law that collapses, in a real browser: the page says so, and goes on being obeyed."""

import re
import time

import pytest

from tests.apps.lab.tabs import wait
from tests.engine.driver.test_slices import collapsing

pytestmark = pytest.mark.browser

SOON = 15.0
"""Seconds an order may take through a browser that draws without a graphics card; a free machine needs 1."""


@pytest.fixture
def scenario():
    return collapsing()


def test_pause_reset_and_the_way_back_are_obeyed_while_steps_shrink(page, tab):
    took = {}

    def order(name, done):
        begin = time.monotonic()
        tab.press(name)
        wait(done, name)
        took[name] = time.monotonic() - begin

    tab.press("Play")
    tab.reads(re.compile(r"Stalled: steps have shrunk to [\d.e-]+, agents 7 and 9"))
    tab.shot("shrunk")
    assert page.clock.playing
    order("Pause", lambda: not page.clock.running)
    tab.tab.get_by_role("button", name="Play", exact=True).wait_for()
    tab.shot("shrunk_paused")
    stuck = page.experiment.time
    tab.press("step")
    wait(lambda: page.clock.running, "a step is tried")
    tab.press("Pause")
    wait(lambda: not page.clock.running, "it is given up")
    assert page.experiment.time - stuck < 1e-3
    order("go back to the last good moment", lambda: page.experiment.session.steady)
    assert not page.clock.running
    tab.tab.get_by_text("Stalled").wait_for(state="hidden")
    tab.shot("gone_back")
    tab.press("Play")
    wait(lambda: page.clock.frame.shrunk, "it collapses again")
    before = page.experiment
    order("reset", lambda: page.experiment is not before)
    wait(lambda: page.clock.frame.time == 0.0, "it stands at the start")
    assert not page.clock.running
    tab.shot("reset")
    print({name: round(seconds, 2) for name, seconds in took.items()})
    assert max(took.values()) < SOON
