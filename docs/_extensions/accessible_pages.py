"""Mends in the written pages what Sphinx, its theme and its gallery leave out that readers of screens need.

Each mend is of one known piece of their HTML; `make docs-check` holds the pages against an automatic check, so that a
piece that a later version writes in another way is noticed.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

MENDS = (
    # A role of a heading without a level; captions of the list of pages stand below the title of the documentation.
    (re.compile(r'<p class="caption" role="heading">'), '<p class="caption" role="heading" aria-level="2">'),
    # Two landmarks without names: what they hold tells them apart.
    (re.compile(r'<aside class="sidebar-drawer">'), '<aside class="sidebar-drawer" aria-label="Pages">'),
    (re.compile(r'<aside class="toc-drawer( no-toc)?">'), r'<aside class="toc-drawer\1" aria-label="On this page">'),
    # A cell that heads nothing is no header.
    (re.compile(r'<th class="head[^"]*">(?:<p></p>)?</th>'), "<td></td>"),
    # Parameters of a signature are no definitions of terms.
    (re.compile(r"<dl>\n((?:<dd>.*</dd>\n)+)</dl>"), None),
    # The link of a picture in the gallery: the style sheet of the gallery hides its words.
    (
        re.compile(r'(<a class="reference internal") (href="[^"]*"><span class="doc">([^<]*)</span></a></p>\n  <div)'),
        r'\1 aria-label="\3" \2',
    ),
    # The page of the search gets its heading by a script after a search only.
    (re.compile(r'(?<!</h1>\n)<div id="search-results"></div>'), '<h1>Search</h1>\n<div id="search-results"></div>'),
)
"""What is found and what takes its place; None for lines of a signature. A second time nothing more is found."""


def lines_of_signature(found: re.Match[str]) -> str:
    """The parameters of a signature, a line each, as plain boxes."""
    lines = found.group(1).replace("<dd>", '<span class="parameter-line">').replace("</dd>", "</span>")
    return f'<span class="parameter-lines">\n{lines}</span>'


def mended(text: str) -> str:
    """A page with everything mended."""
    for pattern, place in MENDS:
        text = pattern.sub(lines_of_signature if place is None else place, text)
    return text


def mend_pages(app: Any, failure: Exception | None) -> None:
    """Mend all pages that were written."""
    if failure is not None or app.builder.format != "html":
        return
    for path in Path(app.outdir).rglob("*.html"):
        old = path.read_text(encoding="utf-8")
        new = mended(old)
        if new != old:
            path.write_text(new, encoding="utf-8")


def setup(app: Any) -> dict[str, Any]:
    """Register with Sphinx."""
    app.connect("build-finished", mend_pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
