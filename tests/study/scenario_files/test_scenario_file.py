"""Scenario files: every fault at once, exact round trips, and files that mean harm."""

import json
import tomllib

import numpy as np
import pytest
import tomli_w
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import flocking as fk
from flocking.model.graphs.smooth_graphs import PerAgentRadii, Smooth
from flocking.model.leaders_and_obstacles.obstacles import Ball, Wall
from flocking.model.leaders_and_obstacles.polygons import ConvexPolygon
from flocking.model.parts.description import GROUPS
from flocking.model.serial import to_data
from flocking.model.terms.avoidance import Avoid
from flocking.study.scenario_files.scenario_file import (
    ScenarioFileError,
    parse_scenario,
    scenario_schema,
    scenario_to_text,
)
from flocking.study.scenario_files.scenario_reader import flat_fields

PSI = fk.Potential("1/r + 1/(R - r)", R=4.0)
LEADER = fk.Path(["cos(w*t)", "sin(t)"], start=[0.1, 1 / 3], start_time=0.5, w=0.7)
GRAPH = fk.Hysteresis(4.0, 0.1)
START = fk.start.box(5, side=3.0, speed=1.0, seed=3, connected_under=GRAPH)
OTHER = fk.Proximity(2.5, closed=True)


ALIGN = (fk.Consensus(1.0),)


def scenario(graph=GRAPH, terms=ALIGN, **rest):
    return fk.Scenario(fk.Law(graph, terms), **{"start": START, "t_end": 0.3, "frames": 4, **rest})


