"""A page about one run: its law, its claims beside pictures, its certificates, and where it comes from."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from html import escape
from pathlib import Path
from tempfile import TemporaryDirectory

from flocking.apps.reproduction.claim_pictures import draw_pictures, picture_of
from flocking.apps.reproduction.report_certificates import certificates_table
from flocking.apps.reproduction.report_claims import claims_beside_pictures
from flocking.apps.reproduction.report_page import boxes, contents, facts, page
from flocking.apps.reproduction.report_provenance import runs_table, software_facts
from flocking.apps.reproduction.report_scenarios import scenario_section
from flocking.engine.driver.waits import counted
from flocking.engine.runs.run import Run
from flocking.engine.storage.atomic_files import write_file
from flocking.errors import FlockingError
from flocking.formula.safe_digits import time_text
from flocking.papers import paper, paper_of
from flocking.study.claims.audit import Report
from flocking.study.claims.claim import Verdict

UNSAID = ("scenario", "seed", "engine", "steps", "tolerance")
"""What the table of the run contains already."""


PLURAL = {Verdict.HOLDS: "hold", Verdict.FAILS: "fail"}
"""Verdicts that are verbs, about several claims."""


def title_of(run: Run, otherwise: str = "") -> str:
    """Title of the scenario of a run: that of its paper, its name, or what it is called ``otherwise``."""
    name = run.scenario.name
    key = paper_of(name)
    return paper(key).title_of(name) if key else name or otherwise or "A run"


def write_run_page(
    report: Report, path: Path, *, law_declared: bool = True, stated: Mapping[str, str] | None = None, source: str = ""
) -> Path:
    """Write the page of an audit: one file that loads nothing else.

    Parameters
    ----------
    report
        The verdicts, with their run.
    path
        The file to write.
    law_declared
        Whether the run has a law; samples judged without one have none.
    stated
        Facts about its source, by name, such as the file of samples.
    source
        What to call a run whose scenario has no name.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    InvalidInput
        When the file cannot be written.
    """
    run = report.run
    title = title_of(run, source)
    with TemporaryDirectory() as folder:
        undrawn = _draw(report, Path(folder))
        beside = claims_beside_pictures(run.scenario.name, report.results, Path(folder), {})
    counts = Counter(r.verdict for r in report.results)
    entries = [("law", "Law and start", ())] if law_declared else []
    entries += [("claims", "Claims", ()), ("provenance", "Provenance", ())]
    ends = [time_text(run.t[k], run.t[0], run.t[-1], 6) for k in (0, -1)] if len(run.t) else []
    span = f"frames from t = {ends[0]} to {ends[1]}" if ends else "no frames"
    agents = f"{run.n} agent{'s' * (run.n > 1)}"
    parts = [
        f"<h1>{escape(title)}</h1>\n",
        f'<p class="dim">Audit of one run: {agents}, {span}, status: {escape(run.status)}.</p>\n',
        boxes([(str(count), PLURAL.get(verdict, str(verdict))) for verdict, count in counts.items()]),
        f"<p>{escape(outcome(report))}</p>\n",
        contents(entries),
    ]
    if law_declared:
        parts.append(f'<h2 id="law">Law and start</h2>\n{scenario_section(run.scenario)}')
    parts.append(f'<h2 id="claims">Claims</h2>\n{beside}')
    if undrawn:
        parts.append(f'<p class="dim">No picture could be drawn of: {escape("; ".join(undrawn))}.</p>\n')
    if law_declared:
        parts.append(certificates_table(run))
    own = {k: v for k, v in run.provenance.items() if k not in UNSAID}
    parts.append(
        f'<h2 id="provenance">Provenance</h2>\n{facts([*(stated or {}).items(), *own.items()])}'
        f"<h3>This page</h3>\n{software_facts({})}{runs_table({'claims': (title, run)})}"
    )
    return write_file(path, page(f"{title}: audit", "".join(parts)).encode(), "write the page")


def outcome(report: Report) -> str:
    """What came out of a ``report`` in a sentence."""
    failed = [r.claim.key for r in report.results if r.verdict is Verdict.FAILS]
    undecided = sum(r.verdict not in (Verdict.HOLDS, Verdict.FAILS) for r in report.results)
    decided = len(report.results) - undecided
    expected = "" if report.as_expected else " Some verdicts differ from what is expected; they are framed."
    failing = f" Failing: {', '.join(failed)}." if failed else ""
    return f"{decided} of {len(report.results)} claims are decided by this run.{failing}{expected}"


def _draw(report: Report, folder: Path) -> list[str]:
    """Draw the pictures of the claims; return those that cannot be drawn, with the reasons."""
    undrawn = []
    for name in counted(dict.fromkeys(picture_of(r.claim) for r in report.results), "pictures"):
        try:
            draw_pictures(report.run, (name,), folder)
        except (FlockingError, ValueError, KeyError, IndexError) as error:
            undrawn.append(f"{name} ({error})")
    return undrawn
