"""What was guaranteed of a run before it ran, beside what it shows, as HTML."""

from __future__ import annotations

from html import escape

from flocking.apps.reproduction.report_page import more
from flocking.apps.reproduction.report_tables import head_row, named_cells, table
from flocking.engine.runs.run import Run
from flocking.formula.markup.text_formulas import set_text
from flocking.formula.safe_digits import bound_text
from flocking.study.certificates.beside.guaranteed_claims import OTHER_RUN
from flocking.study.certificates.certify import certify
from flocking.study.certificates.comparison import compare

VERDICTS = {True: "yes", False: "no", None: "not resolved"}
"""Words for whether a promise was kept."""


COMPARED = ("promised", "observed", "kept")
"""What is shown of each certificate beside its statement and theorem."""


def certificates_table(run: Run) -> str:
    """The certificates that are granted to the scenario of a run, or why none is.

    Parameters
    ----------
    run
        The run.
    """
    if run.fidelity.changed:
        return f'<p class="dim">{escape(OTHER_RUN)}</p>\n'
    found = certify(run.scenario)
    seen = {row.key: row for row in compare(found, run)} if len(run.t) else {}
    if not found.granted:
        reasons = dict.fromkeys(each.reason for each in found.all if each.reason)
        items = "".join(f"<li>{escape(reason)}</li>" for reason in reasons)
        why = more("Why, for each kind of guarantee", f"<ul>{items}</ul>")
        return f'<p class="dim">Nothing is guaranteed before the run.</p>\n{why}'
    rows = []
    for each in found.granted:
        row = seen.get(each.key)
        observed = "" if row is None else f"{row.observed:.4g}"
        verdict = "" if row is None else VERDICTS[row.kept]
        promised = "" if each.safe_bound is None else f"{each.side} {bound_text(each.safe_bound, each.side, 4)}"
        rows.append(
            f"<tr><td>{set_text(each.statement)}</td><td>{set_text(each.source, letters=False)}</td>"
            f"{named_cells(COMPARED, (escape(promised), observed, verdict))}</tr>"
        )
    head = head_row("guaranteed before the run", "theorem", *COMPARED)
    return f"<h4>Certificates</h4>\n{table(head, rows, 'Certificates')}"