SCENARIOS = {
    "hysteresis": scenario(terms=(fk.Gradient(PSI), fk.Consensus(0.1 + 0.2))),
    "fixed": scenario(fk.Fixed(5, ((0, 1), (3, 2), (4, 0)), directed=True)),
    "no edges": scenario(fk.Fixed(5, ())),
    "proximity": scenario(OTHER, (fk.Gradient(fk.Potential("log(r)^2"), weighting="force"),)),
    "smooth": scenario(Smooth(5.0, 0.8, bump="quintic"), (fk.Consensus(1.0, weighted=True),)),
    "radii": scenario(PerAgentRadii(np.array([1.0, 2.0, 3.0, 4.0, 1 / 7]))),
    "own bump": scenario(Smooth(5.0, 0.8, bump=fk.Bump("line", "where(z < k0, 1, (1 - z)/(1 - k0))"))),
    "periodic": scenario(space=fk.Periodic([99.0, None])),
    "messages": scenario(
        control=fk.Held([0.1, 0.2, 0.1, 0.2, 0.1], latency=0.01),
        information=fk.Messages(
            0.05,
            delay=0.02,
            loss=fk.GilbertElliott(0.1, 0.4),
            noise=fk.OrnsteinUhlenbeck(0.1, 0.1),
            expires=0.5,
            seed=3,
        ),
    ),
    "lost messages": scenario(
        control=fk.Held(0.1), information=fk.Messages(0.05, loss=0.2, noise=fk.WhiteNoise(0.1), predict=True)
    ),
    "far messages": scenario(control=fk.Held(0.1), information=fk.Messages(0.05, loss=fk.DistanceLoss(3.0))),
    "cone": scenario(fk.Cone(3.0, np.arange(1.0, 6.0), "wrapped"), agents=fk.Agents(headings=np.arange(5) * 0.1)),
    "smooth cone": scenario(fk.SmoothCone(3.0, 0.5, 1 / 3), agents=fk.Agents(headings=np.arange(5) * 0.1)),
    "view": scenario(fk.FieldOfView(3.0, 1.0), agents=fk.Agents(headings=np.arange(5) * 0.1)),
    "schedule": scenario(
        terms=(
            fk.Track(
                fk.Sink([0.0, 1.0]),
                fk.Schedule([0.1, 0.2], [1.0, 0.0, 1 / 3]),
                fk.Schedule([0.1], [np.ones(5), np.arange(5) / 7]),
            ),
        )
    ),
    "matrix": scenario(terms=(fk.Consensus(np.arange(5) / 3, weights=np.arange(25.0).reshape(5, 5) / 7),)),
    "hashed": scenario(terms=(fk.Consensus(2.0, weights=fk.HashedWeights(0.1, 0.9, 2**62)),)),
    "two graphs": scenario(terms=(fk.Gradient(PSI), fk.Consensus(1.0, over=OTHER), fk.Consensus(0.5, over=OTHER))),
    "functional": scenario(terms=(fk.Consensus(1.0, functional=True, over=fk.Fixed(5, ((0, 1),))),)),
    "own graph again": scenario(terms=(fk.Consensus(1.0, over=GRAPH),)),
    "sink": scenario(terms=(fk.Track(fk.Sink([1.0, -0.0]), 1 / 3, saturated=True, shared=True),)),
    "velocity": scenario(terms=(fk.Track(fk.Velocity([1.0, 2.0], [0.5, 0.25], 0.125), velocity_gain=np.ones(5) / 3),)),
    "shared leader": scenario(
        terms=(fk.Track(LEADER, 0.3, 0.7, 1.0, per_mass=True), fk.Track(LEADER)), energy=fk.Energy("leader", LEADER)
    ),
    "equal leaders, not shared": scenario(terms=(fk.Track(fk.Sink([1.0, 2.0])), fk.Track(fk.Sink([1.0, 2.0])))),
    "agents": scenario(
        terms=(fk.Consensus(1.0), fk.Compensate()),
        agents=fk.Agents(masses=np.linspace(0.05, 1, 5), damping=np.arange(5) / 9),
    ),
    "headings": scenario(agents=fk.Agents(headings=np.arange(5) * 0.1)),
    "rotations": scenario(agents=fk.Agents(headings=np.stack([np.eye(2)] * 5))),
    "first order": scenario(agents=fk.Agents(order=1)),
    "point masses": scenario(agents=fk.PointMass(np.linspace(0.5, 1, 5), 0.1)),
    "chain of bodies": scenario(
        agents=fk.Limited(
            fk.Lagged(fk.Disturbed(fk.PointMass(), 0.1, 0.05, seed=3), np.linspace(0.1, 0.2, 5)), force=2.0, rate=1 / 3
        )
    ),
    "unicycles": scenario(agents=fk.Unicycle(0.1)),
    "single integrators": scenario(agents=fk.SingleIntegrator(headings=np.arange(5) * 0.1)),
    "energy": scenario(energy=fk.Energy("centre of mass", unlinked=0.1, name='J "tilde" \\')),
    "frames": scenario(frames=(0.0, 0.1, 0.30000000000000004 - 1e-16), tolerance=1e-7, seed=2**40, name="naïve é"),
    "links": scenario(start=fk.State(START.q, START.p, 0.1, np.eye(5, k=1, dtype=bool))),
    "no links": scenario(start=fk.State(START.q, links=np.zeros((5, 5), bool))),
    "obstacles": scenario(
        terms=(
            Avoid(
                (
                    Ball([5.0, 1.0], 2.0),
                    Ball(LEADER, 1.0),
                    Wall([0.0, -9.0], [0.0, 2.0]),
                    ConvexPolygon([[9.0, 9.0], [10.0, 9.0], [9.0, 10.0]], 0.5, fk.Velocity([0.1, 0.2])),
                ),
                LEADER,
                range=4.2,
            ),
        )
    ),
    "space": fk.Scenario(
        fk.Law(OTHER, fk.Consensus(1.0)), fk.start.box(4, side=[1.0, 2.0, 3.0], seed=1, speed=1.0), t_end=0.2, frames=3
    ),
}


@pytest.mark.parametrize("name", SCENARIOS)
def test_round_trip_keeps_every_bit_and_every_shared_part(name):
    before = SCENARIOS[name]
    text = scenario_to_text(before)
    after = parse_scenario(text)
    assert to_data(after) == to_data(before)
    assert np.array_equal(after.start.q.view(np.int64), before.start.q.view(np.int64))
    assert scenario_to_text(after) == text


