"""Faults of scenario files: all of them at once, each at its place, and files that mean harm."""

import time

import pytest

import flocking as fk
from flocking.study.scenario_files.scenario_file import (
    ScenarioFileError,
    parse_scenario,
    scenario_to_text,
)
from tests.study.scenario_files.scenarios import DRAWN, scenario

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
        ('"consensus"', '"gradient", formula = "r*R", parameters = {"R-1" = 1}', "terms[0].parameters.R-1"),
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


@pytest.mark.parametrize(
    ("section", "place"),
    [
        ('[leaders.main]\nkind = "sink"\npoint = [9, 9]', "leaders.main"),
        ('[graphs.wide]\nkind = "proximity"\nradius = 9', "graphs.wide"),
    ],
)
def test_a_named_part_that_nothing_names_is_a_fault(section, place):
    """The run would be one without it."""
    with pytest.raises(ScenarioFileError, match=f"{place}: is named by no part") as caught:
        parse_scenario(f"{DRAWN}\n{section}")
    assert len(caught.value.problems) == 1


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


@pytest.mark.parametrize(
    "before",
    [
        "",
        "x = { ",
        '"#".',
        '"=".',
        "'='.",
        '"[".',
        'x = { "#" = 1, ',
        'x = { y = """a"""", ',
        "x = { y = '''a'''', ",
        "[",
        "[['#'.",
    ],
)
def test_keys_of_many_parts_are_refused_at_once(before):
    """The parser takes the square of the number of parts: 200,000 take minutes."""
    begin = time.process_time()
    with pytest.raises(ScenarioFileError, match="must not nest deeper"):
        parse_scenario(before + "a." * 200_000 + "b = 1\n")
    assert time.process_time() - begin < 5.0


@pytest.mark.parametrize("text", ["x = '#', [", 'x = ["#", ', 'x = """a"""", ', "x = '''a''''', "])
def test_texts_hide_no_brackets(text):
    with pytest.raises(ScenarioFileError, match="must not nest deeper"):
        parse_scenario(text + "[" * 1000)


@pytest.mark.parametrize(
    "text",
    [
        "# [[[[[[[[[[[[[[[[[[[[[[[[[[[[[ a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a",
        "y = '[[[[[[[[[[[[[[[[[[[[[[[[[[[[[ a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a'",
        'y = """\n[[[[[[[[[[[[[[[[[[[[[[[[[[\na.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a\\""" """'.replace(
            ' """', '"""'
        ),
        f"y = [{', '.join(['1.5'] * 100)}]",
    ],
)
def test_texts_comments_and_lists_of_numbers_are_not_nested(text):
    with pytest.raises(ScenarioFileError) as error:
        parse_scenario(text)
    assert "nest" not in str(error.value)


@pytest.mark.parametrize("number", ["0x" + "f" * 5000, "0b" + "1_0" * 20_000, "0o" + "7" * 100_000])
def test_integers_that_python_cannot_print_are_refused(number):
    for text in (f"seed = {number}\n{DRAWN}", f"x = [1, {number}]"):
        with pytest.raises(ScenarioFileError, match="integer of more than 100 digits"):
            parse_scenario(text)


@pytest.mark.parametrize("number", ["1e-400", "-0.000_1e-330", "0.1E-5000"])
def test_numbers_that_floating_point_would_take_for_zero_are_refused(number):
    with pytest.raises(ScenarioFileError, match="too small for a floating-point number: write 0"):
        parse_scenario(f"t_end = {number}\n{DRAWN}")


@pytest.mark.parametrize("number", ["0.0", "0e5", "-0.0", "0.000e-9999", "1e-320"])
def test_zero_and_the_smallest_numbers_are_read(number):
    with pytest.raises(ScenarioFileError) as error:
        parse_scenario(f"x = {number}\n{DRAWN}")
    assert "too small" not in str(error.value)


def test_a_key_of_a_file_is_one_line_of_bounded_length():
    with pytest.raises(ScenarioFileError) as error:
        parse_scenario('"a\\nflocking: all is fine\\u202e\\u001b[2J" = 1\n' + "k" * 1_000_000 + " = 1\n")
    message = str(error.value)
    assert len(message.splitlines()) == 1 + len(error.value.problems)
    assert all(line.isprintable() for line in message.splitlines())
    assert len(message) < 3000


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
