"""What the page says is whole and of the moment that it names: equations, claims, numbers, the view."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.apps.lab.panels.measures import measured
from tests.apps.lab.tabs import LabTab

OBSTACLES = "olfati-saber-2003"
CUT = """() => [...document.querySelectorAll('#strips .text')]
    .filter((e) => e.scrollHeight > e.clientHeight + 2 || e.scrollWidth > e.clientWidth + 2)
    .map((e) => e.textContent)"""
"""Claims whose sentence does not fit its place."""


@pytest.mark.browser
def test_a_law_that_is_too_wide_is_set_smaller_or_shown_large(page, tab):
    box = "() => { const f = document.querySelector('#law .formula'); return [f.scrollWidth, f.clientWidth]; }"
    wide, room = tab.ask(box)
    large = tab.tab.get_by_role("button", name="show it large")
    assert wide <= room or large.is_visible()
    tab.tab.set_viewport_size({"width": 390, "height": 844})
    tab.tab.locator("#show-law").click()
    tab.drawn()
    wide, room = tab.ask(box)
    assert wide <= room or large.is_visible()
    if large.is_visible():
        large.click()
        assert tab.tab.locator("dialog[open] .formula math").count() > 0


@pytest.mark.browser
def test_claims_of_the_paper_are_read_whole_beside_their_strips(browser, tmp_path):
    from flocking.apps.lab.page import Page
    from flocking.apps.lab.server import opened

    page = Page(opened(None), OBSTACLES, folder=tmp_path)
    tab = LabTab(browser, page)
    tab.press("Play")
    tab.wait(lambda: tab.ask("() => lab.timeline.record.claims.length") > 5, "claims are judged")
    tab.press("Pause")
    assert tab.ask(CUT) == []
    tab.shot("claims")
    tab.tab.set_viewport_size({"width": 390, "height": 844})
    tab.tab.locator("#show-claims").click()
    tab.drawn()
    assert tab.ask(CUT) == []
    assert tab.ask("() => document.querySelector('header').scrollWidth - innerWidth") <= 0
    tab.ask("() => lab.scene.aim()")
    tab.drawn()
    under = tab.ask("() => document.querySelector('#tools').getBoundingClientRect().right")
    assert min(tab.ask("() => [...lab.scene.sx]")) > under
    tab.shot("phone_of_a_paper")
    tab.close()
    page.close()


@pytest.mark.browser
def test_after_a_branch_no_verdict_of_another_moment_is_shown(page, tab):
    play = "() => lab.timeline.record.claims.length"
    page.clock.speed = 4.0
    tab.press("Play")
    tab.wait(lambda: page.experiment.time > 2 and tab.ask(play) > 0, "claims are judged")
    tab.press("Pause")
    judged = page.measuring.judge
    page.measuring.judge = lambda frame: None
    page.branch(1.0)
    tab.reads("Judging the motion since the last intervention")
    assert tab.ask(play) == 0
    page.measuring.judge = judged


def test_a_net_that_is_apart_has_connectivity_zero():
    q = np.array([[0.1, 0.0], [1.3, 0.2], [0.7, 1.1], [50.0, 0.3], [51.1, 0.4], [50.6, 1.2]])
    links = np.linalg.norm(q[:, None] - q, axis=2) < 5
    np.fill_diagonal(links, val=False)
    assert measured(fk.State(q, None, 0.0, links), 0.0)["connectivity"] == 0.0
    whole = np.ones((6, 6), dtype=bool) & ~np.eye(6, dtype=bool)
    assert measured(fk.State(q, None, 0.0, whole), 0.0)["connectivity"] == pytest.approx(6.0)
