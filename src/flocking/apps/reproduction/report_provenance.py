"""Where the numbers of a report come from: software, machine, engines, and a row for every run that is shown."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from datetime import UTC, datetime
from html import escape

from flocking.apps.reproduction.report_page import facts
from flocking.apps.reproduction.report_tables import head_row, table
from flocking.engine.runs.provenance import version_of
from flocking.engine.runs.run import Run
from flocking.formula.safe_digits import time_text

PACKAGES = ("flocking", "numpy", "scipy", "sympy", "llvmlite", "matplotlib", "networkx", "zarr", "xarray")
"""Packages whose versions are shown: what computes, judges and draws."""


COLUMNS = (
    "engine",
    "agents",
    "first frame",
    "last frame",
    "frames",
    "seed",
    "tolerance",
    "steps",
    "switches",
    "status",
)
"""What is shown of each run; on a phone, where the head of the table is not shown, beside its value."""


def software() -> dict[str, object]:
    """Versions of packages and Python, the machine, and the time."""
    return {
        **{name: version_of(name) for name in PACKAGES},
        "python": f"{platform.python_implementation()} {platform.python_version()}",
        "system": platform.platform(),
        "processor": platform.machine(),
        "written": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
    }


def software_facts(more: Mapping[str, object]) -> str:
    """Versions, machine and time as a list.

    Parameters
    ----------
    more
        What is shown before them, by name.
    """
    return facts([*more.items(), *software().items()])


def runs_table(rows: Mapping[str, tuple[str, Run]]) -> str:
    """A row for each run that is shown.

    Parameters
    ----------
    rows
        Title and run, by the anchor that the title leads to.
    """
    body = [_row(anchor, title, run) for anchor, (title, run) in rows.items()]
    return table(head_row("scenario", *COLUMNS), body, "Runs that are shown")


def _row(anchor: str, title: str, run: Run) -> str:
    s = run.scenario
    span = [time_text(run.t[k], run.t[0], run.t[-1], 6) for k in (0, -1)] if len(run.t) else ["no frames", ""]
    numbers = (
        run.provenance.get("engine", ""), run.n, *span,
        len(run.t), "none" if s.seed is None else s.seed, f"{s.tolerance:g}",
        run.provenance.get("steps", "not recorded"),
        len(run.switches) if run.fidelity.switches_located else "not recorded", run.status,
    )  # fmt: skip
    named = zip(COLUMNS, numbers, strict=True)
    cells = "".join(f"<td class='count' data-name='{name}'>{escape(str(x))}</td>" for name, x in named)
    return f'<tr><td><a href="#{escape(anchor)}">{escape(title)}</a></td>{cells}</tr>'
