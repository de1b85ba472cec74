"""The page on adding a paper holds: its one file is audited, listed and described as a paper of the library is."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").split("## Adding a paper")[1].split("\n## ")[0]

PROGRAM = """
from dataclasses import replace
import my_paper
import flocking as fk
from flocking.apps.scenario_names import find_scenario, paper_scenarios
from flocking.papers import add_paper, keys, paper
from flocking.papers.auditing import paper_claims
from flocking.papers.tables import equation_table

key = my_paper.KEY
assert keys()[-1] == key and paper(key) is my_paper.PAPER
assert paper_scenarios()[key][0] == key
assert find_scenario(key, 3, None).seed == 3
assert [c.key for c in paper_claims(key)] == ["agree"]
run = fk.simulate(find_scenario(key, 0, None), progress=False)
assert [(r.claim.key, str(r.verdict)) for r in fk.audit(run).results] == [("agree", "holds")]
assert len(equation_table()) > 100 and equation_table([key]) == []
assert "Alignment" in paper(key).citation
for wrong in (replace(my_paper.PAPER, key="zhou-2015"), replace(my_paper.PAPER, key="other"),
              replace(my_paper.PAPER, home="")):
    try:
        add_paper(wrong)
        raise SystemExit(f"added {wrong.key}")
    except fk.InvalidInput:
        pass
"""


def test_the_file_of_the_page_makes_a_paper_known(tmp_path: Path) -> None:
    (code,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    (tmp_path / "my_paper.py").write_text(code)
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT / "src")])}
    found = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, env=env)
    assert (found.returncode, found.stderr) == (0, "")
