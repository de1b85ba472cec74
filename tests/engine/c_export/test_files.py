"""The exported files, what is refused by name, and the command."""

import re
import subprocess

import numpy as np
import pytest

import flocking as fk
from flocking.apps.cli import main
from flocking.engine.c_export.export import c_files
from flocking.errors import InvalidInput, StorageError, UnsupportedLaw
from flocking.model.graphs.views import FieldOfView
from tests.engine.c_export.building import COMPILER, FLAGS, needs_compiler

LAW = fk.Law(fk.Hysteresis(4.0, 0.5), [fk.Gradient(fk.Potential("1/r + 1/(R - r)", R=4.0)), fk.Consensus(0.7)])
START = fk.State([[0.0, 0.0], [2.0, 0.0], [0.0, 2.0]], np.zeros((3, 2)))


def scenario(law=LAW, **parts):
    return fk.Scenario(law, START, 1.0, **parts)


def law_of(*terms, graph=None):
    return fk.Law(graph or fk.Proximity(2.0), list(terms))


class Drifting(fk.Impulsive):
    """A body in discrete time of somebody else."""


def looking():
    return fk.Agents(headings=np.zeros(3))


class Ahead(fk.Graph):
    """A graph of somebody else: all whose first coordinate is larger, nearer than one."""

    appear_radius = break_radius = 1.0

    def initial(self, q):
        return (q[None, :, 0] > q[:, None, 0]) & (np.linalg.norm(q[None] - q[:, None], axis=2) < 1.0)


class Watching(Ahead):
    """A graph of somebody else that has radii, and reads headings beside them."""

    follows_radii, sees_headings = True, True


class Wider(FieldOfView):
    """A field of view of somebody else, who may see others."""


SINE = fk.Path(["sin(t**2)", "0"])


def two_cameras():
    ahead, aside = (FieldOfView(2.0, 1.0, f"axis_{k}") for k in (1, 3))
    start = fk.State(np.arange(6.0).reshape(2, 3), np.zeros((2, 3)))
    law = law_of(fk.Consensus(), fk.Gradient(fk.Potential("r"), over=aside), graph=ahead)
    return fk.Scenario(law, start, 1.0, bodies=fk.Quadrotor())


def heard(law, **parts):
    return scenario(law, information=fk.Messages(0.1, **parts), control=fk.Held(0.1))


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (lambda: scenario(law_of(fk.Track(fk.Sink([0, 0]), 1.0, 1.0, shared=True))), "cannot compute the"),
        (lambda: scenario(law_of(fk.Gradient(fk.Potential("tanh(r)")))), "cannot write math.tanh"),
        (two_cameras, "takes one direction of the body; this law looks along axis_1 and axis_3"),
        (lambda: scenario(law_of(fk.Consensus(), graph=Wider(2.0, 1.0)), agents=looking()), "Wider has another rule"),
        (lambda: scenario(law_of(fk.Consensus()), agents=Drifting(), control=fk.Held(0.1)), "no rule by which"),
        (lambda: scenario(law_of(fk.Consensus(), graph=Ahead())), "by two distances; Ahead has"),
        (lambda: scenario(law_of(fk.Consensus(), graph=Watching()), agents=looking()), "Watching has another"),
        (lambda: scenario(law_of(fk.Consensus(functional=True))), "cannot compute the graph functional"),
        (lambda: scenario(law_of(fk.Track(SINE, 1.0, 1.0))), "whose position has a closed form in time"),
        (lambda: heard(law_of(fk.Track(fk.Sink([0, 0]), 1.0, 1.0)), leader=True), "does not receive their messages"),
    ],
)  # fmt: skip
def test_what_is_not_exported_is_refused_by_name(given, said):
    with pytest.raises(UnsupportedLaw, match=said):
        c_files(given())


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"name": "Law"}, "name must be of lower-case"), ({"name": "main"}, "name must be"),
        ({"neighbours": 0}, "neighbours must be at least 1"), ({"neighbours": 256}, "neighbours must be at most 255"),
        ({"limit": 0.0}, "limit must be"), ({"float32": "yes"}, "float32 must be"),
    ],
)  # fmt: skip
def test_values_out_of_range_are_refused(options, said):
    with pytest.raises(InvalidInput, match=f"export_c: {said}"):
        c_files(scenario(), **options)


