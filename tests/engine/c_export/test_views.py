"""Exported laws of agents with fields of view and cones, compiled here: whom they see, and what their memory keeps."""

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import flocking as fk
from flocking.engine.c_export.export import c_files
from tests.engine.c_export.building import CODES, CompiledLaw, needs_compiler

pytestmark = needs_compiler
N = 6
TERMS = [fk.Gradient(fk.Potential("(r - 1)**2/2")), fk.Consensus(0.7)]
ANGLES = np.linspace(-3.0, 3.4, N)
HALVES = np.linspace(0.4, 3.0, N)
NEAR = 1e-4
"""Agents this close to a border, as a share of the radius or in radians, are not judged: single precision decides."""


def scenario_of(graph, m=2, headings=ANGLES, bodies=None):
    start = fk.State(np.arange(N * m, dtype=float).reshape(N, m), np.zeros((N, m)))
    return fk.Scenario(fk.Law(graph, TERMS), start, 1.0, agents=bodies or fk.Agents(headings=headings))


def angle(a, b):
    """The angle between two vectors; zero where one has no direction."""
    size = np.linalg.norm(a) * np.linalg.norm(b)
    return float(np.arccos(np.clip(a @ b / size, -1.0, 1.0))) if size > 0.0 else 0.0


def seen_by_hand(kind, agent, q, p, others, m, headings, pointing):
    """Who is seen, by angles, and whether each is far from the border."""
    found, clear = set(), True
    for j, (x, _) in others.items():
        if kind == "cone":
            gap = abs((headings[j] - headings[agent] + np.pi) % (2.0 * np.pi) - np.pi)
            here, most = True, 1.4
        else:
            along = {"velocity": p, "body": pointing}.get(kind)
            if along is None:
                turned = headings[agent]
                along = turned[:, 0] if m == 3 else np.array([np.cos(turned), np.sin(turned)])
            gap, most = angle(x - q, along), HALVES[agent]
            here = True
        r = float(np.linalg.norm(x - q))
        clear &= here and abs(r - 2.0) > 2.0 * NEAR and abs(gap - most) > NEAR
        if r <= 2.0 and gap <= most:
            found.add(j)
    return found, clear


KINDS = {
    "heading": lambda: fk.FieldOfView(2.0, HALVES), "velocity": lambda: fk.FieldOfView(2.0, HALVES, "p"),
    "cone": lambda: fk.Cone(2.0, 1.4, "wrapped"),
}  # fmt: skip
BODIES = {2: (fk.Unicycle(0.1), "heading"), 3: (fk.Quadrotor(), "axis_1")}
"""Bodies by the number of axes, and the name of a direction that turns with them."""


def compiled_of(kind, m, headings, folder, **options):
    """A law of agents who look in some way, compiled."""
    if kind == "body":
        bodies, column = BODIES[m]
        return CompiledLaw(folder, scenario_of(fk.FieldOfView(2.0, HALVES, column), m, bodies=bodies),
                           along=["heading"], **options)  # fmt: skip
    return CompiledLaw(folder, scenario_of(KINDS[kind](), m, headings), along=["p"] * (kind == "velocity"), **options)


@pytest.mark.parametrize("float32", [False, True])
@pytest.mark.parametrize(
    ("kind", "m"),
    [("heading", 2), ("heading", 3), ("velocity", 2), ("velocity", 3), ("cone", 2), ("body", 2), ("body", 3)],
)
def test_whom_an_agent_sees_is_found_by_angles(kind, m, float32, tmp_path):
    headings = Rotation.random(N, rng=np.random.default_rng(7)).as_matrix() if m == 3 else ANGLES
    compiled = compiled_of(kind, m, headings, tmp_path, float32=float32)
    rng, sizes, judged = np.random.default_rng(3), set(), 0
    for k in range(300):
        agent = int(rng.integers(N))
        q, p = rng.normal(size=m), rng.normal(size=m) * 10.0 ** rng.integers(-6, 6)
        p *= k % 10 > 0
        others = {j: (q + rng.normal(size=m), rng.normal(size=m)) for j in range(N) if j != agent}
        pointing = rng.normal(size=m)
        pointing /= np.linalg.norm(pointing)
        expected, clear = seen_by_hand(kind, agent, q, p, others, m, headings, pointing)
        code, u, memory = compiled.force(agent, q, p, others, heading=pointing if kind == "body" else None)
        assert code == CODES["OK"]
        if not clear:
            continue
        judged += 1
        sizes.add(len(expected))
        assert set(compiled.links(memory)) == expected
        pairs = [(others[j][0] - q, others[j][1] - p) for j in expected]
        pull = sum((d - d / np.linalg.norm(d) + 0.7 * v for d, v in pairs), np.zeros(m))
        size = 1.0 + sum(np.abs(v).max() for _, v in pairs)
        np.testing.assert_allclose(u, pull, rtol=0.0, atol=(2e-6 if float32 else 1e-14) * 20 * size)
    assert judged > 200
    assert {0, 1, 2, 3} <= sizes


