"""Arguments that contradict each other, or name what there is not, are refused in one sentence with exit code 2."""

import json

import numpy as np
import pytest

import flocking as fk
from flocking.apps.cli import main
from flocking.apps.lab.experiment.events import EventLog
from flocking.errors import InvalidInput
from flocking.model.serial import to_data

SAMPLES = "samples.csv"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with samples of a motion, and the folder of a run of three agents."""
    made = tmp_path_factory.mktemp("files")
    rows = [f"{0.1 * k},{i},{i + 0.1 * k}" for k in range(12) for i in range(2)]
    (made / SAMPLES).write_text("\n".join(["t,id,x", *rows, ""]))
    law = fk.Law(fk.Proximity(3.0), [fk.Consensus(1.0)])
    start = fk.State([[0.0], [1.0], [2.5]], [[1.0], [0.0], [0.0]])
    fk.write_run(fk.simulate(fk.Scenario(law, start, 0.5, frames=3), progress=False), made / "run")
    return made


@pytest.fixture
def place(folder, monkeypatch):
    monkeypatch.chdir(folder)
    return folder


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("check k*r -p k", "-p must be name=number, such as -p R=4; got 'k'"),
        ("check k*r -p k=x", "-p must be name=number"), ("check k*r -p k=nan", "-p must be name=number"),
        ("check r -p formula=1", "-p must be name=number"), ("check k*r -p k=1 -p k=2", "-p must give k once"),
        ("reproduce zhou-2015 --all", "--all must stand alone; got 'zhou-2015'"),
        ("plot", "source must be given"), ("plot run --seed 1", "seed can be given for a scenario only"),
        ("sweep nothing-like-it", "must be a TOML file or a shipped study"),
        ("margins", "scenario must be given"), ("margins --papers --seeds 3", "--seeds must be absent with --papers"),
        ("margins zhou-2015 --levels loss", "levels must be name=value,value, once for each quantity"),
        ("margins zhou-2015 --levels loss=0,x", "levels must be name=value,value"),
        ("audit run --radius 2", "--radius must be absent for a saved run"),
        ("audit run --time-step 2", "--time-step must be absent for a saved run"),
        ("audit run --column t=time", "--column must be absent for a saved run"),
        ("audit run --law zhou-2015", "--law must be absent for a saved run"),
        (f"audit {SAMPLES} --replay", "--replay must be absent for samples"),
        (f"audit {SAMPLES} --time-step 2", "time_step must be absent but for GSD files"),
        (f"audit {SAMPLES} -c t", "--column must be t=NAME"),
        (f"audit {SAMPLES} -c t=t -c t=t", "--column must be t=NAME, id=NAME, x=NAME, ..., once for each"),
        ("audit nowhere", "There is neither folder nor file"),
        ("export run --to csv --step 0.1", "--step must be absent for a saved run"),
        ("export run --to csv --seed 1", "--seed must be absent for a saved run"),
        ("lab --folder nowhere", "folder must be an existing folder"),
    ],
)  # fmt: skip
def test_they_are_refused(words, said, place, capsys):
    before = sorted(place.rglob("*"))
    assert main(words.split()) == 2
    error = " ".join(capsys.readouterr().err.split())
    assert said in error
    assert sorted(place.rglob("*")) == before


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda data: data | {"format": data["format"] + 1}, "format must be"),
        (lambda data: data | {"scenario": to_data(fk.Proximity(1.0))}, "scenario must be a scenario; got 'Proximity'"),
        (lambda data: {k: v for k, v in data.items() if k != "events"}, "must be an event log \\('events'\\)"),
        (lambda data: [data], "must be an event log"), (lambda data: data | {"events": 3}, "must be an event log"),
    ],
)  # fmt: skip
def test_files_that_are_no_logs_of_events_are_refused(change, said, tmp_path):
    law = fk.Law(fk.Proximity(3.0), [fk.Consensus(1.0)])
    scenario = fk.Scenario(law, fk.State(np.arange(4.0).reshape(2, 2), np.zeros((2, 2))), 1.0)
    path = EventLog(scenario, "exact", [], 0.5).write(tmp_path / "x.events.json")
    assert EventLog.read(path).end == 0.5
    path.write_text(json.dumps(change(json.loads(path.read_text()))))
    with pytest.raises(InvalidInput, match=said):
        EventLog.read(path)
    for other in (tmp_path, tmp_path / "nowhere.json"):
        with pytest.raises(InvalidInput, match="log must be an event log"):
            EventLog.read(other)


def test_a_comparison_has_its_exit_codes(place, tmp_path, capsys):
    """0 where runs are equal, 1 where they differ."""
    run = fk.read_run(place / "run")
    fk.write_run(fk.simulate(run.scenario.with_(t_end=0.4), progress=False), tmp_path / "other")
    assert main(["diff", "run", "run"]) == 0
    assert main(["diff", "run", str(tmp_path / "other")]) == 1
    capsys.readouterr()