def test_the_scenarios_above_use_every_word_of_every_group():
    words = {
        (group, kind.word)
        for group, found in GROUPS.items()
        for kind in found.kinds
        if group not in ("start", "place") and kind.word != "random_connected"
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


DRAWN = """
t_end = 1
terms = [{kind = "consensus"}]
[graph]
kind = "hysteresis"
radius = 4
gap = 0.1
[start]
draw = "box"
n = 6
side = 4
speed = 2
seed = 5
connected = true
"""


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


FAULTY = """
nam = "x"
t_end = "soon"
tolerance = inf
frames = 0
[graph]
kind = "hysteresys"
[[terms]]
kind = "gradient"
formula = "1/r + 1/(R - r)"
parameters = {R = "x"}
[[terms]]
kind = "consensus"
gain = "x"
wieghts = 3
weights = [[1, 2], [3]]
[[terms]]
gain = 3
[[terms]]
kind = "track"
leader = "gide"
[[terms]]
kind = "track"
leader = {kind = "path", velocity = ["sin(t)", "open('x')"]}
[[terms]]
kind = "consensus"
gain = [1, 2, 3]
[[terms]]
kind = "track"
leader = {kind = "sink", point = [1, 2, 3]}
[[terms]]
kind = "avoid"
range = 1
gamma_agents = false
obstacles = [{kind = "ball", centre = [0, 0], radius = 1}, {kind = "ball", centre = [0, 0], radius = -1}]
[leaders.guide]
kind = "velocity"
value = [true, 1]
[start]
draw = "box"
n = 2
side = 1
seed = 1
connected = true
[agents]
masses = [1, 2, -3]
order = 3
"""

FAULTS = """
nam: is not known here. Did you mean 'name'?
t_end: must be a number; got 'soon'
tolerance: must be finite; got inf
frames: must be from 1 to 1000000; got 0
graph.kind: is not known; got 'hysteresys'. Did you mean 'hysteresis'?
terms[0].parameters.R: must be a number; got 'x'
terms[1].gain: must be a number, or a list of one number per agent; got 'x'
terms[1].wieghts: is not known here. Did you mean 'weights'?
terms[1].weights[1]: must have 2 numbers, as the first row has; got [3]
terms[2].kind: must be given
terms[3].leader: must be the name of a section of [leaders]; got 'gide'. Did you mean 'guide'?
terms[4].leader.velocity[1]: calls 'open', which is not known; got "open('x')". Known:
terms[5].gain: must have one value for each of the 2 agents; got 3 values
terms[6].leader: must have 2 components, as the agents have; got 3
terms[7].obstacles[1].radius: must be greater than 0; got -1.0
leaders.guide.value[0]: must be a number; got True
agents.order: must be from 1 to 2; got 3
agents.masses: must be greater than 0 for every agent; got '-3 for agent 2'
"""


def test_every_fault_is_named_at_once_with_its_place():
    with pytest.raises(ScenarioFileError) as caught:
        parse_scenario(FAULTY, source="faulty.toml")
    found = [line.strip() for line in str(caught.value).splitlines()]
    expected = FAULTS.strip().splitlines()
    assert found[0] == f"faulty.toml: {len(expected)} faults in the scenario"
    for line in expected:
        assert any(text.startswith(line) for text in found[1:]), line
    assert len(found) == 1 + len(expected)


@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        ("gap = 0.1", "gap = 5", "graph.gap: must be smaller than the radius"),
        ("t_end = 1", "t_end = -1", "t_end: must be at least 0.0"),
        ("t_end = 1", "t_end = 1\nframes = [0.5, 0.2]", "frames: must be ascending times"),
        ("n = 6", "n = 1000001", "start.n: must be at most 1000000 agents"),
        ("n = 6", "n = 6000", "start.n: must be at most 5000 agents here"),
        ("n = 6", "n = 1" + "0" * 400, "start.n: must be from 1 to"),
        ("t_end = 1", "t_end = 1" + "0" * 400, "t_end: must be a number below 1e308"),
        ("t_end = 1", "t_end = 1" + "0" * 5000, "file: is not TOML"),
        ("side = 4", "side = [4, 4]\ncorner = [0]", "start.corner: must have 2 coordinates"),
        ("side = 4", "dimension = 101\nside = 4", "start.dimension: must be from 1 to 100"),
        ("speed = 2", "speed = nan", "start.speed: must be finite"),
        ("seed = 5", "seed = -5", "start.seed: must be from 0 to"),
        ('"box"', '"boxx"', "start.draw: is not known; got 'boxx'. Did you mean 'box'?"),
        ('"box"', "3", "start.draw: must be text in quotes; got 3"),
        ('{kind = "consensus"}', "3", "terms[0]: must be a table; got 3"),
        ('[{kind = "consensus"}]', '"consensus"', "terms: must be a list of 1 to 100 tables"),
        ('[{kind = "consensus"}]', "[]", "terms: must be a list of 1 to 100 tables"),
        ("t_end = 1", "format = 2\nt_end = 1", "format: must be 1"),
        ('"consensus"', '"gradient", formula = "1/0"', "terms[0]"),
        (
            '"consensus"',
            '"gradient", formula = "((((9*r)^64)^64)^64)^64"',
            "terms[0].formula: must have powers of powers",
        ),
        ('"consensus"', '"gradient", formula = "r*exp(64*log(9))^64"', "terms[0].formula: must have powers of powers"),
        ('"consensus"', '"gradient", formula = "1/(R - r)"', "terms[0].formula: uses 'R', which has no value"),
        ('"consensus"', '"gradient", formula = "r*R", parameters = {self = 1}', "terms[0].parameters.self"),
        ('"consensus"', '"consensus", weights = {low = 2, high = 1, seed = 1}', "terms[0].weights.high"),
        ('"consensus"', '"consensus", over = {kind = "fixed", n = 3, edges = [[0, 1]]}', "terms[0].over.n"),
        ('"consensus"', '"consensus", over = {kind = "fixed", n = 6, edges = [[0, 6]]}', "terms[0].over.edges"),
        ('"consensus"', '"consensus", over = {kind = "fixed", n = 6, edges = [[0]]}', "terms[0].over.edges[0]"),
    ],
)
def test_a_fault_is_told_at_its_place(old, new, place):
    assert old in DRAWN
    with pytest.raises(ScenarioFileError) as caught:
        parse_scenario(DRAWN.replace(old, new))
    assert place in str(caught.value)
    assert len(str(caught.value)) < 600


