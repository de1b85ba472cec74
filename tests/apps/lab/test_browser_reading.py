"""What the page says is whole and of the moment that it names: equations, claims, numbers, the view."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.apps.lab.live.hub import FASTEST_PAINT, next_due
from flocking.apps.lab.panels.measures import _note, measured
from tests.apps.lab.tabs import LabTab

OBSTACLES = "olfati-saber-2003"
CUT = """() => [...document.querySelectorAll('#strips .text')]
    .filter((e) => e.scrollHeight > e.clientHeight + 2 || e.scrollWidth > e.clientWidth + 2)
    .map((e) => e.textContent)"""
"""Claims whose sentence does not fit its place."""
STRIPS = "() => document.querySelector('#strips').textContent"
JUDGING = "Judging the motion since the last intervention"
FEW = "Claims are judged from three measured moments on"


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
    # Which of the two it says depends on how many moments before the branch were measured.
    tab.wait(
        lambda: any(words in tab.ask(STRIPS) for words in (JUDGING, FEW)),
        "the page says that it judges, or of too few moments",
    )
    assert tab.ask(play) == 0
    page.measuring.judge = judged


def test_a_net_that_is_apart_has_connectivity_zero():
    q = np.array([[0.1, 0.0], [1.3, 0.2], [0.7, 1.1], [50.0, 0.3], [51.1, 0.4], [50.6, 1.2]])
    links = np.linalg.norm(q[:, None] - q, axis=2) < 5
    np.fill_diagonal(links, val=False)
    assert measured(fk.State(q, None, 0.0, links), 0.0)["connectivity"] == 0.0
    whole = np.ones((6, 6), dtype=bool) & ~np.eye(6, dtype=bool)
    assert measured(fk.State(q, None, 0.0, whole), 0.0)["connectivity"] == pytest.approx(6.0)


@pytest.mark.browser
def test_the_cursor_stands_on_the_axis_after_the_page_has_changed_its_size(page, tab):
    for width in (1500, 900):
        tab.tab.set_viewport_size({"width": width, "height": 800})
        tab.drawn()
        axis = tab.tab.locator("[data-curve=energy]").bounding_box()
        tab.wait(
            lambda axis=axis: abs(tab.tab.locator("#cursor").bounding_box()["x"] + 1 - axis["x"]) < 2,
            "the cursor of t = 0 stands where the axis begins",
        )


@pytest.mark.browser
def test_a_view_that_no_hand_has_moved_shows_the_whole_flock_on_a_phone_too(browser, tmp_path):
    from flocking.apps.lab.page import Page
    from flocking.apps.lab.server import opened

    page = Page(opened(None), OBSTACLES, folder=tmp_path)
    tab = LabTab(browser, page)
    for width, height, sheet in ((390, 844, "claims"), (390, 844, "law"), (844, 390, None)):
        tab.tab.set_viewport_size({"width": width, "height": height})
        if sheet:
            tab.tab.locator(f"#show-{sheet}").click()
        tab.caught_up()
        size = tab.ask("() => { const s = lab.scene.size(); return [s.width, s.height]; }")
        x, y = (np.array(tab.ask(f"() => [...lab.scene.{axis}]")) for axis in ("sx", "sy"))
        for at, room in zip((x, y), size, strict=True):
            assert 0 < at.min() <= at.max() < room, (width, sheet)
    tab.tab.set_viewport_size({"width": 1200, "height": 800})
    tab.drawn()
    tab.ask("() => { lab.scene.camera.zoom(3, 10, 10); lab.scene.repaint(); }")
    tab.drawn()
    before = tab.ask("() => lab.scene.camera.off")
    tab.tab.set_viewport_size({"width": 900, "height": 800})
    tab.drawn()
    assert tab.ask("() => lab.scene.camera.off") == before, "a view that was moved stays"
    tab.close()
    page.close()


@pytest.mark.browser
def test_every_control_of_the_timeline_is_reached_on_a_phone(page, tab):
    tab.tab.set_viewport_size({"width": 390, "height": 844})
    tab.tab.locator("#show-claims").click()
    tab.drawn()
    for name in ("play", "scrub", "step", "restart", "reset", "speed", "show-claims", "show-law"):
        box = tab.tab.locator(f"#{name}").bounding_box()
        assert box, name
        assert 0 <= box["x"] <= 390 - box["width"], name
        assert box["y"] + box["height"] <= 844, name
    tab.shot("phone_controls")


@pytest.mark.browser
def test_verdicts_from_before_an_intervention_say_so_while_the_run_stands_still(page, tab):
    page.clock.speed = 4.0
    tab.press("Play")
    tab.wait(lambda: page.experiment.time > 2 and tab.ask("() => lab.timeline.record.claims.length") > 0, "judged")
    tab.press("Pause")
    tab.wait(lambda: not page.clock.running, "it stands still")
    page.clock.do(lambda: None)
    tab.wait(lambda: page.measuring.timeline.judged == page.experiment.time, "it is judged once more")
    tab.reads("since the last intervention")
    page.send({"kind": "kick", "agents": [1], "speed": 1.0, "seed": 5})
    tab.reads("before the last intervention; what follows")
    tab.press("Play")
    tab.reads("since the last intervention")


@pytest.mark.browser
def test_a_comparison_offers_another_number_and_the_scene_names_it(page, tab):
    tab.open("compare")
    tab.tab.locator("[data-which]").select_option(label="Consensus: gain")
    assert tab.tab.locator("#dialog [data-value]").input_value() == "0.5"
    tab.tab.locator("#dialog [data-go]").click()
    tab.wait(lambda: len(page.clock.experiments) == 2, "two run")
    tab.wait(lambda: tab.ask("() => lab.scene.second") == "gain = 0.5", "the second is named")


@pytest.mark.browser
def test_reasons_of_the_potential_check_stand_in_place(page, tab):
    reasons = tab.tab.locator(".pot .reasons").first
    reasons.locator("summary").click()
    tab.wait(lambda: reasons.locator("dd").count() > 5, "the reasons are there")
    assert all(text.strip() for text in reasons.locator("dd").all_text_contents())


@pytest.mark.browser
def test_agents_at_rest_have_no_speed_in_the_legend(browser, tmp_path):
    from flocking.apps.lab.page import Page
    from flocking.apps.lab.server import opened

    page = Page(opened(None), OBSTACLES, folder=tmp_path)
    tab = LabTab(browser, page)
    assert "0 – 0" in tab.tab.locator("#legend").text_content()
    tab.close()
    page.close()


def test_frames_keep_to_their_schedule_however_late_each_of_them_is():
    rng = np.random.default_rng(0)
    due = now = 0.0
    for _ in range(1000):
        begin = max(due, now) + rng.uniform(0.0, 0.015)  # woken late, or the clock's frame was not there yet
        now = begin + 0.003
        due = next_due(due, begin, now)
        assert due >= now + 0.003 - 1e-12, "the simulation has as much time as packing"
    assert 1000 / now > 39.0  # 28 where the pause began anew after each frame
    assert next_due(due, now + 100.0, now + 100.001) < now + 100.0 + FASTEST_PAINT, "no debt of a standstill"


def test_what_an_error_leaves_open_is_said_with_that_error():
    from flocking.study.claims.claim import Verdict

    class Given:
        margin = 1.33
        note = words = "closest 1.33 to an obstacle"

        def __init__(self, verdict, error):
            self.verdict, self.error = verdict, error

    assert _note(Given(Verdict.NOT_RESOLVED, 2.117)) == "closest 1.33 to an obstacle, known to within 2.2"
    assert _note(Given(Verdict.HOLDS, 0.1)) == _note(Given(Verdict.NOT_RESOLVED, np.nan)) == Given.note


def faults_of(tab):
    """What an automatic accessibility check finds, with the first places."""
    from axe_playwright_python.sync_playwright import Axe

    found = Axe().run(tab.tab).response["violations"]
    return [(fault["id"], [node["target"] for node in fault["nodes"]][:3]) for fault in found]


@pytest.mark.browser
@pytest.mark.parametrize("size", [(1200, 800), (390, 844)], ids=["wide", "phone"])
def test_an_accessibility_check_is_clean_in_every_dialog_and_on_a_phone(page, tab, size):
    claims = "() => lab.timeline.record.claims.length"
    tab.wait(lambda: page.measuring.reads > 0, "the start is measured")
    page.clock.step(0.5)
    # A step that takes long is measured on its way.
    tab.wait(lambda: FEW in tab.ask(STRIPS) or tab.ask(claims) > 0, "the page says that moments are few, or judges")
    page.clock.step(0.5)
    tab.wait(lambda: tab.ask(claims) > 0, "claims are judged")
    tab.tab.set_viewport_size({"width": size[0], "height": size[1]})
    for _ in ("light", "dark"):
        for sheet in ("claims", "law") if size[0] < 500 else ():
            tab.tab.locator(f"#show-{sheet}").click()
            assert faults_of(tab) == [], sheet
        for name in ("pick", "challenges", "compare", "view", "files"):
            tab.open(name)
            tab.drawn()
            assert faults_of(tab) == [], name
            assert (
                tab.ask("() => { const d = document.querySelector('dialog'); return d.scrollWidth - d.clientWidth; }")
                == 0
            )
            tab.tab.keyboard.press("Escape")
        tab.tab.locator("#theme").click()


CONTROLS = """() => [...document.querySelectorAll('button, input, select, textarea, summary, canvas[tabindex]')]
    .filter((e) => e.offsetParent !== null && !e.disabled)"""


@pytest.mark.browser
def test_the_keyboard_reaches_every_control(page, tab):
    tab.tab.locator(".pot .reasons summary").last.wait_for()  # the last that comes
    count = tab.ask(f"() => ({CONTROLS})().length")
    assert count > 50
    tab.ask("() => { window.reached = new Set(); document.addEventListener('focusin', (e) => reached.add(e.target)); }")
    for _ in range(count + 20):
        tab.tab.keyboard.press("Tab")
    assert tab.ask(f"() => ({CONTROLS})().filter((e) => !reached.has(e)).map((e) => e.outerHTML)") == []
