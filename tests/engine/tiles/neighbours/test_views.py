"""Fields of view in the tiled engine: what agents sense, how groups move, what is counted, refused and checked."""

import networkx as nx
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import flocking as fk
from flocking.engine.tiles.session import TilesOptions, TilesSession
from flocking.errors import LawNotObeyed, UnsupportedLaw
from flocking.model.graphs.seen_headings import links_at_state
from tests.engine.tiles.laws import accelerations, deviations, states

SPRING = fk.Gradient(fk.Potential("k*(r - 1)**2/2", k=0.3))
TERMS = (SPRING, fk.Consensus(0.4))
HALF_ANGLES = {"narrow": 0.4, "quarter turn": np.pi / 2, "wide": 2.6, "all around": np.pi}


def _headings(n, m, seed=0):
    rng = np.random.default_rng(seed)
    return rng.uniform(-np.pi, np.pi, n) if m == 2 else Rotation.random(n, rng=rng).as_matrix()


def _scenario(graph, n=40, m=2, seed=1, t_end=0.5, **more):
    rng = np.random.default_rng(seed)
    q, p = rng.uniform(-2.5, 2.5, (n, m)), 0.5 * rng.normal(size=(n, m)) + 0.3
    start, agents = fk.State(q, p), fk.PointMass(rng.uniform(0.5, 2.0, n), 0.1)
    if graph.heading_column == "heading":
        angles = _headings(n, m)
        start = fk.State(q, p, columns={"heading": np.stack([np.cos(angles), np.sin(angles)], axis=1)})
        agents = fk.Unicycle(np.linspace(0.3, 0.6, n))
    elif not graph.heading_column:
        agents = fk.PointMass(rng.uniform(0.5, 2.0, n), 0.1, _headings(n, m))
    return fk.Scenario(fk.Law(graph, TERMS), start, t_end=t_end, agents=agents, frames=6, **more)


@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize("m", [2, 3])
@pytest.mark.parametrize("name", HALF_ANGLES)
def test_forces_are_those_of_the_agents_in_view(name, m, precision):
    n, tolerance = 300, {"float64": 1e-12, "float32": 2e-5}[precision]
    for column in ("", "p"):
        graph = fk.FieldOfView(1.6, HALF_ANGLES[name], column)
        agents = fk.PointMass(headings=None if column else _headings(n, m))
        for state in ("random", "clustered"):
            made = states(n, m, seed=3)[state]
            found, expected, scale = accelerations(fk.Law(graph, TERMS), made, agents=agents, precision=precision)
            # In single precision a few agents of these drawn states would be on the other side of a border.
            wrong = (np.abs(found - expected) > tolerance * (1.0 + scale[:, None])).any(axis=1)
            assert wrong.sum() <= (0 if precision == "float64" else 2), np.flatnonzero(wrong)


def test_radii_and_half_angles_of_each_agent_follow_the_agents_through_sorts():
    n, rng = 200, np.random.default_rng(5)
    graph = fk.FieldOfView(rng.uniform(0.5, 2.5, n), rng.uniform(0.3, np.pi, n))
    agents = fk.PointMass(headings=_headings(n, 2))
    for state in ("random", "straggler"):
        found, expected, scale = accelerations(fk.Law(graph, TERMS), states(n, 2, seed=6)[state], agents=agents)
        assert np.abs(found - expected).max() <= 1e-12 * (1.0 + scale.max())


def test_agents_at_rest_look_all_around_and_those_at_one_place_see_each_other():
    q = np.array([[0.0, 0.0], [-0.7, 0.0], [0.0, 0.0]])
    p = np.array([[1.0, 0.0], [0.0, 0.0], [0.0, 1.0]])
    law = fk.Law(fk.FieldOfView(1.0, 0.5, "p"), (fk.Consensus(1.0),))
    found, _, _ = accelerations(law, fk.State(q, p))
    # The first one moves away from the second; that one is at rest and sees both; the third looks sideways.
    np.testing.assert_allclose(found, [[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]], atol=1e-15)