def faults_of(text):
    with pytest.raises(ScenarioFileError) as caught:
        parse_scenario(text)
    return {problem.partition(":")[0] for problem in caught.value.problems}


@pytest.mark.parametrize(
    ("changes", "places"),
    [
        ({"t_end = 1": "t_end = -3", '"hysteresis"': '"hysteresys"'}, {"t_end", "graph.kind"}),
        ({"t_end = 1": "t_end = -3", "side = 4": "side = -4", "speed = 2": "speed = -2"},
         {"t_end", "start.side", "start.speed"}),
        ({"t_end = 1": "t_end = -3\ntolerance = 2\nframes = [3, 1]", '"box"': '"bx"'},
         {"t_end", "tolerance", "frames", "start.draw"}),
        ({"radius = 4": "radius = -4", "gap = 0.1": "gap = -1"}, {"graph.radius", "graph.gap"}),
        ({"radius = 4": 'radius = "x"', "gap = 0.1": "gap = -1"}, {"graph.radius", "graph.gap"}),
        ({"radius = 4": "radius = -4", "gap = 0.1": "gap = 2"}, {"graph.radius"}),
        ({"gap = 0.1": ""}, {"graph.gap"}),
        ({"gap = 0.1": "gap = 0.1\ngup = 1", "radius = 4": "radius = -4"}, {"graph.gup", "graph.radius"}),
    ],
)  # fmt: skip
def test_all_faults_of_a_file_are_listed_at_once_and_no_others(changes, places):
    text = DRAWN
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    assert faults_of(text) == places


