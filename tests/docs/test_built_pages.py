"""The built documentation in a browser: pages are accessible, fit a phone, and ask nothing of another machine.

`make docs-check` builds the pages and runs these tests on them.
"""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from tests.browsers import chromium

__all__ = ["chromium"]

pytestmark = pytest.mark.built_docs

BUILT = Path(os.environ.get("DOCS_OUT", Path(__file__).parents[2] / "docs" / "_build" / "html")).resolve()
WIDE, PHONE = {"width": 1300, "height": 900}, {"width": 390, "height": 844}


EVERY = 60
"""Of the pages of the library by name, which one template makes, each that many is opened."""


def pages() -> list[Path]:
    """All pages that people wrote or that stand alone, and a sample of those of the library by name."""
    found = sorted(BUILT.rglob("*.html"))
    made = [path for path in found if path.parent.name in ("api", "_modules")]
    return [path for path in found if path not in set(made)] + made[::EVERY]


@pytest.fixture
def opened(chromium):
    """Open a page, and what went wrong on it or was asked of another machine."""
    kept = []

    def opening(path, size, scheme="light"):
        page = chromium.new_page(viewport=size, color_scheme=scheme)
        faults = []
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.on("request", lambda request: faults.append(request.url) if request.url.startswith("http") else None)
        page.on("requestfailed", lambda request: faults.append(f"missing: {request.url}"))
        page.goto(path.as_uri())
        kept.append(page)
        return page, faults

    yield opening
    for page in kept:
        page.close()


def violations(page):
    from axe_playwright_python.sync_playwright import Axe

    found = Axe().run(page).response["violations"]
    return [(v["id"], [n["html"][:200] for n in v["nodes"]][:3]) for v in found]


def test_there_are_pages():
    assert len(pages()) > 40, f"no built documentation in {BUILT}: make docs builds it"


@pytest.mark.parametrize(
    ("size", "scheme"), [(WIDE, "light"), (WIDE, "dark"), (PHONE, "light")], ids=["wide", "dark", "phone"]
)
@pytest.mark.parametrize("path", pages(), ids=lambda path: str(path.relative_to(BUILT)))
def test_a_page_is_accessible_and_fits(opened, path, size, scheme):
    page, faults = opened(path, size, scheme)
    assert faults == [], "before the check of accessibility, which reads style sheets anew, and may not from files"
    assert violations(page) == []
    assert page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth") <= 0
    broken = page.evaluate("[...document.images].filter(e => e.complete && !e.naturalWidth).map(e => e.src)")
    assert broken == []


def test_the_check_can_fail(opened):
    page, _ = opened(BUILT / "index.html", WIDE)
    page.evaluate("document.querySelector('article').insertAdjacentHTML('beforeend', '<img src=\"data:,\">')")
    assert [key for key, _ in violations(page)] == ["image-alt"]


def test_what_scrolls_is_reached_by_the_keyboard(opened):
    page, _ = opened(BUILT / "quick_start.html", PHONE)
    scrolls = "[...document.querySelectorAll('pre')].filter(e => e.scrollWidth > e.clientWidth)"
    assert page.evaluate(f"{scrolls}.length") > 0
    assert page.evaluate(f"{scrolls}.every(e => e.tabIndex === 0)")
    fits = scrolls.replace(
        "e.scrollWidth > e.clientWidth", "e.scrollWidth <= e.clientWidth && e.scrollHeight <= e.clientHeight"
    )
    assert page.evaluate(f"{fits}.length") > 0
    assert page.evaluate(f"!{fits}.some(e => e.hasAttribute('tabindex'))"), (
        "what does not scroll is no stop of the keyboard"
    )