def test_the_factor_of_headings_is_that_of_the_smooth_cone(tmp_path):
    graph = fk.SmoothCone(2.0, 0.3, 1.5, "quintic", "wrapped")
    law = fk.Law(graph, [fk.Consensus(0.7, weighted=True)])
    made = fk.Scenario(law, fk.State(np.arange(12.0).reshape(N, 2), np.zeros((N, 2))), 1.0,
                       agents=fk.Agents(headings=ANGLES))  # fmt: skip
    compiled, rng = CompiledLaw(tmp_path, made), np.random.default_rng(1)
    for _ in range(50):
        q, p = rng.uniform(0.0, 3.0, (N, 2)), rng.normal(size=(N, 2))
        expected = fk.evaluate(law, fk.State(q, p), agents=made.agents).u
        for i in range(N):
            code, u, _ = compiled.force(i, q[i], p[i], {j: (q[j], p[j]) for j in range(N) if j != i})
            assert code == CODES["OK"]
            np.testing.assert_allclose(u, expected[i], rtol=0.0, atol=1e-13)


def test_a_full_memory_keeps_those_who_are_seen(tmp_path):
    """Two slots: one straight ahead that is farther stays before one behind, and is given up for none behind."""
    graph = fk.FieldOfView(5.0, 0.6, "p")
    compiled, rest = CompiledLaw(tmp_path, scenario_of(graph), neighbours=2, along=["p"]), [0.0, 0.0]
    memory, moving = compiled.begin(0), [2.0, 0.0]
    assert compiled.control(memory, rest, moving)[0] == CODES["OK"]
    for sender, place in ((1, [4.0, 0.0]), (2, [-1.0, 0.0])):
        assert compiled.receive(memory, sender, place, rest) == CODES["OK"]
    assert compiled.control(memory, rest, moving, 1)[0] == CODES["OK"]
    assert compiled.links(memory) == [1]
    assert compiled.receive(memory, 3, [-2.0, 0.0], rest, now=1) == CODES["FULL"]
    assert compiled.receive(memory, 4, [4.5, 0.1], rest, now=1) == CODES["ROOM"]
    assert sorted(memory.known[s].sender for s in memory.order[:2]) == [1, 4]
    # It turns round: whom it sees now counts, and nothing of before is remembered.
    assert compiled.control(memory, rest, [-2.0, 0.0], 2)[0] == CODES["OK"]
    assert compiled.links(memory) == []
    assert compiled.receive(memory, 3, [-2.0, 0.0], rest, number=1, stamp=2) == CODES["ROOM"]


def test_links_of_a_start_are_seen_along_the_velocity(tmp_path):
    compiled, rest = CompiledLaw(tmp_path, scenario_of(fk.FieldOfView(5.0, 0.6, "p")), along=["p"]), [0.0, 0.0]
    memory = compiled.begin(0)
    compiled.receive(memory, 1, [1.0, 0.0], rest)
    compiled.receive(memory, 2, [-1.0, 0.0], rest)
    for moving, expected in (([3.0, 0.0], [1]), ([-3.0, 0.0], [2]), ([0.0, 0.0], [1, 2]), ([0.0, 1e-300], [])):
        assert compiled.start(memory, rest, p=moving) == CODES["OK"]
        assert compiled.links(memory) == expected
    assert compiled.start(memory, rest, p=[np.nan, 0.0]) == CODES["NOT_FINITE"]


def looking(graph, folder, **options):
    """The law of unicycles with a ``graph``, compiled."""
    bodies, _ = BODIES[2]
    along = ["p"] * (graph.heading_column == "p") + ["heading"] * (graph.heading_column == "heading")
    return CompiledLaw(folder, scenario_of(graph, bodies=bodies), along=along, **options)


def test_a_robot_looks_along_its_heading_wherever_it_drives(tmp_path):
    """Links of a start, links at a call and slots that are given up follow the heading, not the velocity."""
    compiled, rest, right, left = looking(fk.FieldOfView(5.0, 0.6, "heading"), tmp_path, neighbours=2), 2 * [0.0], [
        1.0, 0.0], [-1.0, 0.0]  # fmt: skip
    memory = compiled.begin(0)
    assert compiled.receive(memory, 1, [4.0, 0.0], rest) == CODES["OK"]
    assert compiled.receive(memory, 2, [-1.0, 0.0], rest) == CODES["OK"]
    for heading, expected in ((right, [1]), (left, [2]), ([3e-200, 0.0], [1]), ([0.0, -2.0], [])):
        assert compiled.start(memory, rest, heading=heading) == CODES["OK"]
        assert compiled.links(memory) == expected
    assert compiled.control(memory, rest, left, heading=right)[0] == CODES["OK"]
    assert compiled.links(memory) == [1]
    assert compiled.receive(memory, 3, [-2.0, 0.0], rest) == CODES["FULL"]
    assert compiled.receive(memory, 4, [4.5, 0.1], rest) == CODES["ROOM"]
    assert compiled.control(memory, rest, left, 1, heading=left)[0] == CODES["OK"]
    assert compiled.links(memory) == []


