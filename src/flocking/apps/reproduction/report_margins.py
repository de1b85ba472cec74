"""Stored margins of a paper's first scenario: how much imperfection of the world its conclusions stood, as HTML."""

from __future__ import annotations

from html import escape

from flocking.apps.reproduction.report_tables import head_row, named_cells, table
from flocking.papers.stored_margins import is_stored, reason_of_plan, stored_margins


def margins_table(key: str) -> str:
    """The stored table of a paper, with what it rests on; empty where none is stored.

    Parameters
    ----------
    key
        Key of the paper.
    """
    if not is_stored(key):
        return ""
    found = stored_margins(key)
    rows = [f"<tr>{named_cells(found.head, map(escape, cells))}</tr>" for cells in found.cells]
    sentences = [*filter(None, [reason_of_plan(key)]), *found.notes]
    notes = "".join(f"<li>{escape(note)}</li>" for note in sentences)
    versions = ", ".join(f"{name} {version}" for name, version in found.provenance.items())
    return (
        f'<p class="dim">Observed, not proven, and stored with the library; not computed by this reproduction: '
        f"<code>flocking margins --papers</code> computes it again. Made by {escape(versions)}.</p>\n"
        f"{table(head_row(*map(escape, found.head)), rows, 'Margins')}<ul>{notes}</ul>\n"
    )
