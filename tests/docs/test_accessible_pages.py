"""What the documentation mends in written pages: each piece, once, and nothing else."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "docs" / "_extensions"))

from accessible_pages import mended

PIECES = {
    '<p class="caption" role="heading"><span>Tutorials</span></p>': 'role="heading" aria-level="2">',
    '<aside class="sidebar-drawer">': '<aside class="sidebar-drawer" aria-label="Pages">',
    '<aside class="toc-drawer">': '<aside class="toc-drawer" aria-label="On this page">',
    '<aside class="toc-drawer no-toc">': '<aside class="toc-drawer no-toc" aria-label="On this page">',
    '<tr><th class="head"><p></p></th><th>x</th></tr>': "<tr><td></td><th>x</th></tr>",
    "(</span>\n\n<dl>\n<dd><em>a</em>,</dd>\n<dd><em>b</em>,</dd>\n</dl>\n": (
        '<span class="parameter-line"><em>a</em>,</span>\n<span class="parameter-line"><em>b</em>,</span>\n</span>'
    ),
    '<p><a class="reference internal" href="x.html"><span class="doc">A net</span></a></p>\n  <div class="title">': (
        '<a class="reference internal" aria-label="A net" href="x.html"><span class="doc">A net</span></a>'
    ),
    '<div id="search-results"></div>': '<h1>Search</h1>\n<div id="search-results"></div>',
}


@pytest.mark.parametrize("piece", PIECES)
def test_a_piece_is_mended_once(piece):
    once = mended(f"<body>{piece}</body>")
    assert PIECES[piece] in once
    assert mended(once) == once


def test_what_is_fine_stays():
    fine = "<dl>\n<dt>word</dt>\n<dd>what it is</dd>\n</dl><table><th>x</th></table><aside class='own'></aside>"
    assert mended(fine) == fine
