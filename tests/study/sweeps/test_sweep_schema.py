"""The JSON schema of sweep files: takes what the reader takes, and refuses what an editor can see to be wrong."""

import json
import tomllib

import pytest

from flocking.apps.cli import main
from flocking.papers.studies.shipped import STUDIES
from flocking.papers.sweep_scenarios import sweep_scenarios
from flocking.study.scenario_files.scenario_file import scenario_schema
from flocking.study.sweeps.editor_schema import sweep_schema
from flocking.study.sweeps.sweep_file import SweepFileError, parse_sweep
from flocking.study.sweeps.sweep_schema import SECTIONS
from tests.study.scenario_files.random_files import BASES
from tests.study.scenario_files.schema_validator import fits
from tests.study.sweeps.test_sweep_file import FAULTY, OF_A_PAPER, WRITTEN

SCHEMA = json.loads(json.dumps(sweep_schema(sweep_scenarios())))


def is_read(text):
    try:
        parse_sweep(text, sweep_scenarios())
    except SweepFileError:
        return False
    return True


def test_it_names_every_section_and_every_family_with_its_options():
    assert set(SCHEMA["properties"]) == set(SECTIONS)
    assert SCHEMA["required"] == ["scenario"]
    assert SCHEMA["properties"]["scenario"]["anyOf"][0]["enum"] == sorted(sweep_scenarios())
    message = {part["if"]["properties"]["scenario"]["const"]: part["then"]["properties"] for part in SCHEMA["allOf"]}
    assert {name: set(message[name]["options"]["properties"]) for name in message} == {
        name: set(family.options) for name, family in sweep_scenarios().items()
    }


def test_a_scenario_in_the_file_has_the_schema_of_scenario_files():
    inner = SCHEMA["properties"]["scenario"]["anyOf"][1]
    whole = scenario_schema()
    assert inner["properties"] == json.loads(json.dumps(whole["properties"]))
    assert all(SCHEMA["$defs"][name] == part for name, part in json.loads(json.dumps(whole["$defs"])).items())
    for base in BASES:
        assert fits({"scenario": base}, SCHEMA)


@pytest.mark.parametrize("text", [OF_A_PAPER, WRITTEN, *(study.text for study in STUDIES.values())])
def test_what_is_read_fits(text):
    assert is_read(text)
    assert fits(tomllib.loads(text), SCHEMA)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('"zhou-2015"', '"zhou-2016"'), ('scenario = "zhou-2015"', ""), ("seeds = 3", "seeds = 0"),
        ("seeds = 3", "seeds = 2.5"), ("seeds = 3", "seeds = []"), ("seed = 5", "seed = -1"),
        ('"connected", ', '"conected", '), ("audit = true", 'audit = "yes"'),
        ("audit = true", "audit = true\nformat = 2"), ("audit = true", 'audit = true\nname = "../../etc"'),
        ("audit = true", 'audit = true\nengine = "warp"'), ("audit = true", "audit = true\nmade = 1"),
        ("duration = 0.5", "lenght = 2"), ("duration = 0.5", "duration = -1"),
        ("side = [4.0, 6]", "side = []"), ("side = [4.0, 6]", "sied = [4.0]"), ("side = [4.0, 6]", "side = [true]"),
        ("side = [4.0, 6]", "side = 4.0"), ("count = 3", "count = 1"), ("count = 3", "count = 3, steps = 4"),
    ],
)  # fmt: skip
def test_what_an_editor_can_see_to_be_wrong_does_not_fit(old, new):
    assert old in OF_A_PAPER
    text = OF_A_PAPER.replace(old, new, 1)
    assert not is_read(text)
    assert not fits(tomllib.loads(text), SCHEMA)


@pytest.mark.parametrize(
    ("old", "new"),
    [("gain = 1.0", "gian = 1.0"), ('"sobol"', '"sobl"'), ("count = 4", ""), ("low = 2, ", "low = 2, step = 1, ")],
)
def test_nor_do_faults_in_a_scenario_or_a_sample(old, new):
    assert old in WRITTEN
    text = WRITTEN.replace(old, new, 1)
    assert not is_read(text)
    assert not fits(tomllib.loads(text), SCHEMA)
    assert not fits(tomllib.loads(FAULTY), SCHEMA)


def test_drawn_options_are_those_of_the_family():
    sample = '[sample]\nmethod = "latin"\ncount = 2\nranges = {side = {low = 4.0, high = 8.0}}\n'
    text = f'scenario = "zhou-2015"\n{sample}'
    assert is_read(text)
    assert fits(tomllib.loads(text), SCHEMA)
    other = text.replace("side", "radius")
    assert not is_read(other)
    assert not fits(tomllib.loads(other), SCHEMA)


def test_the_command_prints_it(capsys):
    assert main(["schema", "--sweep"]) == 0
    assert json.loads(capsys.readouterr().out) == SCHEMA
    assert SCHEMA["title"] == "flocking sweep"
