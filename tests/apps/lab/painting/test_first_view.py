"""What is read first: title, question and paper at all widths, challenges; on a phone curves and controls together."""

from __future__ import annotations

import pytest

import flocking as fk
from flocking.apps.lab.panels.catalogue import about
from flocking.papers import keys, paper
from tests.apps.lab.tabs import LabTab

LONGEST = 90
"""Characters of a question: one line of a wide page, two of a phone."""
SEEN = """(at) => { const e = document.querySelector(at), b = e.getBoundingClientRect();
    const top = document.elementFromPoint(b.left + Math.min(b.width, 60) / 2, b.top + b.height / 2);
    const inside = b.top >= 0 && b.left >= 0 && b.bottom <= innerHeight + 1 && b.right <= innerWidth + 1;
    return b.width > 0 && b.height > 0 && inside && (top === e || e.contains(top)); }"""
"""Whether an element lies within the page and is not covered."""


@pytest.mark.parametrize("key", keys())
def test_each_scenario_of_a_paper_has_one_question(key):
    found = paper(key)
    names = list(found.scenarios())
    assert set(found.questions) == set(names)
    for name in names:
        question = found.question_of(name)
        assert question.endswith("?"), name
        assert question.count("?") == 1, name
        assert len(question) <= LONGEST, name
    assert len(set(found.questions.values())) == len(names)


def test_a_scenario_of_no_paper_has_its_size_and_a_question_of_what_is_judged():
    law = fk.Law(fk.Complete(), [fk.Consensus(1.0)])
    scenario = fk.Scenario(law, fk.start.box(3, side=1.0, seed=0), t_end=2.0, name="mine")
    found = about("mine", scenario)
    # The graph never changes: whether it stays connected is no question.
    assert found["question"] == "Do velocities agree and do no two agents meet?"
    assert found["paper"] == ""
    assert found["size"] == "3 agents in 2 dimensions, until t = 2"
    moving = fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0)])
    alike = ", does the group stay connected and do no two agents meet?"
    assert about("mine", scenario.with_(law=moving))["question"] == f"Do velocities agree{alike}"
    # Of late knowledge the lab judges none of these, and of a thousand agents nothing.
    assert about("mine", scenario.with_(information=fk.Delayed(0.1)))["question"] == ""
    many = fk.start.box(1000, side=9.0, seed=0)
    assert about("mine", scenario.with_(law=moving, start=many))["question"] == ""


@pytest.fixture
def obstacles(browser, tmp_path):
    from flocking.apps.lab.page import Page
    from flocking.apps.lab.server import opened

    page = Page(opened(None), "olfati-saber-2003", folder=tmp_path)
    tab = LabTab(browser, page)
    yield page, tab
    tab.close()
    page.close()


@pytest.mark.browser
def test_title_question_paper_and_challenges_are_in_the_first_view(obstacles):
    page, tab = obstacles
    found = paper("olfati-saber-2003")
    for width, height in ((1400, 900), (1000, 800), (390, 844)):
        tab.tab.set_viewport_size({"width": width, "height": height})
        tab.drawn()
        assert tab.tab.locator("#title").text_content() == found.title_of("olfati-saber-2003")
        assert tab.tab.locator("#question").text_content() == found.question_of("olfati-saber-2003")
        assert found.title in tab.tab.locator("#paper").text_content()
        for part in ("#title", "#question", "#paper", "#challenges", "#play"):
            assert tab.ask(SEEN, part), (part, width)
        question = "() => { const e = document.querySelector('#question'); return e.scrollWidth - e.clientWidth; }"
        assert tab.ask(question) <= 0, "the question is cut off"
        tab.shot(f"first_view_{width}")
    tab.tab.set_viewport_size({"width": 1400, "height": 900})
    offered = tab.tab.locator("#strips [data-challenge]")
    offered.first.wait_for()
    assert offered.count() == 3
    tab.tab.locator("[data-challenge=kick]").click()
    tab.wait(lambda: page.experiment.state.n == 30, "the challenge opens")
    tab.wait(lambda: "smallest kick" in tab.tab.locator("#title").text_content(), "its title is shown")
    assert "Kick one or several" in tab.tab.locator("#question").text_content()


@pytest.mark.browser
def test_on_a_phone_curves_claims_and_the_control_that_changes_them_are_seen_together(page, tab):
    page.clock.speed = 2.0
    tab.press("Play")
    tab.wait(lambda: tab.ask("() => lab.timeline.record.claims.length") > 3, "claims are judged")
    tab.press("Pause")
    tab.tab.set_viewport_size({"width": 390, "height": 844})
    tab.tab.locator("#show-law").click()
    tab.control("gain").locator("input[type=range]").scroll_into_view_if_needed()
    tab.drawn()
    rows = "[...document.querySelectorAll('#law label.row')]"
    tab.ask(f"() => {{ {rows}.find((r) => r.textContent.trim() === 'gain').id = 'gain'; }}")
    for part in (
        "[data-curve=energy]",
        "[data-curve=connectivity]",
        "#strips .strip",
        "#strips button svg",
        "#strips button .text",
        "#gain input",
    ):
        assert tab.ask(SEEN, part), part
    # Sentences can be read: of a line's height, and of more than half the width, three of them at least.
    sentences = """() => { const whole = document.querySelector('#strips').getBoundingClientRect();
        return [...document.querySelectorAll('#strips button .text')].map((x) => x.getBoundingClientRect())
            .filter((b) => b.top >= whole.top && b.bottom <= whole.bottom)
            .filter((b) => b.width > 195 && b.height > 11).length; }"""
    assert tab.ask(sentences) >= 3
    assert tab.tab.locator("#scene").bounding_box()["height"] > 0.3 * 844
    tab.tab.locator("#law .pot label.row:has(input[type=range])").first.scroll_into_view_if_needed()
    tab.drawn()
    assert tab.ask(SEEN, ".pot canvas"), "the picture of the potential stays above its sliders"
    tab.shot("phone_law_and_curves")
    # They are painted for this width.
    ink = """() => { const c = document.querySelector('[data-curve=energy]');
        return [...c.getContext('2d').getImageData(0, 0, c.width, c.height).data].some((x) => x); }"""
    assert tab.ask(ink)
    tab.tab.locator("#show-claims").click()
    tab.drawn()
    for part in ("[data-curve=energy]", "#strips .strip", "#play", "#speed"):
        assert tab.ask(SEEN, part), part
