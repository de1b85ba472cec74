"""Reports in Chromium: an accessibility check is clean, the keyboard reaches all, pictures enlarge, sections fold."""

from __future__ import annotations

import pytest

from flocking.apps.reproduction import reproduce as reproducing
from flocking.apps.reproduction.reproduce import reproduce
from flocking.engine.driver.simulate import simulate
from flocking.papers import paper
from flocking.study.claims.claim import Verdict
from tests.browsers import chromium

__all__ = ["chromium"]

WIDE, PHONE = {"width": 1280, "height": 900}, {"width": 390, "height": 844}


UNNAMED = """() => [...document.querySelectorAll('table.claims td')]
    .filter((cell) => /^[-\\d.e+]+$/.test(cell.innerText.trim()) && cell.cellIndex > 0)
    .filter((cell) => getComputedStyle(cell, '::before').content === 'none')
    .map((cell) => cell.innerText)"""
"""Cells with a number alone that a phone shows without the name of their column."""


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    out = tmp_path_factory.mktemp("report")
    reproduce(["tanner-2003-fixed"], seeds=5, out=out, workers=1, progress=False)
    return out / "report.html"


LONGEST_ON_A_PHONE = 10_000
"""Pixels of the folded report of five papers on a phone: twelve screens, of which two are the contents."""


@pytest.fixture(scope="module")
def five_papers(tmp_path_factory):
    """A report of the five papers with all its sections, claims and tables; runs are short, verdicts made up."""
    from flocking.papers import KEYS

    def examine(task):
        article = paper(task.key)
        claims = [c for c in article.claims(task.name) if task.claim in ("", c.key)]
        made = article.scenarios()[task.name](max(task.seed, 0))
        run = simulate(made.with_(t_end=made.start.t + 0.05, frames=2), progress=False) if task.keep else None
        return [(c.key, str(Verdict.HOLDS), 1.0, 0.0, "a number in words") for c in claims], run

    out = tmp_path_factory.mktemp("five")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(reproducing, "examine", examine)
        patch.setattr(reproducing, "draw", lambda *_: [])
        reproduce(KEYS, seeds=5, out=out, workers=1, progress=False)
    return out / "report.html"


@pytest.mark.browser
def test_the_report_of_five_papers_is_short_on_a_phone_and_nothing_is_lost_in_its_folds(chromium, five_papers):
    page = opened(chromium, five_papers, PHONE)
    height = page.evaluate("document.documentElement.scrollHeight")
    assert 3000 < height < LONGEST_ON_A_PHONE
    assert page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"], "nothing overflows sideways"
    page.locator("nav a", has_text="Provenance").click()
    page.wait_for_function("document.getElementById('provenance').open")
    page.evaluate("for (const part of document.querySelectorAll('details')) part.open = true")
    assert page.evaluate("document.documentElement.scrollHeight") > 5 * LONGEST_ON_A_PHONE
    assert page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]
    page.close()


def opened(chromium, report, size, scheme="light"):
    page = chromium.new_page(viewport=size, color_scheme=scheme)
    faults = []
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.on("request", lambda request: faults.append(request.url) if request.url.startswith("http") else None)
    page.goto(report.as_uri())
    page.faults = faults
    return page


@pytest.mark.browser
@pytest.mark.parametrize("size", [WIDE, PHONE], ids=["wide", "phone"])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_an_accessibility_check_is_clean(chromium, report, size, scheme):
    from axe_playwright_python.sync_playwright import Axe

    page = opened(chromium, report, size, scheme)
    page.evaluate("for (const part of document.querySelectorAll('details')) part.open = true")
    found = Axe().run(page).response["violations"]
    told = [(v["id"], [n["html"][:200] for n in v["nodes"]][:3]) for v in found]
    page.close()
    assert told == []


@pytest.mark.browser
def test_the_accessibility_check_can_fail(chromium, report):
    from axe_playwright_python.sync_playwright import Axe

    page = opened(chromium, report, WIDE)
    page.evaluate("document.querySelector('main').insertAdjacentHTML('beforeend', '<img src=\"data:,\">')")
    assert [v["id"] for v in Axe().run(page).response["violations"]] == ["image-alt"]
    page.close()


@pytest.mark.browser
def test_the_keyboard_reaches_all_and_enlarges_pictures(chromium, report):
    page = opened(chromium, report, WIDE)
    wanted = page.evaluate(
        "[...document.querySelectorAll('main a, main button, main summary')].filter(e => e.checkVisibility()).length"
    )
    reached = set()
    place = "e => [...document.querySelectorAll('*')].indexOf(document.activeElement)"
    kinds = []
    last = -1
    for _ in range(20 * wanted):
        page.keyboard.press("Tab")
        number = page.evaluate(place)
        if number == last:
            continue  # the controls of a film are several
        if number in reached:
            break
        last = number
        reached.add(number)
        kinds.append(page.evaluate("document.activeElement.closest('main') && document.activeElement.tagName"))
    assert sum(kind in ("A", "BUTTON", "SUMMARY") for kind in kinds) == wanted > 30
    picture = page.locator("button.enlarge").first
    picture.focus()
    page.keyboard.press("Enter")
    box = page.locator("#enlarged")
    assert box.evaluate("box => box.open")
    shown = box.locator("img")
    shown.evaluate("image => image.decode()")
    small, large = picture.locator("img").bounding_box(), shown.bounding_box()
    assert large["height"] > 1.5 * small["height"] or large["width"] > 1.5 * small["width"]
    assert shown.get_attribute("src") == picture.locator("img").get_attribute("src")
    page.keyboard.press("Escape")
    assert not box.evaluate("box => box.open")
    assert page.evaluate("document.activeElement.className") == "enlarge"
    assert page.faults == []
    page.close()


@pytest.mark.browser
def test_a_phone_shows_folded_sections_that_links_unfold(chromium, report):
    wide = opened(chromium, report, WIDE)
    assert wide.evaluate("[...document.querySelectorAll('details.folds')].every(part => part.open)")
    wide.close()
    page = opened(chromium, report, PHONE)
    height = page.evaluate("document.documentElement.scrollHeight")
    assert height < 9000
    assert page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"], "nothing overflows sideways"
    link = page.locator("nav a", has_text="random connected graph").first
    link.click()
    name = link.get_attribute("href")[1:]
    page.wait_for_function("name => document.getElementById(name).open", arg=name)  # the page is told of it later
    page.evaluate("for (const part of document.querySelectorAll('details')) part.open = true")
    unnamed = page.evaluate(UNNAMED)
    assert unnamed == [], "numbers that do not say what they are"
    page.close()
