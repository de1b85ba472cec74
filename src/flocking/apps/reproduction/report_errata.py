"""Errata and equation table of a paper in the report, as HTML."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from html import escape

from flocking.apps.reproduction.report_page import more
from flocking.apps.reproduction.report_tables import head_row, named_cells, table
from flocking.formula.markup.text_formulas import set_text
from flocking.papers.description import Paper
from flocking.papers.equation_table import Fault, RowData

HEADINGS = {
    Fault.FALSE: "False statements, each with a computed counter-example",
    Fault.MISPRINT: "Misprints, and how they are read",
    Fault.READING: "Ambiguities and missing values, and what is chosen here",
    Fault.OWN: "Not printed: questions of our own",
}
"""Headings of the tables of errata; only the first contradict the mathematics of a paper."""


def errata_tables(rows: Sequence[RowData]) -> str:
    """One table for each kind of fault that a paper has, with the number of its rows.

    Parameters
    ----------
    rows
        Rows of the equation table as plain data.
    """
    parts = []
    for fault, heading in HEADINGS.items():
        chosen = [row for row in rows if row["verdict"] == fault]
        if chosen:
            parts.append(f"<h4>{escape(heading)} ({len(chosen)})</h4>\n" + _faults(fault, chosen))
    return "".join(parts)


def _faults(fault: Fault, rows: Sequence[RowData]) -> str:
    shown = any(row["demonstration"] for row in rows)
    items = [_fault(fault, row, shown) for row in rows]
    columns = ("where", "what", "printed", "true", "example") if shown else ("where", "what")
    return table(head_row(*columns), items, HEADINGS[fault])


def _fault(fault: Fault, row: RowData, shown: bool) -> str:
    colour = "wrong" if fault is Fault.FALSE else "other"
    text = (
        f'<tr><td class="verdict {colour}">{set_text(row["number"], letters=False)}</td>'
        f'<td>{set_text(row["title"])}<br><span class="dim">{set_text(row["reason"] or row["note"])}</span></td>'
    )
    if shown:
        found = row["demonstration"] or {"printed": "", "true": "", "example": ""}
        text += "".join(
            f'<td class="count" data-name="{name}">{_number(found[name])}</td>' for name in ("printed", "true")
        )
        text += f"<td>{set_text(str(found['example']))}</td>"
    return text + "</tr>"


def _number(value: float | str) -> str:
    return f"{value:.6g}" if isinstance(value, int | float) else escape(str(value))


def equation_table(article: Paper) -> str:
    """The equation table of a paper, collapsed.

    Parameters
    ----------
    article
        The paper.
    """
    rows = [row.as_dict() for row in article.equations()]
    counts = Counter(row["verdict"] for row in rows)
    body = "".join(map(_equation, rows))
    verdicts = ", ".join(f"{count} {verdict}" for verdict, count in sorted(counts.items()))
    head = head_row("number", "statement", "verdict", "home")
    return more(
        f"Equation table: {len(rows)} rows ({escape(verdicts)})", table(head, (body,), f"Equations of {article.title}")
    )


def _equation(row: RowData) -> str:
    note = f'<br><span class="dim">{set_text(row["note"])}</span>' if row["note"] else ""
    home = f"<code>{escape(row['home'].removeprefix('flocking.'))}</code>"
    return (
        f"<tr><td>{set_text(row['number'], letters=False)}</td><td>{set_text(row['title'])}{note}</td>"
        f"{named_cells(('verdict', 'home'), (escape(row['verdict']), home))}</tr>"
    )
