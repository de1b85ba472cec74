"""Tables of the report, as HTML."""

from __future__ import annotations

from collections.abc import Iterable


def table(head: str, rows: Iterable[str]) -> str:
    """A table that scrolls sideways where it is too wide.

    Parameters
    ----------
    head, rows
        Rows as HTML.
    """
    body = "".join(rows)
    return f'<div class="scroll"><table class="claims"><thead>{head}</thead><tbody>{body}</tbody></table></div>\n'


def head_row(*names: str) -> str:
    """The head of a table with these column names."""
    return "<tr>" + "".join(f"<th>{name}</th>" for name in names) + "</tr>"
