"""The Python code on the pages runs as it stands."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

DOCS = Path(__file__).resolve().parents[2] / "docs"
BEFORE = {
    "index": "",
    "bodies": "",
    "quick_start": "",
    "margins": "",
    "from_theorem_to_radio": "",
    "loss_widens_the_bound": "",
    "world": "",
    "certificates": "",
    "before_the_run": "",
    "safety_filter": "",
    "audit_data": "",
    "released_programs": "",
    "two_papers": "",
    "large_groups": "import flocking as fk",
    "writing_laws": (
        "import flocking as fk\nlaw = fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0)])\n"
        "state = fk.State([[0.0, 0.0], [1.0, 0.0]], [[0.0, 1.0], [0.0, 0.0]])\n"
        "agent = fk.Agent(state.q[0], state.p[0])\n"
        "neighbours = [fk.Agent(state.q[1], state.p[1])]\nt = 0.0\n"
    ),
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


def blocks(page):
    return re.findall(r"```python\n(.*?)```", (DOCS / f"{page}.md").read_text(), re.DOTALL)


def test_every_page_with_code_is_run():
    found = {path.stem for path in DOCS.glob("*.md") if blocks(path.stem)}
    assert set(BEFORE) <= found
    assert found <= {*BEFORE, *ELSEWHERE}


@pytest.mark.parametrize("page", sorted(BEFORE))
def test_code_of_a_page_runs(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {"__name__": __name__}
    exec(BEFORE[page], names)
    for block in blocks(page):
        exec(compile(block, f"{page}.md", "exec"), names)