def test_what_no_flight_computer_has_room_for_is_refused():
    """Identifiers have sixteen bits, and tables of pairs grow with the square of the group."""
    line = fk.State(3.0 * np.arange(65536.0)[:, None], np.zeros((65536, 1)))
    alone = fk.Scenario(law_of(fk.Consensus()), line, 1.0)
    with pytest.raises(InvalidInput, match="scenario must have at most 65535 agents; got 65536"):
        c_files(alone, neighbours=4)
    n = 1100
    weighted = law_of(fk.Consensus(weights=np.ones((n, n)) - np.eye(n)))
    pairs = fk.Scenario(weighted, fk.State(line.q[:n], line.p[:n]), 1.0)
    with pytest.raises(InvalidInput, match="at most 1048576 numbers in tables; got 121"):
        c_files(pairs, neighbours=4)


def test_a_limit_behind_a_safety_filter_and_what_is_no_scenario_are_refused():
    """A limit after the filter would take back the braking that the filter asks for."""
    filtered = scenario(control=fk.SafetyFilter(0.1, distance=0.1, acceleration=5.0))
    with pytest.raises(InvalidInput, match="limit must be absent behind a safety filter"):
        c_files(filtered, limit=1.0)
    with pytest.raises(InvalidInput, match="export_c: scenario must be a Scenario"):
        c_files(LAW)


def test_numbers_too_large_for_single_precision_are_refused():
    law = law_of(fk.Consensus(1e39))
    assert c_files(scenario(law))
    with pytest.raises(UnsupportedLaw, match="1e\\+39, which is not finite"):
        c_files(scenario(law), float32=True)


@pytest.mark.parametrize("value", [1e-50, 1e-39])
def test_numbers_too_small_for_single_precision_are_refused(value):
    """A limit that rounds to zero would take every force away, and a gain its term."""
    for found, options in (
        (scenario(), {"limit": value}), (scenario(law_of(fk.Consensus(value))), {}),
        (scenario(law_of(fk.Gradient(fk.Potential(f"{value!r}*r")))), {}),
    ):  # fmt: skip
        assert c_files(found, **options)
        with pytest.raises(UnsupportedLaw, match=f"{value!r}, which is too small for this precision"):
            c_files(found, float32=True, **options)


