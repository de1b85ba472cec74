"""Neighbourhoods that see headings: definitions, and links of runs against them frame by frame."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.errors import InvalidInput
from flocking.model.graphs.views import heading_gaps
from flocking.model.potentials.bumps import BUMPS
from flocking.study.nets.matrices import adjacency, is_balanced


def rotations(angles: np.ndarray) -> np.ndarray:
    c, s = np.cos(angles), np.sin(angles)
    return np.moveaxis(np.array([[c, -s], [s, c]]), -1, 0)


def test_measures_of_headings() -> None:
    theta = np.array([3.0, -3.0, 0.2])
    assert heading_gaps(theta, "real")[0, 1] == 6.0
    assert heading_gaps(theta, "wrapped")[0, 1] == pytest.approx(2 * np.pi - 6.0)
    planar = heading_gaps(rotations(theta), "rotation")
    np.testing.assert_allclose(planar, heading_gaps(theta, "rotation"), atol=1e-14)
    np.testing.assert_allclose(planar[0, 1], 1 - np.cos(6.0), atol=1e-14)


def test_rotation_distance_in_space_is_half_the_trace() -> None:
    from scipy.spatial.transform import Rotation

    R = Rotation.random(5, random_state=1).as_matrix()
    expected = [[0.5 * np.trace(np.eye(3) - R[j].T @ R[i]) for j in range(5)] for i in range(5)]
    np.testing.assert_allclose(heading_gaps(R, "rotation"), expected, atol=1e-12)
    with pytest.raises(InvalidInput, match="rotation matrices"):
        heading_gaps(2 * R, "rotation")
    with pytest.raises(InvalidInput, match="rotation matrices"):
        heading_gaps((1 + 1e-6) * R, "rotation")
    with pytest.raises(InvalidInput, match="measure"):
        heading_gaps(R, "real")


def test_printed_cone_is_undirected_for_common_values() -> None:
    """(5) is symmetric in i and j, against the text: a uniform conic net as printed is balanced."""
    rng = np.random.default_rng(0)
    q, theta = rng.uniform(0, 5, (12, 2)), rng.uniform(-3, 3, 12)
    links = fk.Cone(2.5, 1.2).start_links(q, theta)
    expected = np.array([
        [i != j and np.linalg.norm(q[j] - q[i]) <= 2.5 and abs(theta[j] - theta[i]) <= 1.2 for j in range(12)]
        for i in range(12)
    ])  # fmt: skip
    np.testing.assert_array_equal(links, expected)
    assert is_balanced(links)
    assert not fk.Cone(2.5, 1.2).directed
    own = fk.Cone(rng.uniform(1, 4, 12), rng.uniform(0.5, 2, 12))
    assert own.directed
    assert not is_balanced(own.start_links(q, theta))


def test_field_of_view_is_directed_and_not_balanced() -> None:
    """Fig. 1(b), and the counter-example to Proposition 1(i): a uniform net that is not balanced."""
    q = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    links = fk.FieldOfView(2.0, 0.6).start_links(q, np.array([0.0, 0.0, -np.pi / 4]))
    np.testing.assert_array_equal(links, [[False, True, False], [False, False, False], [False, True, False]])
    assert not is_balanced(links)
    everywhere = fk.FieldOfView(2.0, np.pi).start_links(q, np.zeros(3))
    np.testing.assert_array_equal(everywhere, ~np.eye(3, dtype=bool))


def test_field_of_view_in_space() -> None:
    frames = np.array([np.eye(3), np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])])
    q = np.array([[0.0, 0.0, 0.0], [1.0, 0.2, 0.2]])
    links = fk.FieldOfView(2.0, 0.5).start_links(q, frames)
    assert links[0, 1]
    assert not links[1, 0]


def test_smooth_cone_weights() -> None:
    """(18)."""
    rng = np.random.default_rng(1)
    q, theta = rng.uniform(0, 4, (8, 2)), rng.uniform(-1, 1, 8)
    weights = adjacency(fk.SmoothCone(3.0, 0.6, 1.2), q, theta)
    for i in range(8):
        for j in range(8):
            r, gap = np.linalg.norm(q[j] - q[i]), abs(theta[j] - theta[i])
            product = BUMPS["cosine"](r / 3.0, 0.6) * BUMPS["cosine"](gap / 1.2, 0.6)
            assert weights[i, j] == pytest.approx(float(product) if i != j else 0.0, abs=1e-14)


GRAPHS = {
    "narrow view": fk.FieldOfView(3.0, 0.6),
    "wide view": fk.FieldOfView(3.0, 2.2),
    "own views": fk.FieldOfView(np.linspace(2, 4, 10), np.linspace(0.3, 3.0, 10)),
    "cone": fk.Cone(3.0, 1.0),
    "wrapped cone": fk.Cone(3.0, 1.0, "wrapped"),
    "own cones": fk.Cone(np.linspace(2, 4, 10), 1.0),
    "smooth cone": fk.SmoothCone(3.0, 0.6, 1.2),
}


@pytest.mark.parametrize("name", GRAPHS)
def test_links_along_a_run_are_those_of_the_definition(name: str) -> None:
    graph, rng = GRAPHS[name], np.random.default_rng(3)
    agents = fk.Agents(headings=rng.uniform(-np.pi, np.pi, 10))
    start = fk.State(rng.uniform(0, 6, (10, 2)), 2 * rng.normal(size=(10, 2)))
    law = fk.Law(graph, [fk.Gradient(fk.Potential("(r - 1)^2")), fk.Consensus(0.3)])
    run = fk.simulate(fk.Scenario(law, start, 3.0, agents=agents, frames=401), progress=False)
    assert len(run.switches) >= 3
    for k in range(401):
        np.testing.assert_array_equal(run.links[k], graph.start_links(run.q[k], agents.headings))
    assert np.abs(run.residual).max() < 1e-5
    last = run.state(400)
    np.testing.assert_allclose(
        fk.control(law, last, agents=agents), fk.control(law, fk.State(last.q, last.p), agents=agents)
    )


def test_bearing_switch_is_located_exactly() -> None:
    """A fixed observer that looks along x sees an agent flying upwards between two known times."""
    start = fk.State([[0.0, 0.0], [2.0, -5.0]], [[0.0, 0.0], [0.0, 1.0]])
    law = fk.Law(fk.FieldOfView(10.0, np.pi / 6), [fk.Consensus(0.0)])
    run = fk.simulate(fk.Scenario(law, start, 9.0, agents=fk.Agents(headings=[0.0, 0.0])), progress=False)
    rise = 2.0 * np.tan(np.pi / 6)
    assert [str(k) for k in run.switches["kind"]] == ["appear", "break"]
    np.testing.assert_allclose(run.switches["time"], [5.0 - rise, 5.0 + rise], rtol=1e-10)


def test_headings_must_be_given() -> None:
    law = fk.Law(fk.Cone(1.0, 1.0), [fk.Consensus()])
    state = fk.State(np.zeros((2, 2)))
    with pytest.raises(InvalidInput, match="headings"):
        fk.control(law, state)
    with pytest.raises(InvalidInput, match="headings"):
        fk.simulate(fk.Scenario(law, state, 1.0))
    with pytest.raises(InvalidInput, match="at most pi"):
        fk.FieldOfView(1.0, 4.0)


@pytest.mark.parametrize("half_angle", [np.pi, np.pi - 1e-9])
def test_a_view_of_the_whole_circle_has_no_blind_line_behind(half_angle: float) -> None:
    """Whatever the rounding of sines, cosines and lengths: agents straight behind are within the half angle pi."""
    rng = np.random.default_rng(0)
    for m in (2, 3):
        way = rng.normal(size=(300, m))
        way /= np.linalg.norm(way, axis=1)[:, None]
        for ahead, far in zip(way, rng.uniform(0.1, 3.0, 300), strict=True):
            frame = np.linalg.qr(np.column_stack([ahead, rng.normal(size=(m, m - 1))]))[0]
            frame *= np.sign(frame[:, 0] @ ahead)
            frame[:, -1] *= np.linalg.det(frame)
            headings = np.arctan2(*np.array([ahead, ahead])[:, ::-1].T) if m == 2 else np.array([frame, frame])
            q = np.array([np.zeros(m), -far * (ahead if m == 2 else frame[:, 0])])
            assert fk.FieldOfView(5.0, half_angle).start_links(q, headings).sum() == 2


@pytest.mark.parametrize("heading", [-2.93730014, 0.3, 1.1, 2.4])
def test_a_run_keeps_links_of_agents_that_see_all_around(heading: float) -> None:
    back = -1.7 * np.array([np.cos(heading), np.sin(heading)])
    law = fk.Law(fk.FieldOfView(5.0, [np.pi, 1.0]), [fk.Consensus(0.1)])
    start = fk.State([[0.0, 0.0], back], [[0.0, 0.0], 0.2 * back])
    scenario = fk.Scenario(law, start, 2.0, agents=fk.Agents(headings=[heading, 2.0]))
    assert fk.simulate(scenario, progress=False).links[:, 0, 1].all()


@pytest.mark.parametrize("size", [2, 3])
def test_an_opening_of_the_largest_gap_is_the_whole_group(size: int) -> None:
    """trace(I - R^T R)/2 of rotations is at most 2 in the plane and in space, whatever the rounding."""
    rng = np.random.default_rng(size)
    for _ in range(200):
        frame = np.linalg.qr(rng.normal(size=(size, size)))[0]
        frame[:, 0] *= np.linalg.det(frame)
        half_turn = frame @ np.diag([-1.0, -1.0, 1.0][:size]) @ frame.T
        headings = np.array([frame, half_turn @ frame, frame])
        gaps = heading_gaps(headings, "rotation")
        assert gaps.min() >= 0.0
        assert gaps.max() <= 2.0
        assert fk.Cone(1.0, 2.0, "rotation").start_links(np.zeros((3, size)), headings).sum() == 6


@pytest.mark.parametrize(
    "headings", [np.zeros((4, 2, 2)), 2.0 * np.tile(np.eye(2), (4, 1, 1)), np.ones((4, 2, 3))],
    ids=["zeros", "twice as long", "not square"],
)  # fmt: skip
@pytest.mark.parametrize(
    "graph", [fk.FieldOfView(1.5, 1.0), fk.Cone(1.5, 1.0, "rotation"), fk.SmoothCone(1.5, 0.3, 1.0, measure="rotation")]
)  # fmt: skip
def test_headings_that_are_no_rotations_are_refused_wherever_agents_look(graph, headings):
    """A direction that is twice as long would be compared with the cosine of another half angle."""
    start = fk.State(np.arange(8.0).reshape(4, 2), np.zeros((4, 2)))
    made = fk.Scenario(fk.Law(graph, [fk.Consensus(1.0)]), start, 0.1, agents=fk.PointMass(headings=headings))
    for scenario, engine in ((made, "exact"), (made, "tiles"), (made.with_(control=fk.Held(0.1)), "sampled")):
        with pytest.raises(InvalidInput, match="must be rotation matrices"):
            fk.start(scenario, engine=engine)
