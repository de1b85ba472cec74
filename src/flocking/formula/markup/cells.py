"""Displays of objects in notebooks: short, and unfolded by a click."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

MOST_ROWS = 50
"""Rows of a table in a notebook; of longer tables the number is shown."""


def folded(summary: str, body: str) -> str:
    """A line that unfolds to more.

    Parameters
    ----------
    summary
        The line, as text.
    body
        What it unfolds to, as HTML.
    """
    return f"<details><summary>{escape(summary)}</summary>{body}</details>"


def rows_table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table; cells are HTML.

    Parameters
    ----------
    head
        Names of columns, as text.
    rows
        Its rows.
    """
    shown = list(rows)
    names = "".join(f"<th scope='col' style='text-align: left'>{escape(name)}</th>" for name in head)
    body = "".join(
        "<tr>" + "".join(f"<td style='text-align: left'>{cell}</td>" for cell in row) + "</tr>"
        for row in shown[:MOST_ROWS]
    )
    more = f"<p>and {len(shown) - MOST_ROWS} more rows</p>" if len(shown) > MOST_ROWS else ""
    return f"<table><thead><tr>{names}</tr></thead><tbody>{body}</tbody></table>{more}"
