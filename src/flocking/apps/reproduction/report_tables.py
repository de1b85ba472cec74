"""Tables of the report, as HTML."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
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


def named_cells(names: Sequence[str], values: Iterable[str]) -> str:
    """Cells that state their column, for phones, where the head of the table is not shown.

    Parameters
    ----------
    names
        Names of the columns, as text.
    values
        What stands in them, as HTML.
    """
    return "".join(f'<td data-name="{escape(name)}">{value}</td>' for name, value in zip(names, values, strict=True))


def head_row(*names: str) -> str:
    """The head of a table with these column names."""
    return "<tr>" + "".join(f'<th scope="col">{name}</th>' for name in names) + "</tr>"
