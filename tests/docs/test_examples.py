"""The Python code on the pages runs as it stands, and prints what stands below it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from flocking.engine.storage import export_formats

DOCS = Path(__file__).resolve().parents[2] / "docs"
BEFORE = {
    "index": "",
    "bodies": "",
    "margins": "",
    "loss_widens_the_bound": "",
    "world": "",
    "certificates": "",
    "safety_filter": "",
    "released_programs": "",
    "export": "",
    "five_papers": "",
    "linearisation": "",
    "two_papers": "",
    "large_groups": "import flocking as fk",
    "storage": (
        "import flocking as fk\nlaw = fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0)])\n"
        "scenario = fk.Scenario(law, fk.start.box(3, side=1, speed=1, seed=0), t_end=1)\n"
    ),
    "tiles": (
        "import flocking as fk\nlaw = fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0)])\n"
        "scenario = fk.Scenario(law, fk.start.box(50, side=10, speed=1, seed=0), t_end=0.1, frames=3)\n"
    ),
}  # fmt: skip

ELSEWHERE = {"sweeps", "cluster", "lab"}
"""Pages whose code makes hundreds of runs or needs a cluster or a browser; what it calls has tests of its own."""


PRINTED = re.compile(r"```python\n(.*?)```(?:\n\n```text\n(.*?)```)?", re.DOTALL)


def blocks(page):
    """Pieces of code, each with the text that stands below it as what it prints."""
    return PRINTED.findall((DOCS / f"{page}.md").read_text())


def test_every_page_with_code_is_run(notebooks):
    found = {path.stem for path in DOCS.glob("*.md") if blocks(path.stem)}
    run = {*BEFORE, *notebooks.TUTORIALS}
    assert run <= found
    assert found <= {*run, *ELSEWHERE}


@pytest.mark.parametrize("page", sorted(BEFORE))
def test_code_of_a_page_runs_and_prints_what_stands_below_it(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {"__name__": __name__}
    # A page registers a format of its own, which is not there for other tests.
    monkeypatch.setattr(export_formats, "FORMATS", dict(export_formats.FORMATS))
    exec(BEFORE[page], names)
    capsys.readouterr()
    for block, printed in blocks(page):
        exec(compile(block, f"{page}.md", "exec"), names)
        shown = capsys.readouterr().out
        assert not printed or shown.split() == printed.split(), shown
