"""The showcase command: runs, audits and draws a large scenario of the gallery."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from flocking.apps.json_output import print_json

if TYPE_CHECKING:
    from flocking.papers.showcases.stored_summary import StoredSummary
    from flocking.study.claims.audit import Report

FINE, DIFFERENT, INTERRUPTED = 0, 1, 130
"""Exit codes: success, an outcome other than expected, and, as shells have it, 128 + 2 after the interrupt signal."""


def showcase(
    name: str,
    /,
    *,
    out: Path | None = None,
    engine: str = "tiles",
    agents: int | None = None,
    until: float | None = None,
    threads: int | None = None,
    as_json: Annotated[bool, Parameter(name="--json")] = False,
) -> int:
    """Make a large run of the gallery: run it, audit it, draw it. The same command continues it.

    The exit code is 1 when the ledger of the audit does not hold.

    Parameters
    ----------
    name
        One of obstacle-field, flock-from-noise, cluster-obstacles; 'flocking run' knows the same scenarios.
    out
        Folder for the run, its audit, its summary and its picture; out/showcases/NAME when absent.
    engine
        The engine: tiles, or lammps (also under mpiexec).
    agents
        Size of a smaller group of the same density, at the same distance from obstacles.
    until
        An earlier end time.
    threads
        Threads of the tiled engine; all processors when absent.
    as_json
        Print JSON.
    """
    from flocking.engine.driver.waits import Wait, stage
    from flocking.engine.interruption import partial_results
    from flocking.engine.storage.atomic_files import write_file
    from flocking.papers.auditing import audit
    from flocking.papers.showcases.shipped import showcase as showcase_named
    from flocking.show.style import save
    from flocking.study.claims.claim import Verdict

    chosen = showcase_named(name)
    folder = out or Path("out") / "showcases" / name
    scenario = chosen.scenario(agents=agents, until=until)
    with partial_results():
        run = chosen.run(folder / "run", scenario, engine=engine, progress=True, threads=threads)
    if run.rank:
        return FINE  # only the first rank of the job prints
    if run.status.startswith("interrupted"):
        print(f"flocking: {run.status}; the same command continues it.", file=sys.stderr)
        return INTERRUPTED
    with Wait("showcase"):
        report = audit(run)
        stage("summing up the run")
        summary = chosen.summary_of(run, report)
        written = [summary.write(folder / f"{name}.npz"), folder / "audit.json"]
        write_file(written[1], json.dumps(report.as_dict(), indent=2, default=str).encode(), "write the audit")
        if summary.drawable:
            stage("drawing")
            written += save(chosen.draw(summary), folder / name, ("png",))
    _print(chosen.title, report, summary, written, as_json)
    return FINE if report["ledger"].verdict == Verdict.HOLDS else DIFFERENT


def _print(title: str, report: Report, summary: StoredSummary, written: list[Path], as_json: bool) -> None:
    from flocking.apps.tables import print_facts, print_table, short
    from flocking.formula.safe_digits import rounded_down

    if as_json:
        print_json({**summary.facts, "files": [str(path) for path in written]})
        return
    rows = [(r.claim.key, str(r.verdict), short(r.margin), r.note) for r in report.results]
    print_table(("claim", "verdict", "margin", "measured"), rows, title=title)
    print()
    facts = summary.facts
    # Rounded down: 100 % is all of them.
    largest = rounded_down(100 * facts["largest"][-1], 4)
    seen: list[tuple[str, str]] = [
        ("agents", f"{facts['agents']:,}"),
        ("steps", f"{facts['provenance']['steps']:,} of {facts['provenance']['step']:g}"),
        ("in the largest flock", f"{largest} % at the end, of {facts['flocks'][-1]:,} flocks"),
    ]
    if "clearance" in facts:
        seen.append(
            ("nearest an obstacle", f"{min(facts['clearance']):.3g} at the frames; {max(facts['inside'])} inside")
        )
    if "hexatic" in facts:
        seen.append(("hexatic order", f"{facts['hexatic'][0]:.3f} at the start, {facts['hexatic'][-1]:.3f} at the end"))
    print_facts([*seen, ("written", ", ".join(str(path) for path in written))])


__all__ = ["showcase"]
