"""Pages of the documentation ask nothing of any other place, and what they point to is there."""

from __future__ import annotations

import os
import re
import tomllib
from html.parser import HTMLParser
from pathlib import Path

import pytest

import flocking

ROOT = Path(__file__).resolve().parents[2]
LOADING = {
    "script": "src",
    "img": "src",
    "iframe": "src",
    "source": "src",
    "link": "href",
    "video": "src",
    "audio": "src",
}


class Loads(HTMLParser):
    """Collects what a page loads when it is opened, and the text of its formulas."""

    def __init__(self):
        super().__init__()
        self.places = []
        self.formulas = 0

    def handle_starttag(self, tag, attrs):
        found = dict(attrs)
        self.formulas += tag == "math"
        if tag in LOADING and found.get(LOADING[tag]) and found.get("rel") not in ("canonical", "search"):
            self.places.append(found[LOADING[tag]])


def loads(text):
    page = Loads()
    page.feed(text)
    return page


def outside(place):
    return bool(re.match(r"(?:[a-z]+:)?//", place))


def test_what_a_page_loads_is_found():
    page = loads(
        '<script src="https://a.b/c.js"></script><a href="https://a.b"></a><img src="//a.b/c.png"><math></math>'
    )
    assert [p for p in page.places if outside(p)] == ["https://a.b/c.js", "//a.b/c.png"]
    assert page.formulas == 1
    assert not outside("_static/a.css")


def test_the_packages_that_make_the_pages_are_pinned():
    extra = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]["docs"]
    pinned = (ROOT / "docs" / "requirements.txt").read_text().splitlines()
    assert all(re.fullmatch(r"[a-z0-9-]+==[0-9a-z.]+", line) for line in pinned)
    names = {re.match(r"[a-z0-9-]+", line).group() for line in extra}
    assert names <= {line.split("==")[0] for line in pinned}


def test_every_gallery_script_and_page_is_named_where_pages_point_to_it():
    text = "\n".join(path.read_text() for path in (ROOT / "docs").glob("*.md"))
    for name in re.findall(r"sphx_glr_gallery_(plot_\w+)\.py", text):
        assert (ROOT / "gallery" / f"{name}.py").exists()
    for page in re.findall(r"\{doc\}`(\w+)`", text):
        assert (ROOT / "docs" / f"{page}.md").exists()


@pytest.mark.built_docs
def test_built_pages_load_nothing_from_elsewhere_and_hold_formulas_and_pictures():
    """`make docs-check` builds them before, and stops at a warning."""
    pages = Path(os.environ.get("DOCS_OUT", ROOT / "docs" / "_build" / "html")).resolve()
    read = {path.relative_to(pages).as_posix(): loads(path.read_text()) for path in pages.rglob("*.html")}
    assert [(name, place) for name, page in read.items() for place in page.places if outside(place)] == []
    for sheet in pages.rglob("*.css"):
        text = sheet.read_text()
        assert not [p for p in re.findall(r"url\(\s*['\"]?([^'\")]+)", text) if outside(p)], sheet
        assert not re.search(r"@import\s+(?:url\()?['\"]?(?:https?:)?//", text), sheet
    for key in flocking.papers.ALL_KEYS:
        assert read[f"computed/papers/{key}.html"].formulas > 0
    for script in (ROOT / "gallery").glob("plot_*.py"):
        assert f"gallery/{script.stem}.html" in read
        assert (pages / "_images" / f"sphx_glr_{script.stem}_001.png").exists()
    for name in ("quick_start", "notation", "switches", "verdicts", "computed/mutants", "computed/papers/errata"):
        assert f"{name}.html" in read
    assert (
        "flocking.model.terms.pair_terms.Gradient"
        in (pages / "api" / "flocking.model.terms.pair_terms.html").read_text()
    )
