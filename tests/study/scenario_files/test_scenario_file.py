"""Scenario files: exact round trips, starts drawn in the file, and the schema for editors."""

import json

import numpy as np
import pytest

import flocking as fk
from flocking.model.parts.description import GROUPS
from flocking.model.serial import to_data
from flocking.study.scenario_files.scenario_file import (
    parse_scenario,
    scenario_schema,
    scenario_to_text,
)
from flocking.study.scenario_files.scenario_reader import flat_fields
from tests.study.scenario_files.scenarios import DRAWN, SCENARIOS


@pytest.mark.parametrize("name", SCENARIOS)
def test_round_trip_keeps_every_bit_and_every_shared_part(name):
    before = SCENARIOS[name]
    text = scenario_to_text(before)
    after = parse_scenario(text)
    assert to_data(after) == to_data(before)
    assert np.array_equal(after.start.q.view(np.int64), before.start.q.view(np.int64))
    assert scenario_to_text(after) == text


def test_the_scenarios_use_every_word_of_every_group():
    words = {
        (group, kind.word)
        for group, found in GROUPS.items()
        for kind in found.kinds
        if group not in ("start", "place") and kind.word != "random_connected"
        # Pages and other tests register parts of their own.
        if kind.builds.__module__.startswith("flocking.")
    }
    words -= {("space", "open"), ("control", "continuous"), ("information", "instant")}  # files do not name these
    texts = [scenario_to_text(s) for s in SCENARIOS.values()]
    missing = {(g, w) for g, w in words if GROUPS[g].key and not any(f'kind = "{w}"' in text for text in texts)}
    assert not missing


@pytest.mark.parametrize("name", ["hysteresis", "velocity"])
def test_a_scenario_read_back_runs_the_same_bit_for_bit(name, tmp_path):
    before = SCENARIOS[name]
    after = fk.read_scenario(fk.write_scenario(before, tmp_path / "s.toml"))
    one, two = (fk.simulate(s, progress=False) for s in (before, after))
    assert np.array_equal(one.q.view(np.int64), two.q.view(np.int64))
    assert np.array_equal(one.p.view(np.int64), two.p.view(np.int64))
    assert one.switches.tobytes() == two.switches.tobytes()


def test_a_start_may_be_a_draw():
    expected = fk.start.box(6, side=4, speed=2, seed=5, connected_under=fk.Hysteresis(4, 0.1))
    assert np.array_equal(parse_scenario(DRAWN).start.q, expected.q)
    alone = parse_scenario(DRAWN.replace("side = 4", "side = 20").replace("connected = true", ""))
    assert np.array_equal(alone.start.q, fk.start.box(6, side=20, speed=2, seed=5).q)


@pytest.mark.parametrize(
    ("table", "state"),
    [
        ({"draw": "ball", "n": 4, "radius": 2, "speed": 1, "dimension": 3, "seed": 1}, "ball"),
        ({"draw": "hexagonal", "n": 4, "spacing": 2, "noise": 0.1, "seed": 1}, "hexagonal"),
    ],
)
def test_every_draw_gives_the_state_of_its_function(table, state):
    text = 't_end = 2\nterms = [{kind = "consensus"}]\ngraph = {kind = "proximity", radius = 1}\n[start]\nt = 1.5\n'
    found = parse_scenario(text + "\n".join(f"{k} = {json.dumps(v)}" for k, v in table.items())).start
    arguments = {k: v for k, v in table.items() if k != "draw"}
    assert np.array_equal(found.q, getattr(fk.start, state)(**arguments).q)
    assert found.t == 1.5


def test_a_random_graph_may_be_drawn_in_the_file():
    graph = '[graph]\nkind = "random_connected"\nn = 6\nprobability = 0.4\nseed = 2\n[start]'
    text = DRAWN.replace(DRAWN[DRAWN.index("[graph]") : DRAWN.index("[start]") + 7], graph).replace(
        "connected = true", ""
    )
    assert parse_scenario(text).law.graph == fk.Fixed.random_connected(6, 0.4, 2)
    assert parse_scenario(text, seed=3).law.graph == fk.Fixed.random_connected(6, 0.4, 3)


def test_a_seed_takes_the_place_of_the_seed_in_the_file():
    other = parse_scenario(DRAWN, seed=8)
    assert np.array_equal(other.start.q, parse_scenario(DRAWN.replace("seed = 5", "seed = 8")).start.q)
    assert other.seed == 8
    with pytest.raises(fk.InvalidInput, match="random draw"):
        parse_scenario(scenario_to_text(SCENARIOS["hysteresis"]), seed=1)


def test_the_schema_for_editors_is_complete_json():
    schema = json.loads(json.dumps(scenario_schema()))
    assert set(schema["required"]) == {"t_end", "graph", "terms", "start"}
    text = json.dumps(schema)
    for group in GROUPS.values():
        for kind in group.kinds:
            assert f'"const": "{kind.word}"' in text or group.key is None
            assert all(f'"{name}"' in text for name in flat_fields(kind))