@pytest.mark.parametrize(("length", "speed"), [(1.0, 1.0), (1e-12, 1e-12), (1e-16, 1e-3), (1.0, 1e-30), (1e12, 1e12)])
@pytest.mark.parametrize("m", [2, 3])
def test_views_along_velocities_are_the_same_in_all_units_in_single_precision(length, speed, m):
    """Squares of products of lengths and speeds of 1e-12 are 1e-48, less than single precision holds."""
    made = states(200, m, seed=4)["random"]
    law = fk.Law(fk.FieldOfView(1.6, 0.9, "p"), (fk.Consensus(1.0),))
    _, expected, _ = accelerations(law, made)
    law = fk.Law(fk.FieldOfView(1.6 * length, 0.9, "p"), (fk.Consensus(1.0),))
    found, _, _ = accelerations(law, fk.State(made.q * length, made.p * speed), precision="float32")
    wrong = (np.abs(found / speed - expected) > 1e-4).any(axis=1)
    assert wrong.sum() <= 1, np.flatnonzero(wrong)


@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize("length", [1.0, 1e-12])
def test_runs_in_small_units_are_not_blamed_for_what_no_number_holds(length, precision):
    made = _scenario(fk.FieldOfView(1.5 * length, 1.1, "p"), n=60, t_end=0.05)
    start = fk.State(made.start.q * length, made.start.p * length)
    spring = fk.Gradient(fk.Potential("k*(r - d)**2/2", k=0.3, d=length))
    small = made.with_(start=start, law=fk.Law(made.law.graph, (spring, fk.Consensus(0.4))))
    assert fk.simulate(small, engine="tiles", step=0.01, precision=precision, progress=False).finished


@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize("radius", [1.5, np.array([1.5, 1.5])])
def test_agents_at_the_radius_are_seen(radius, precision):
    state = fk.State([[0.0, 0.0], [1.5, 0.0]], [[0.0, 0.0], [1.0, 0.0]])
    law = fk.Law(fk.FieldOfView(radius, 1.0), (fk.Consensus(1.0),))
    found, expected, _ = accelerations(law, state, agents=fk.PointMass(headings=[0.0, np.pi]), precision=precision)
    np.testing.assert_array_equal(expected, [[1.0, 0.0], [-1.0, 0.0]])
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize(
    ("column", "scheme"), [*((c, s) for c in ("", "p") for s in ("verlet", "damped", "rk4")), ("heading", "rk4")]
)
@pytest.mark.parametrize("ledger", [True, False])
def test_links_of_frames_are_those_of_the_graph_there(column, scheme, ledger):
    made = _scenario(fk.FieldOfView(1.5, 1.1, column))
    scheme = None if column == "heading" else scheme
    run = fk.simulate(made, engine="tiles", step=0.01, scheme=scheme, ledger=ledger, progress=False)
    different = 0
    for q, p, t, links in zip(run.q, run.p, run.t, run.links, strict=True):
        columns = {name: values[np.flatnonzero(run.t == t)[0]] for name, values in run.columns.items()}
        state = fk.State(q, p, t, columns=columns)
        expected = links_at_state(made.law.graph, made.space, state, made.agents.headings)
        different += int((links != expected).sum())
        assert links.any()
    assert different == 0
    assert (run.links[0] != run.links[-1]).any()


@pytest.mark.parametrize(
    ("graph", "m"),
    [
        *((fk.FieldOfView(*given), m) for given in ((1.5, 1.1), (1.7, 2.0, "p")) for m in (2, 3)),
        (fk.FieldOfView(1.7, 1.4, "heading"), 2),
    ],
)
def test_motion_and_ledger_tend_to_those_of_the_exact_engine(graph, m):
    made = _scenario(graph, n=25, m=m, t_end=0.4)
    exact = fk.simulate(made, engine="exact", progress=False)
    assert len(exact.switches) > 5
    # Links follow at steps: a switch is late by a part of the step, so that errors are multiples of it on the whole.
    coarse, fine = (deviations(made, exact, step) for step in (8e-3, 1e-3))
    assert coarse.max() < 0.03
    assert fine.max() < 0.003
    assert fine.sum() < 0.35 * coarse.sum(), (coarse, fine)