def test_limits_have_an_explicit_way_out(tmp_path):
    with pytest.raises(ScenarioFileError, match="most_agents=6"):
        parse_scenario(DRAWN, most_agents=5)
    file = tmp_path / "s.toml"
    file.write_text(DRAWN)
    with pytest.raises(fk.InvalidInput, match="at most 100 bytes"):
        fk.read_scenario(file, largest_file=100)


@pytest.mark.parametrize("text", ["x = " + "[" * 100_000, "x = " + "{a = " * 5000, ".".join("a" * 5000) + " = 1"])
def test_deep_nesting_is_refused_at_once(text):
    with pytest.raises(ScenarioFileError, match="must not nest deeper"):
        parse_scenario(text)


def test_a_file_that_cannot_be_read_is_told_in_one_line(tmp_path):
    (tmp_path / "latin.toml").write_bytes(b'name = "\xe9"')
    for path in (tmp_path, tmp_path / "absent.toml", tmp_path / "latin.toml", "a\0b"):
        with pytest.raises(fk.InvalidInput):
            fk.read_scenario(path)


def test_parts_of_ones_own_are_refused_when_written():
    class Own(fk.PairTerm):
        parameters = property(lambda self: {})
        structure = ("own",)

    with pytest.raises(fk.InvalidInput, match="with a name in files"):
        scenario_to_text(scenario(terms=(Own(),)))
    with pytest.raises(fk.InvalidInput, match="one line"):
        scenario_to_text(scenario(name="two\nlines"))


def test_the_schema_for_editors_is_complete_json():
    schema = json.loads(json.dumps(scenario_schema()))
    assert set(schema["required"]) == {"t_end", "graph", "terms", "start"}
    text = json.dumps(schema)
    for group in GROUPS.values():
        for kind in group.kinds:
            assert f'"const": "{kind.word}"' in text or group.key is None
            assert all(f'"{name}"' in text for name in flat_fields(kind))


VALUES = st.recursive(
    st.none().map(lambda _: "soon")
    | st.booleans()
    | st.integers(-(10**30), 10**30)
    | st.floats(allow_nan=True, allow_infinity=True)
    | st.text(max_size=12)
    | st.sampled_from(["gradient", "fixed", "1/r", "r**r**r", "__import__('os')", "leader_1", "x" * 3000, "lab"]),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=6,
)
BASED = ("hysteresis", "shared leader", "matrix", "obstacles", "messages", "lost messages", "far messages", "periodic")
BASES = [tomllib.loads(scenario_to_text(SCENARIOS[n])) for n in BASED]


def places(table, path=()):
    yield path
    children = table.items() if isinstance(table, dict) else enumerate(table) if isinstance(table, list) else ()
    for key, child in children:
        yield from places(child, (*path, key))


@settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_mutated_files_are_read_or_refused_in_plain_words(data):

    table = json.loads(json.dumps(data.draw(st.sampled_from(BASES))))
    for _ in range(data.draw(st.integers(1, 3))):
        *path, last = data.draw(st.sampled_from([p for p in places(table) if p]))
        owner = table
        for key in path:
            owner = owner[key]
        action = data.draw(st.sampled_from(["replace", "remove", "add"]))
        if action == "remove":
            del owner[last]
        elif action == "add" and isinstance(owner, dict):
            owner[data.draw(st.text(min_size=1, max_size=8))] = data.draw(VALUES)
        else:
            owner[last] = data.draw(VALUES)
    text = tomli_w.dumps(table)
    assert tomllib.loads(text) is not None
    message = refusal(text)
    assert message is None or ("\n  " in message and "Traceback" not in message)


def refusal(text):
    """The message of a file that is refused; anything but a refusal goes through."""
    try:
        assert isinstance(parse_scenario(text), fk.Scenario)
    except ScenarioFileError as error:
        return str(error)
    return None


@settings(max_examples=100, deadline=None)
@given(text=st.text(max_size=200) | st.binary(max_size=200).map(lambda b: b.decode("latin-1")))
def test_any_text_is_read_or_refused(text):
    with pytest.raises(ScenarioFileError):
        parse_scenario(text)