def test_a_heading_that_points_nowhere_is_refused(tmp_path):
    compiled, rest = looking(fk.FieldOfView(5.0, 0.6, "heading"), tmp_path), [0.0, 0.0]
    memory = compiled.begin(0)
    for heading in ([0.0, 0.0], [-0.0, 0.0], [np.nan, 1.0], [1.0, np.inf]):
        code, u = compiled.control(memory, rest, rest, heading=heading)
        assert code == CODES["NOT_FINITE"]
        assert (u == 0.0).all()
        assert compiled.start(memory, rest, heading=heading) == CODES["NOT_FINITE"]
    assert memory.begun == 0


def test_agents_straight_behind_are_seen_by_those_who_look_all_around(tmp_path):
    compiled = CompiledLaw(tmp_path, scenario_of(fk.FieldOfView(2.0, np.pi)))
    rng = np.random.default_rng(2)
    for _ in range(200):
        behind = -np.array([np.cos(ANGLES[3]), np.sin(ANGLES[3])]) * rng.uniform(0.1, 1.9)
        _, _, memory = compiled.force(3, [0.0, 0.0], [0.0, 0.0], {1: (behind, [0.0, 0.0])})
        assert compiled.links(memory) == [1]


@pytest.mark.parametrize("graph", [fk.FieldOfView(2.0, 1e-9), fk.FieldOfView(2.0, 1e-9, "p"), fk.Cone(2.0, 0.5)])
def test_agents_at_the_border_itself_are_neighbours(graph, tmp_path):
    """Straight ahead within a view whose cosine is 1, at the radius itself, with the opening as the gap of headings."""
    made = scenario_of(graph, headings=0.5 * np.arange(N))
    compiled = CompiledLaw(tmp_path, made, along=["p"] * (getattr(graph, "heading_column", "") == "p"))
    _, _, memory = compiled.force(0, [0.0, 0.0], [3.0, 0.0], {1: ([2.0, 0.0], [0.0, 0.0]), 2: ([0.0, 2.0], [0.0, 0.0])})
    assert compiled.links(memory) == [1]


LIKE = "whose constant heading is similar enough"


@pytest.mark.parametrize(
    ("graph", "said"),
    [
        (fk.FieldOfView(2.5, 1.25, "heading"),
         "up to the distance 2.5, within 1.25 rad of the agent's heading, the argument `heading`."),
        (fk.FieldOfView(2.5, 1.25),
         "up to the distance 2.5, within 1.25 rad of the agent's constant heading in `law_heading0`."),
        (fk.FieldOfView(np.linspace(1.0, 2.0, N), HALVES, "p"),
         "up to the distance in `law_radii0` of `law.c`, within the angle whose cosine is in `law_cosine0` of `law.c` "
         "of the agent's velocity, at rest all around."),
        (fk.Cone(2.5, 1.4), f"up to the distance 2.5, {LIKE} (by the table `law_similar0` in `law.c`)."),
        (fk.Cone(2.5, 9.0), f"up to the distance 2.5, {LIKE} (all have)."),
        (fk.SmoothCone(2.5, 0.5, 1.4), f"below the distance 2.5, {LIKE} (by the table `law_similar0` in `law.c`)."),
        (fk.Hysteresis(2.5, 0.5), "a link appears below the distance 2.0 and stays below 2.5; at the start all "
                                  "below 2.5 are linked."),
        (fk.Fixed(N, [(0, 1)]), "those of the table `law_fixed0` in `law.c`."),
        (fk.Fixed.complete(N), "all of whom a state is known."),
    ],
)  # fmt: skip
def test_the_readme_says_who_is_linked_and_names_tables_that_are_there(graph, said):
    files = c_files(scenario_of(graph, bodies=fk.Unicycle(0.1) if said.endswith("`heading`.") else None))
    line = next(line for line in files["README.md"].splitlines() if line.startswith("Graph 0: "))
    assert line.startswith(f"Graph 0: {type(graph).__name__}, ")
    assert line.endswith(said)
    assert all(f" {name}[" in files["law.c"] for name in re.findall(r"`(law_\w+)`", line))