@pytest.mark.parametrize("column", ["", "p", "heading"])
def test_links_and_flocks_are_counted_as_the_link_matrix_states(column):
    made = _scenario(fk.FieldOfView(0.8, 1.0, column), n=60)
    run = fk.simulate(made, engine="tiles", step=0.01, observe=True, progress=False)
    for row, links in enumerate(run.links):
        graph = nx.from_numpy_array(links, create_using=nx.DiGraph)
        assert run.observables["flocks"][row] == nx.number_weakly_connected_components(graph)
        assert run.observables["neighbours"][row] == links.sum() / len(links)


@pytest.mark.parametrize(("column", "factor"), [("", 1.05), ("p", 1.05)])
def test_a_view_that_the_kernel_has_wrong_stops_the_run(column, factor):
    made = _scenario(fk.FieldOfView(1.5, 0.9, column), n=600)
    session = TilesSession(made, TilesOptions(step=0.005))
    session._particles.radii.views[0][0] *= factor
    with pytest.raises(LawNotObeyed, match="declared law"):
        session.advance(0.4)


@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_what_is_right_gives_no_alarm_at_borders_and_at_rest(precision):
    """Neighbours on a square lattice are exactly at the border of an eighth of a turn; agents at rest see everybody."""
    n = 400
    q = np.stack(np.meshgrid(np.arange(20.0), np.arange(20.0)), axis=-1).reshape(-1, 2)
    at_border = fk.PointMass(headings=np.pi / 4 * (np.arange(n) % 8))
    for graph, agents in (
        (fk.FieldOfView(1.6, np.pi / 4), at_border), (fk.FieldOfView(1.6, np.pi / 2), at_border),
        (fk.FieldOfView(1.6, 0.5, "p"), fk.PointMass()),
    ):  # fmt: skip
        for p in (np.zeros((n, 2)), np.tile([1.0, 0.0], (n, 1))):
            law = fk.Law(graph, (fk.Gradient(fk.Potential("k*(r - 1.1)**2/2", k=0.3)), fk.Consensus(0.4)))
            made = fk.Scenario(law, fk.State(q, p), t_end=0.1, agents=agents, frames=2)
            run = fk.simulate(made, engine="tiles", step=0.005, precision=precision, progress=False)
            assert run.finished


def test_large_groups_with_views_are_run_by_the_tiles():
    n = 2500
    start = fk.start.box(n, side=60.0, speed=0.5, seed=1)
    law = fk.Law(fk.FieldOfView(2.0, 2.0, "p"), TERMS)
    session = fk.start(fk.Scenario(law, start, t_end=1.0))
    assert isinstance(session, TilesSession)


def test_another_law_takes_other_views():
    made = _scenario(fk.FieldOfView(1.5, 1.1))
    session = fk.start(made, engine="tiles", step=0.01)
    session.advance(0.1)
    law = fk.Law(fk.FieldOfView(1.8, 2.5), TERMS)
    session.replace(law=law)
    state = session.state
    assert state.links is not None
    assert (state.links == law.graph.start_links(state.q, made.agents.headings)).all()


def test_links_of_a_start_that_contradict_the_views_are_refused():
    made = _scenario(fk.FieldOfView(1.5, 1.1))
    links = made.law.graph.start_links(made.start.q, made.agents.headings)
    given = fk.State(made.start.q, made.start.p, links=links)
    assert fk.start(made.with_(start=given), engine="tiles").state.links.sum() == links.sum()
    for wrong in (links, ~links & ~np.eye(len(links), dtype=bool)):
        (i, j), given = np.argwhere(wrong)[0], links.copy()
        given[i, j] ^= True
        with pytest.raises(UnsupportedLaw, match=f"differ from it for agents {i} and {j}"):
            fk.start(made.with_(start=fk.State(made.start.q, made.start.p, links=given)), engine="tiles")