@needs_compiler
def test_the_command_writes_a_folder_whose_example_runs(tmp_path, capsys):
    folder = tmp_path / "law"
    assert (
        main(["export-c", "zhou-2015-leader", "--out", str(folder), "--float32", "--neighbours", "4", "--name", "wing"])
        == 0
    )
    assert capsys.readouterr().out.strip() == str(folder / "wing.c")
    assert sorted(x.name for x in folder.iterdir()) == ["CMakeLists.txt", "README.md", "main.c", "wing.c", "wing.h"]
    text = (folder / "README.md").read_text()
    assert r"\frac{1}{\left(P_{0} - r\right)^{2}}" in text
    assert "| $P_{0}$ | term0 R | 4.0 |" in text
    flags = ["-std=c99", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror", "-pedantic"]
    sources = [str(folder / name) for name in ("wing.c", "main.c")]
    subprocess.run([COMPILER, *flags, "-o", str(folder / "example"), *sources], check=True)
    said = subprocess.run([folder / "example"], capture_output=True, text=True, check=True).stdout
    u = [float(line.split(" = ")[1]) for line in said.splitlines()[1:]]
    found = next(m for k, m in fk.papers.paper("zhou-2015").scenarios().items() if k == "zhou-2015-leader")(0)
    controller = fk.Controller(found.law, agents=found.start.n)
    start = found.start
    expected = controller(0.0, start.q[0], start.p[0], ids=[1], q=start.q[[1]], p=start.p[[1]])
    assert u == pytest.approx(expected, rel=1e-5, abs=1e-5)
    with pytest.raises(StorageError, match="not an empty folder"):
        fk.export_c(found, folder)


def numbers_of(law, agents=None, **options):
    """What the README says of each symbol."""
    n = 9
    start = fk.State(3.0 * np.arange(2.0 * n).reshape(n, 2), np.zeros((n, 2)), 5.0)
    files = c_files(fk.Scenario(law, start, 6.0, agents=agents or fk.Agents()), **options)
    rows = [line.strip("| ").split(" | ") for line in files["README.md"].splitlines() if line.startswith("| $")]
    return {what: value for _, what, value in rows}, files


def test_the_readme_says_every_number_or_names_its_table():
    """Numbers that change are said with their times; none is rounded."""
    gains = np.arange(9.0)
    track = fk.Track(fk.Velocity([1.0, 0.0]), fk.Schedule([6.0, 7.5], [1.0, 4.0, 0.1]), gains)
    weights = fk.MatrixWeights(np.ones((9, 9)) - np.eye(9))
    few = fk.Avoid([fk.Ball([50.0, 5.0], 0.5), fk.Ball([90.0, 5.0], 0.7)], range=2.0, repulsion_gain=5.0,
                   gamma_agents=False)  # fmt: skip
    law = fk.Law(fk.Proximity(4.0), [fk.Consensus(1 / 3), fk.Consensus(weights=weights), track, few])
    found, files = numbers_of(law, fk.Agents(1.0 + gains, 0.1), limit=1.23456789123)
    assert found["mass"] == "one for each agent: read by no formula"
    assert found["damping"] == "0.1"
    assert found["term0 gain"] == repr(1 / 3)
    assert found["term2 position_gain"] == "1.0 from 0 s on, 4.0 from 1 s on, 0.1 from 2.5 s on"
    assert found["obstacles0 radius"] == "0.5, 0.7, of obstacles 0 to 1"
    for what, slot in (("term2 velocity_gain", "A2"), ("term1 weights", "W0")):
        each = "agent" if slot == "A2" else "pair"
        assert found[what] == f"one for each {each}: `law_{slot}` in `law.c`"
        assert f"law_{slot}[" in files["law.c"]
    assert "Largest force: 1.23456789123;" in files["README.md"]
    three = scenario(agents=fk.Agents([1.0, 2.0, 3.5]))
    assert "| mass | 1.0, 2.0, 3.5, of agents 0 to 2 |" in c_files(three)["README.md"]


@pytest.mark.parametrize(
    ("given", "said"), [(3.0, "3.0 times the mass"), ([3.0, 3.0, 4.0], "the mass times the largest")]
)
def test_the_readme_counts_obstacles_of_a_filter_and_says_how_large_its_force_is(given, said):
    held = [fk.Ball([50.0, 50.0], 1.0), fk.Wall([-5.0, 0.0], [1.0, 0.0])]
    behind = fk.SafetyFilter(0.1, distance=0.5, acceleration=given, form="stopping", obstacles=held)
    text = c_files(scenario(control=behind))["README.md"]
    assert "\n2 obstacles or eight corrections" in text
    assert f"Largest force: {said}" in text
    assert "Largest force: none." in c_files(scenario())["README.md"]


@pytest.mark.parametrize("column", ["heading", "axis_1", "p"])
def test_the_readme_says_which_part_of_a_body_is_read(column):
    """The direction along which agents look is an argument: it does not count among what the source leaves out."""
    m, body = (3, fk.Quadrotor()) if column == "axis_1" else (2, fk.Unicycle(0.1))
    start = fk.State(np.arange(2.0 * m).reshape(2, m), np.zeros((2, m)))
    made = fk.Scenario(law_of(fk.Consensus(), graph=FieldOfView(2.0, 1.0, column)), start, 1.0, agents=body)
    text = c_files(made)["README.md"]
    left_out = re.search(r"besides \(([\w, ]+)\) is not read", text)
    names = left_out.group(1).split(", ") if left_out else []
    assert set(names) == {x.name for x in body.columns} - {column}
    assert (f"Its {column} is read as the argument `heading`." in text) == (column != "p")


def test_the_readme_says_how_often_a_filter_halves():
    filtered = scenario(control=fk.SafetyFilter(0.1, distance=0.1234567, acceleration=5.0))
    for single, halvings in ((False, 60), (True, 28)):
        text = c_files(filtered, float32=single)["README.md"]
        assert f"halves numbers up to {halvings} times" in text
        assert "distance 0.1234567)" in text


@needs_compiler
@pytest.mark.parametrize("level", ["-O0", "-O2", "-O3", "-Os"])
@pytest.mark.parametrize("kept", [1, 2])
def test_no_level_of_optimisation_warns(kept, level, tmp_path):
    """Where loops are unrolled the compiler looks at every index that bounds allow: one slot has no second."""
    filtered = {"control": fk.SafetyFilter(0.1, distance=0.1, acceleration=5.0)}
    heard = {"control": fk.Held(0.1), "information": fk.Messages(0.1, expires=0.5)}
    for number, (parts, single) in enumerate([({}, False), (filtered, True), (heard, True)]):
        folder = tmp_path / str(number)
        folder.mkdir()
        for name, text in c_files(scenario(**parts), float32=single, neighbours=kept).items():
            (folder / name).write_text(text)
        flags = [flag for flag in FLAGS if flag not in ("-O1", "-shared", "-fPIC")]
        done = subprocess.run([COMPILER, *flags, level, "-c", "law.c"], cwd=folder, capture_output=True, text=True)
        assert not done.stderr


def test_links_of_a_start_that_never_change_are_those_of_the_table():
    """A start that leaves a pair out, under a graph of links that never change: agents 0 and 2 are not linked."""
    links = np.array([[0, 1, 0], [1, 0, 1], [0, 1, 0]], dtype=bool)
    graph = fk.Fixed.complete(3)
    given = fk.Scenario(law_of(fk.Consensus(), graph=graph), fk.State(START.q, START.p, links=links), 1.0)
    assert (given.links_at_start[0] == links).all()
    # Bits of agents 0 to 2, the lowest first.
    assert "law_fixed0[3][1] = { { 2u }, { 5u }, { 2u } };" in c_files(given)["law.c"]


def test_a_start_with_links_that_distances_do_not_give_is_refused():
    for links, refused in ((np.zeros((3, 3), dtype=bool), True), (LAW.graph.initial(START.q), False)):
        given = fk.Scenario(LAW, fk.State(START.q, START.p, links=links), 1.0)
        if refused:
            with pytest.raises(UnsupportedLaw, match="this start has other links"):
                c_files(given)
        else:
            assert c_files(given) == c_files(scenario())


def test_the_readme_says_of_what_world_it_has_no_more_than_it_states():
    held = scenario(control=fk.Held(0.1, latency=0.03), information=fk.Messages(0.1, delay=0.02))
    text = c_files(held)["README.md"]
    (line,) = [x for x in text.splitlines() if x.startswith("Of the world of the scenario")]
    for part in (held.control, held.information):
        assert part.summary in line
    assert "Of the world" not in c_files(scenario())["README.md"]
    odd = c_files(scenario(name="a `b`\n# of\u00fc"))["README.md"]
    assert odd.splitlines()[0] == "# The control law of `a 'b' # of\u00fc` in C99"


def test_the_readme_says_how_old_a_state_may_be_and_whether_it_is_moved_on():
    for parts, said in (
        ({"expires": 0.25}, "used up to an age of 250000000 ns, and held as they were sent"),
        ({"predict": True}, "used at any age, and moved on with their velocity"),
    ):
        assert said in c_files(heard(LAW, **parts))["README.md"]


def test_the_readme_of_single_precision_says_that_numbers_are_rounded():
    said = "to which the declared numbers below are rounded"
    assert said in c_files(scenario(), float32=True)["README.md"]
    assert said not in c_files(scenario())["README.md"]


@pytest.mark.parametrize(("begin", "said"), [(0.0, "1.2e-07 s at t = 1."), (1e9, "64 s at t = 1000000001.")])
def test_the_readme_says_how_coarse_the_time_of_a_leader_is_in_single_precision(begin, said):
    led = law_of(fk.Consensus(), fk.Track(fk.Velocity([1.0, 0.0], start=[0.0, 0.0]), 1.0, 1.0))
    given = fk.Scenario(led, fk.State(START.q, START.p, begin), begin + 1.0)
    assert said in c_files(given, float32=True)["README.md"]
    assert "rounds to" not in c_files(given)["README.md"]
    alone = fk.Scenario(law_of(fk.Consensus()), fk.State(START.q, START.p, begin), begin + 1.0)
    assert "The law reads the time" not in c_files(alone, float32=True)["README.md"]


def test_the_readme_says_on_which_point_of_a_body_the_law_acts():
    text = c_files(scenario(agents=fk.Unicycle(0.2)))["README.md"]
    assert "Agents are Unicycle: q and p are those of the point on which the law acts" in text
    assert "(heading) is not read" in text
    assert "the point on which the law acts" not in c_files(scenario())["README.md"]
