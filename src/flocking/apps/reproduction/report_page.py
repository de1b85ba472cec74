"""The frame of reports: head, contents, folding sections, and pictures that enlarge."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path

from flocking.apps.reproduction.report_style import SCRIPT, STYLE, font_face

Contents = Sequence[tuple[str, str, Sequence[tuple[str, str]]]]
"""Entries of a list of contents: anchor, title, and entries below it."""

ENLARGED = (
    '<dialog id="enlarged" aria-label="Enlarged picture"><button type="button">Close</button>'
    '<p></p><img alt=""></dialog>'
)
"""Where pictures are enlarged."""


def page(title: str, body: str) -> str:
    """A whole page.

    Parameters
    ----------
    title
        Its title, as text.
    body
        What stands in it, as HTML.
    """
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{font_face()}{STYLE}</style>\n</head>\n"
        f'<body>\n<a class="skip" href="#content">Skip to the content</a>\n<main id="content" tabindex="-1">\n{body}'
        f"</main>\n{ENLARGED}\n<script>{SCRIPT}</script>\n</body>\n</html>\n"
    )


def contents(entries: Contents) -> str:
    """A list of contents with links.

    Parameters
    ----------
    entries
        Its entries.
    """

    def item(anchor: str, title: str, below: Sequence[tuple[str, str]]) -> str:
        inner = "".join(item(a, t, ()) for a, t in below)
        return f'<li><a href="#{escape(anchor)}">{escape(title)}</a>{f"<ul>{inner}</ul>" if inner else ""}</li>'

    return f'<nav aria-label="Contents"><ul>{"".join(item(*entry) for entry in entries)}</ul></nav>\n'


def folding(anchor: str, heading: str, body: str, *, level: int = 3, open_: bool = True) -> str:
    """A section that folds; on a phone it begins folded.

    Parameters
    ----------
    anchor
        Where links lead.
    heading, body
        As HTML.
    level
        Level of the heading.
    open_
        Whether it begins open on a wide screen.
    """
    return (
        f'<details class="folds" id="{escape(anchor)}"{" open" if open_ else ""}><summary>'
        f"<h{level}>{heading}</h{level}></summary>\n{body}</details>\n"
    )


def more(heading: str, body: str) -> str:
    """A part that begins folded everywhere.

    Parameters
    ----------
    heading, body
        As HTML.
    """
    return f'<details class="more"><summary>{heading}</summary>{body}</details>\n'


def facts(pairs: Iterable[tuple[str, object]]) -> str:
    """Names and values, one pair a line.

    Parameters
    ----------
    pairs
        The pairs.
    """
    return "<dl>" + "".join(f"<dt>{escape(n)}</dt><dd>{escape(str(v))}</dd>" for n, v in pairs) + "</dl>\n"


def boxes(numbers: Iterable[tuple[str, str]]) -> str:
    """Counts, each in a box with what is counted.

    Parameters
    ----------
    numbers
        Pairs of a number and what it counts.
    """
    shown = "".join(f"<div><b>{escape(value)}</b>{escape(name)}</div>" for value, name in numbers)
    return f'<div class="numbers">{shown}</div>\n'


def embedded(path: Path, kind: str) -> str:
    """A file as a data URL.

    Parameters
    ----------
    path
        The file.
    kind
        Its media type.
    """
    return f"data:{kind};base64,{base64.b64encode(path.read_bytes()).decode()}"


def card(source: str, caption: str, *, video: bool = False) -> str:
    """A picture that enlarges, or a film, with its caption.

    Parameters
    ----------
    source
        Address of the picture.
    caption
        What it shows, as text.
    video
        Whether it is a video and not a picture.
    """
    text = escape(caption)
    shown = (
        f'<video src="{source}" controls loop muted playsinline aria-label="{text}"></video>'
        if video
        else f'<button type="button" class="enlarge" aria-label="Enlarge: {text}">'
        f'<img src="{source}" alt="{text}"></button>'
    )
    return f"<figure>{shown}<figcaption>{text}</figcaption></figure>"
