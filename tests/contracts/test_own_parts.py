"""The page on adding a part holds: its one file makes a term, a graph and a start known everywhere."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").split("## Adding a part")[1]

FILE = """
t_end = 0.2
frames = 3
terms = [{kind = "closing_speed", gain = 0.5}, {kind = "closing_speed", over = "loose"}]
graph = {kind = "tolerant", near = 1.5, far = 2.0, shape = "shell"}
start = {draw = "row", n = 5, spacing = 1.25, t = 0.1}
graphs.loose = {kind = "tolerant", near = 2.5, far = 3.0}
"""

FAULTY = """
t_end = -3
terms = [{kind = "closing_sped"}, {kind = "closing_speed", gain = "x", gian = 1}]
graph = {kind = "tolerant", near = "x", shape = "bell"}
start = {draw = "row", n = 0, spacing = 1.25}
"""

FAULTS = """
terms[0].kind: is not known; got 'closing_sped'. Did you mean 'closing_speed'?
terms[1].gain: must be a number, or a list of one number per agent; got 'x'
terms[1].gian: is not known here. Did you mean 'gain'?
graph.near: must be a number; got 'x'
graph.far: must be given
graph.shape: must be 'ball' or 'shell'; got 'bell'. Did you mean 'ball'?
start.n: must be from 1 to 1000000000; got 0
t_end: must be at least 0.0, the time of the start; got -3.0
"""

PROGRAM = """
import json, sys
import numpy as np
import my_parts
import flocking as fk
from flocking.apps.lab.experiment.events import outcome
from flocking.apps.lab.experiment.experiment import Experiment
from flocking.apps.lab.experiment.settings import sections
from flocking.model.parts.structure import changed, of_agents
from flocking.model.serial import from_data, to_data
from flocking.study.scenario_files.scenario_file import (
    ScenarioFileError, parse_scenario, scenario_schema, scenario_to_text
)
from tests.study.scenario_files.schema_validator import fits
import tomllib

FILE, FAULTY, FAULTS, folder = json.loads(sys.argv[1])

found = parse_scenario(FILE)
assert type(found.law.graph) is my_parts.Tolerant and found.law.graph.shape == "shell", found.law
assert found.law.terms[1].over.near == 2.5 and found.start.t == 0.1

text = scenario_to_text(found)
again = parse_scenario(text)
data = json.loads(json.dumps(to_data(found)))
assert to_data(again) == to_data(found) == to_data(from_data(data))
assert data["law"]["graph"]["from"] == "my_parts"

schema = json.loads(json.dumps(scenario_schema()))
for good in (FILE, text):
    assert fits(tomllib.loads(good), schema)
for wrong in (FAULTY, FILE.replace("gain = 0.5", "gain = true"), FILE.replace("shell", "bell")):
    assert not fits(tomllib.loads(wrong), schema), wrong

try:
    parse_scenario(FAULTY)
    raise AssertionError("read")
except ScenarioFileError as error:
    assert sorted(error.problems) == sorted(FAULTS.strip().splitlines()), error

settings = {s.path: s for section in sections(found) for s in section.settings}
gain, shape = ("law", "terms", 0, "gain"), ("law", "graph", "shape")
assert (settings[gain].kind, settings[gain].value) == ("number", 0.5)
assert (settings[shape].kind, settings[shape].choices) == ("choice", ("ball", "shell"))
assert settings[("law", "terms", 1, "over", "near")].kind == "number"
assert changed(found, gain, 0.75).law.terms[0].gain == 0.75

uneven = changed(found, gain, np.arange(5.0))
assert of_agents(uneven.law, np.array([3, 1]), 5).terms[0].gain.tolist() == [3.0, 1.0]
assert parse_scenario(scenario_to_text(uneven)).law.terms[0].gain.tolist() == [0, 1, 2, 3, 4]

experiment = Experiment(found)
experiment.advance(0.15)
experiment.apply({"kind": "set", "path": list(gain), "value": 0.25})
experiment.apply({"kind": "kill", "agents": [4]})
assert experiment.scenario.law.terms[0].gain == 0.25 and experiment.state.n == 4

run = fk.simulate(found, progress=False)
fk.write_run(run, folder + "/run")
assert to_data(fk.read_run(folder + "/run").scenario) == to_data(found)
assert np.abs(run.residual).max() < 1e-9
moving = found.with_(start=fk.State(found.start.q, np.cos(np.arange(10.0)).reshape(5, 2), found.start.t))
lost = fk.simulate(moving, progress=False).trace
assert lost["dissipated"][-1] > 0.01 and np.abs(lost["supplied"]).max() < 1e-9, lost[-1]
tiled = fk.simulate(found, engine="tiles", progress=False)
assert np.abs(tiled.q[-1] - run.q[-1]).max() < 1e-4

for words, class_name, error in (("closing_speed", "Second", "word"), ("second", "Gradient", "name")):
    try:
        kind = type(class_name, (fk.Graph if words == "tolerant" else fk.PairTerm,), {"__annotations__": {}})
        fk.register_part(words)(__import__("dataclasses").dataclass(frozen=True)(kind))
        raise AssertionError(words)
    except fk.InvalidInput as refused:
        assert refused.parameter == error, refused
print("done", json.dumps(data))
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    found = tmp_path_factory.mktemp("outside")
    (code,) = re.findall(r"```python\n(.*?)```", PAGE.split("\n## ")[0], re.DOTALL)
    (found / "my_parts.py").write_text(code)
    return found


def run(folder: Path, program: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    paths = [str(folder), str(ROOT), str(ROOT / "src")]
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    return subprocess.run([sys.executable, "-c", program, *arguments], capture_output=True, text=True, env=env)


def test_the_file_of_the_page_makes_its_parts_known_everywhere(folder: Path) -> None:
    import json

    given = json.dumps([FILE, FAULTY, FAULTS, str(folder)])
    found = run(folder, PROGRAM, given)
    assert found.returncode == 0, found.stderr
    data = found.stdout.partition("done ")[2]
    told = run(
        folder,
        "import sys, json\nfrom flocking.model.serial import from_data\nfrom_data(json.loads(sys.argv[1]))",
        data,
    )
    assert "Import my_parts first" in told.stderr


WRONG = """
import flocking as fk
from dataclasses import dataclass

@fk.register_part("wrong")
@dataclass(frozen=True)
class Wrong(fk.PairTerm):
    thing: {annotation} = None
"""


@pytest.mark.parametrize(
    ("annotation", "said"),
    [("object", "Wrong.thing must have an annotation for its kind of value"), ("'Away'", "names that are defined")],
)
def test_a_field_that_says_nothing_is_refused_at_once(folder: Path, annotation: str, said: str) -> None:
    assert said in run(folder, WRONG.format(annotation=annotation)).stderr
