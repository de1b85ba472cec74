"""Tables of the report, as HTML."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape


def table(head: str, rows: Iterable[str], label: str = "table") -> str:
    """A table that scrolls sideways where it is too wide, by the keyboard too.

    Parameters
    ----------
    head, rows
        Rows as HTML.
    label
        What the table is, for readers who do not see it.
    """
    body = "".join(rows)
    return (
        f'<div class="scroll" tabindex="0" role="group" aria-label="{escape(label)}">'
        f'<table class="claims"><thead>{head}</thead><tbody>{body}</tbody></table></div>\n'
    )


def head_row(*names: str) -> str:
    """The head of a table with these column names."""
    return "<tr>" + "".join(f'<th scope="col">{name}</th>' for name in names) + "</tr>"
