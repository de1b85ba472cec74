"""Cones in the tiled engine: neighbours are agents within a radius whose constant headings are similar."""

from dataclasses import dataclass

import networkx as nx
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import flocking as fk
from flocking.engine.tiles.neighbours import similar_headings
from flocking.engine.tiles.session import TilesOptions, TilesSession
from flocking.errors import InvalidInput, LawNotObeyed, UnsupportedLaw
from flocking.model.graphs.seen_headings import links_at_state
from tests.engine.tiles.laws import accelerations, deviations, states

TERMS = (fk.Gradient(fk.Potential("k*(r - 1)**2/2", k=0.3)), fk.Consensus(0.4))
CONES = {
    "real": lambda n: fk.Cone(1.6, 1.2, "real"),
    "wrapped": lambda n: fk.Cone(1.6, 1.2, "wrapped"),
    "all around": lambda n: fk.Cone(1.6, np.pi, "wrapped"),
    "rotation": lambda n: fk.Cone(1.6, 0.5, "rotation"),
    "any rotation": lambda n: fk.Cone(1.6, 2.0, "rotation"),
    "each": lambda n: fk.Cone(np.linspace(0.7, 1.8, n), np.linspace(0.2, 3.0, n), "wrapped"),
}


def angles(n, seed=0):
    """Headings with several turns among them."""
    return np.random.default_rng(seed).uniform(-9.0, 9.0, n)


def scenario(graph, n=40, m=2, seed=1, t_end=0.5, **more):
    rng = np.random.default_rng(seed)
    q, p = rng.uniform(-2.5, 2.5, (n, m)), 0.5 * rng.normal(size=(n, m)) + 0.3
    agents = fk.PointMass(rng.uniform(0.5, 2.0, n), 0.1, angles(n))
    return fk.Scenario(fk.Law(graph, TERMS), fk.State(q, p), t_end=t_end, agents=agents, frames=6, **more)


@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize("m", [2, 3])
@pytest.mark.parametrize("name", CONES)
def test_forces_are_those_of_the_agents_within_the_cone(name, m, precision):
    n, tolerance = 300, {"float64": 1e-12, "float32": 2e-5}[precision]
    law, agents = fk.Law(CONES[name](n), TERMS), fk.PointMass(headings=angles(n))
    for state in ("random", "clustered", "straggler"):
        found, expected, scale = accelerations(law, states(n, m, seed=3)[state], agents=agents, precision=precision)
        wrong = (np.abs(found - expected) > tolerance * (1.0 + scale[:, None])).any(axis=1)
        assert wrong.sum() <= (0 if precision == "float64" else 2), np.flatnonzero(wrong)


