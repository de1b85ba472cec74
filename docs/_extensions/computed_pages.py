"""Pages that state facts of the library, computed when the documentation is built."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

from file_pages import scenario_files_page, sweep_files_page
from paper_pages import errata_page, paper_page
from switch_picture import draw_switch
from text_tables import code, table
from tile_picture import draw_tile

from flocking.papers import ALL_KEYS


def papers_index() -> str:
    """The page that lists the papers."""
    pages = "\n".join(ALL_KEYS)
    return (
        "# The papers\n\nEvery number, claim, reading and erratum on these pages is read from `flocking.papers` when "
        "they are built, and every counter-example is computed then.\n\n"
        f"```{{toctree}}\n:maxdepth: 1\n\n{pages}\nerrata\n```\n"
    )


def mutants_page() -> str:
    """Which claim catches which wrong system."""
    from flocking.papers.mutation import CASES
    from flocking.papers.mutation import table as caught_mutants

    rows = [
        (
            one.mutant,
            code(one.scenario),
            ", ".join(map(code, one.fails)) or "none",
            ", ".join(map(code, one.unresolved)) or "none",
        )
        for one in caught_mutants(lambda: tuple(name for name, (_, key, _) in CASES.items() if key in ALL_KEYS))
    ]
    return (
        "# Mutants\n\nAn audit that cannot fail is worthless. In each row one thing about the moving agents is wrong, "
        "and the audit, which is not told, holds the motion against the law that was declared. Listed are the claims "
        "that hold for the right system and fail, or are left open, for the wrong one. Claims that begin with "
        "`paper:` are the paper's own. The table was computed when this page was built. Wrong motions of systems in "
        "discrete time are tests, see {ref}`can-the-audit-fail`.\n\n"
        + table(("what is wrong", "declared scenario", "claims that fail", "claims left open"), rows)
    )


def command_line_page() -> str:
    """What every command says when asked for help."""
    from flocking.apps.cli import command_line

    commands = ["", *(name for name in command_line() if not name.startswith("-"))]
    environment = {**os.environ, "COLUMNS": "88", "NO_COLOR": "1"}
    parts = [
        "# Command line\n\nExit codes: 0 fine, 1 a verdict or a run came out otherwise, 2 bad input, 130 interrupted. "
        "With `--json` a command prints one JSON document and nothing else to its output.\n"
    ]
    for command in commands:
        words = [sys.executable, "-m", "flocking", *([command] if command else []), "--help"]
        shown = subprocess.run(words, capture_output=True, text=True, env=environment, check=True)
        text = "\n".join(line.rstrip() for line in shown.stdout.strip().splitlines())
        parts.append(f"## flocking {command}\n\n```text\n{text}\n```\n".replace("flocking \n", "flocking\n"))
    return "\n".join(parts)


def write_pages(app: Any) -> None:
    """Write all pages anew."""
    folder = Path(app.srcdir) / "computed"
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "papers").mkdir(parents=True)
    pages = {f"papers/{key}": paper_page(key) for key in ALL_KEYS}
    pages |= {"papers/index": papers_index(), "papers/errata": errata_page()}
    pages |= {"mutants": mutants_page(), "command_line": command_line_page()}
    pages |= {"scenario_files": scenario_files_page(), "sweep_files": sweep_files_page()}
    for name, text in pages.items():
        (folder / f"{name}.md").write_text(text)
    draw_switch(folder / "switch.png")
    draw_tile(folder / "tile.png")


def setup(app: Any) -> dict[str, Any]:
    """Write the pages before they are looked for."""
    app.connect("builder-inited", write_pages, priority=100)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
