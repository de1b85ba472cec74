"""The page on adding a body holds: its one file makes a body known to files, the exact engine, disk and the lab."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").split("## Adding a body")[1].split("\n## ")[0]

PROGRAM = r"""
import json, sys
import numpy as np
import my_body
import flocking as fk
from flocking.apps.lab.experiment.experiment import Experiment
from flocking.model.serial import from_data, to_data
from flocking.study.scenario_files.scenario_file import ScenarioFileError, parse_scenario, scenario_to_text

FILE = '''
t_end = 1.0
frames = 5
terms = [{kind = "consensus", gain = 1.0}]
graph = {kind = "proximity", radius = 3.0}
start = {q = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], p = [[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]], columns.force = FORCE}
agents = {kind = "actuated", time_constant = [0.1, 0.2, 0.3], damping = 0.1}
'''
GIVEN = "[[0.5, 0.0], [0.0, 0.0], [0.0, -0.5]]"
found = parse_scenario(FILE.replace("FORCE", GIVEN))
assert type(found.agents) is my_body.Actuated and found.start.columns["force"].tolist() == json.loads(GIVEN)
again = parse_scenario(scenario_to_text(found))
data = json.loads(json.dumps(to_data(found)))
assert to_data(again) == to_data(found) == to_data(from_data(data))

for wrong, says in (
    (FILE.replace("FORCE", "[[1.0, 2.0]]"), "a row for each of the 3 agents"),
    (FILE.replace("FORCE", GIVEN).replace("0.2, 0.3", "0.2"), "time_constant"),
    (FILE.replace("FORCE", GIVEN).replace("0.1, 0.2", "0.0, 0.2"), "time_constant"),
    (FILE.replace("FORCE", "[['a', 2.0]]"), "force"),
):
    try:
        parse_scenario(wrong)
        raise AssertionError(says)
    except (ScenarioFileError, fk.InvalidInput) as error:
        assert says in str(error), error

run = fk.simulate(found, progress=False, save=sys.argv[1] + "/run")
assert np.abs(run.residual).max() < 1e-9 and run.columns["force"][0].tolist() == json.loads(GIVEN)
fast = fk.simulate(found, engine="tiles", step=0.005, progress=False)
assert np.abs(fast.q - run.q).max() < 1e-7 and np.abs(fast.columns["force"] - run.columns["force"]).max() < 1e-6
held = {"control": fk.Held(0.1), "information": fk.Messages(0.1, delay=0.03, loss=0.2)}
ticked = fk.simulate(found.with_(**held), progress=False)
force = fk.State(found.start.q, found.start.p, columns={"applied": found.start.columns["force"]})
closed = found.with_(agents=fk.Lagged(fk.PointMass(damping=0.1), [0.1, 0.2, 0.3]), start=force, **held)
closed = fk.simulate(closed, progress=False)
assert ticked.fidelity.ledger.kind == "tolerance" and closed.fidelity.ledger.kind == "estimate"
assert np.abs(ticked.q - closed.q).max() < 1e-8
assert np.abs(ticked.columns["force"] - closed.columns["applied"]).max() < 1e-7
assert fk.replay(ticked).agrees
stored = fk.read_run(sys.argv[1] + "/run")
assert stored.columns["force"].tobytes() == run.columns["force"].tobytes()
assert to_data(stored.scenario) == to_data(found)

apart = FILE.replace("[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]", "[[0.0, 0.0], [100.0, 0.0], [0.0, 100.0]]")
alone = fk.simulate(parse_scenario(apart.replace("FORCE", GIVEN)), progress=False)
decay = np.exp(-alone.t[:, None, None] / np.array([0.1, 0.2, 0.3])[:, None])
assert np.abs(alone.columns["force"] - decay * np.array(json.loads(GIVEN))).max() < 1e-8

experiment = Experiment(found)
experiment.advance(0.5)
experiment.apply({"kind": "set", "path": ["agents", "time_constant"], "value": 0.4})
before = experiment.state.columns["force"]
experiment.apply({"kind": "kill", "agents": [1]})
assert np.abs(experiment.state.columns["force"] - before[[0, 2]]).max() < 1e-12
experiment.apply({"kind": "add", "q": [2.0, 2.0], "p": [0.0, 0.0]})
assert experiment.state.columns["force"][-1].tolist() == [0.0, 0.0] and experiment.state.n == 3
assert np.abs(experiment.state.columns["force"][:2] - before[[0, 2]]).max() < 1e-12
experiment.advance(0.8)
"""


def test_the_file_of_the_page_makes_its_body_known_everywhere(tmp_path: Path) -> None:
    (code,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    (tmp_path / "my_body.py").write_text(code)
    paths = [str(tmp_path), str(ROOT), str(ROOT / "src")]
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    found = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(tmp_path)], capture_output=True, text=True, env=env, timeout=300
    )
    assert found.returncode == 0, found.stderr