@pytest.mark.parametrize("opening", [0.0, 0.4, 2.0])
def test_rotations_in_space_are_compared_by_their_traces(opening):
    n = 200
    turned = Rotation.random(n // 2, rng=np.random.default_rng(2)).as_matrix()
    agents = fk.PointMass(headings=np.concatenate([turned, turned]))
    law = fk.Law(fk.Cone(1.8, opening, "rotation"), TERMS)
    found, expected, scale = accelerations(law, states(n, 3, seed=5)["random"], agents=agents)
    assert np.abs(found - expected).max() <= 1e-12 * (1.0 + scale.max())


@pytest.mark.parametrize("measure", ["real", "wrapped", "rotation"])
@pytest.mark.parametrize("step", [np.pi / 6, np.pi / 2, 0.1])
def test_headings_whose_gap_is_the_opening_are_compared_as_the_definition_rounds(measure, step):
    n, headings = 240, step * (np.arange(240) % 12)
    gap = 1.0 - np.cos(step) if measure == "rotation" else step
    for opening in (gap, np.nextafter(gap, 0.0), 2.0 * gap):
        graph = fk.Cone(1.8, opening, measure)
        made = states(n, 2, seed=7)["random"]
        found, expected, scale = accelerations(fk.Law(graph, TERMS), made, agents=fk.PointMass(headings=headings))
        assert np.abs(found - expected).max() <= 1e-12 * (1.0 + scale.max())


@pytest.mark.parametrize("size", [1e3, 1e7, 1e15])
def test_headings_of_very_many_turns_are_compared_as_the_definition_rounds(size):
    n = 200
    graph = fk.Cone(1.8, 1.0, "wrapped")
    agents = fk.PointMass(headings=size * angles(n))
    found, expected, scale = accelerations(fk.Law(graph, TERMS), states(n, 2, seed=8)["random"], agents=agents)
    assert np.abs(found - expected).max() <= 1e-12 * (1.0 + scale.max())


@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize("radius", [1.5, np.array([1.5, 1.5])])
def test_agents_at_the_radius_are_neighbours(radius, precision):
    state = fk.State([[0.0, 0.0], [1.5, 0.0]], [[0.0, 0.0], [1.0, 0.0]])
    law = fk.Law(fk.Cone(radius, 1.0), (fk.Consensus(1.0),))
    found, expected, _ = accelerations(law, state, agents=fk.PointMass(headings=[0.0, 1.0]), precision=precision)
    np.testing.assert_array_equal(expected, [[1.0, 0.0], [-1.0, 0.0]])
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("ledger", [True, False])
@pytest.mark.parametrize("name", ["wrapped", "each"])
def test_links_of_frames_are_those_of_the_graph_there(name, ledger):
    made = scenario(CONES[name](40))
    run = fk.simulate(made, engine="tiles", step=0.01, ledger=ledger, progress=False)
    for q, p, t, links in zip(run.q, run.p, run.t, run.links, strict=True):
        expected = links_at_state(made.law.graph, made.space, fk.State(q, p, t), made.agents.headings)
        assert (links == expected).all()
    assert (run.links[0] != run.links[-1]).any()


@pytest.mark.parametrize("name", ["real", "wrapped", "rotation"])
def test_motion_and_ledger_tend_to_those_of_the_exact_engine(name):
    made = scenario(CONES[name](40), t_end=0.6)
    exact = fk.simulate(made, engine="exact", progress=False)
    assert len(exact.switches) > 3
    coarse, fine = (deviations(made, exact, step) for step in (8e-3, 1e-3))
    assert coarse.max() < 0.03
    assert fine.max() < 0.005
    assert fine.sum() < 0.35 * coarse.sum(), (coarse, fine)


LOST = fk.Messages(0.05, delay=0.02, loss=fk.Bernoulli(0.3), expires=0.3, seed=3)


@pytest.mark.parametrize("information", [None, LOST])
def test_motions_under_held_control_are_those_of_the_other_engine(information):
    more = {} if information is None else {"information": information}
    made = scenario(CONES["each"](30), n=30, control=fk.Held(0.05), **more)
    tiles = fk.simulate(made, engine="tiles", step=0.005, progress=False)
    other = fk.simulate(made, engine="sampled", progress=False)
    assert np.abs(tiles.q - other.q).max() < 1e-9
    assert np.abs(tiles.p - other.p).max() < 1e-9
    assert (tiles.links == other.links).all()
    apart = fk.simulate(made.with_(law=fk.Law(fk.Proximity(1.8), TERMS)), engine="tiles", step=0.005, progress=False)
    assert np.abs(apart.q - tiles.q).max() > 1e-3


def test_links_and_flocks_are_counted_as_the_link_matrix_states():
    made = scenario(fk.Cone(np.linspace(0.5, 1.0, 60), 1.0, "wrapped"), n=60)
    run = fk.simulate(made, engine="tiles", step=0.01, observe=True, progress=False)
    for row, links in enumerate(run.links):
        graph = nx.from_numpy_array(links, create_using=nx.DiGraph)
        assert run.observables["flocks"][row] == nx.number_weakly_connected_components(graph) > 1
        assert run.observables["neighbours"][row] == links.sum() / len(links)


@pytest.mark.parametrize("ledger", [True, False])
def test_a_stored_session_goes_on_bit_for_bit(ledger, tmp_path):
    made = scenario(CONES["each"](200), n=200, t_end=0.6)
    whole = fk.simulate(made, engine="tiles", step=0.01, ledger=ledger, progress=False)
    session = fk.start(made, engine="tiles", step=0.01, ledger=ledger)
    session.advance(0.21)
    for threads in (1, 2):
        again = session.moment()()
        assert isinstance(again, TilesSession)
        again.advance(0.6)
        assert (again.run().q == whole.q).all(), threads


def test_another_law_takes_another_cone():
    made = scenario(CONES["wrapped"](40))
    session = fk.start(made, engine="tiles", step=0.01)
    session.advance(0.1)
    law = fk.Law(fk.Cone(1.9, 2.5, "wrapped"), TERMS)
    session.replace(law=law)
    state = session.state
    assert state.links is not None
    assert (state.links == law.graph.start_links(state.q, made.agents.headings)).all()


@pytest.mark.parametrize("keeps", ["everybody", "too few"])
def test_lists_of_wrong_neighbours_stop_the_run(monkeypatch, keeps):
    made = scenario(CONES["wrapped"](600), n=600)

    def wrong(self, lists, n, ids, workers):
        if keeps == "too few":
            for tile in range(len(lists.count)):
                lists.rows[lists.first[tile] : lists.first[tile] + lists.count[tile]] = 16 * tile + np.arange(16)

    monkeypatch.setattr(similar_headings.Openings, "keep", wrong)
    session = TilesSession(made, TilesOptions(step=0.005))
    with pytest.raises(LawNotObeyed, match="declared law"):
        session.advance(0.4)


def test_what_is_right_gives_no_alarm_where_gaps_are_the_opening():
    n = 400
    q = np.stack(np.meshgrid(np.arange(20.0), np.arange(20.0)), axis=-1).reshape(-1, 2)
    agents = fk.PointMass(headings=np.pi / 4 * (np.arange(n) % 8))
    law = fk.Law(fk.Cone(1.0, np.pi / 4, "wrapped"), TERMS)
    for precision in ("float64", "float32"):
        made = fk.Scenario(law, fk.State(q, np.zeros((n, 2))), t_end=0.1, agents=agents, frames=2)
        assert fk.simulate(made, engine="tiles", step=0.005, precision=precision, progress=False).finished


def test_large_groups_with_cones_are_run_by_the_tiles():
    n = 2500
    start = fk.start.box(n, side=60.0, speed=0.5, seed=1)
    law = fk.Law(fk.Cone(2.0, 1.0, "wrapped"), TERMS)
    session = fk.start(fk.Scenario(law, start, t_end=1.0, agents=fk.PointMass(headings=angles(n))))
    assert isinstance(session, TilesSession)


@pytest.mark.parametrize(
    ("headings", "measure", "rule"),
    [
        (np.tile(np.eye(3), (2500, 1, 1)), "wrapped", "must be 'rotation' for rotation matrices"),
        (np.tile(2.0 * np.eye(3), (2500, 1, 1)), "rotation", "must be rotation matrices"),
        (None, "wrapped", "must be given for each of the 2500 agents"),
    ],
)
def test_headings_of_large_groups_that_cannot_be_compared_are_refused(headings, measure, rule):
    start = fk.start.box(2500, side=60.0, speed=0.5, seed=1, dimension=3)
    with pytest.raises(InvalidInput, match=rule):
        fk.start(
            fk.Scenario(
                fk.Law(fk.Cone(2.0, 1.0, measure), TERMS), start, t_end=1.0, agents=fk.PointMass(headings=headings)
            ),
            engine="tiles",
        )


@dataclass(frozen=True, eq=False)
class Halves(fk.Cone):
    """A cone of a user: agents of even numbers and those of odd ones are not linked."""

    def allowed(self, headings):
        number = np.arange(len(headings)) % 2
        return super().allowed(headings) & (number[:, None] == number[None, :])


def test_cones_of_users_that_link_others_are_refused_by_name():
    with pytest.raises(UnsupportedLaw, match="the graph Halves"):
        fk.start(scenario(Halves(1.6, 1.2), n=20), engine="tiles")


def test_links_of_a_start_that_contradict_the_cone_are_refused():
    made = scenario(CONES["wrapped"](40))
    links = made.law.graph.start_links(made.start.q, made.agents.headings)
    given = fk.State(made.start.q, made.start.p, links=links)
    assert fk.start(made.with_(start=given), engine="tiles").state.links.sum() == links.sum()
    for wrong in (links, ~links & ~np.eye(len(links), dtype=bool)):
        (i, j), given = np.argwhere(wrong)[0], links.copy()
        given[i, j] ^= True
        given[j, i] = given[i, j]
        with pytest.raises(UnsupportedLaw, match=f"differ from it for agents {i} and {j}"):
            fk.start(made.with_(start=fk.State(made.start.q, made.start.p, links=given)), engine="tiles")
