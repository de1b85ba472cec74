"""Cones whose links fade, in the tiled engine: factors of headings are listed beside the neighbours."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import flocking as fk
from flocking.engine.tiles.neighbours.listed_factors import ListedFactors
from flocking.engine.tiles.session import TilesOptions, TilesSession
from flocking.errors import InvalidInput, LawNotObeyed, TooCrowded, UnsupportedLaw
from flocking.model.graphs.seen_headings import links_at_state
from tests.engine.tiles.laws import accelerations, deviations, states
from tests.engine.tiles.neighbours.test_cones import LOST, angles, scenario

TERMS = (fk.Gradient(fk.Potential("k*(r - 1)**2/2", k=0.3)), fk.Consensus(0.4, weighted=True))
CUBIC = fk.Bump("cubic", "where(z <= k0, 1, where(z < 1, ((1 - z)/(1 - k0))**2*(3 - 2*(1 - z)/(1 - k0)), 0))")
CONES = {
    "real": fk.SmoothCone(1.6, 0.3, 1.3, "cosine", "real"),
    "wrapped": fk.SmoothCone(1.6, 0.2, 1.3, "quintic", "wrapped"),
    "all around": fk.SmoothCone(1.6, 0.4, 4.0, "infinite", "wrapped"),
    "rotation": fk.SmoothCone(1.6, 0.3, 0.8, CUBIC, "rotation"),
}
ROUNDING = {"float64": 1e-12, "float32": 2e-5}


def faded(graph, n=40, terms=TERMS, **more):
    return scenario(graph, n=n, **more).with_(law=fk.Law(graph, terms))


@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize("m", [2, 3])
@pytest.mark.parametrize("name", CONES)
def test_forces_have_the_factors_of_headings(name, m, precision):
    n = 300
    law, agents = fk.Law(CONES[name], TERMS), fk.PointMass(headings=angles(n))
    for state in ("random", "clustered", "straggler"):
        found, expected, scale = accelerations(law, states(n, m, seed=3)[state], agents=agents, precision=precision)
        assert np.abs(found - expected).max() <= ROUNDING[precision] * (1.0 + scale.max())
        apart = fk.Law(fk.Smooth(1.6, CONES[name].onset, CONES[name].bump), TERMS)
        everybody = accelerations(apart, states(n, m, seed=3)[state], agents=agents, precision=precision)[0]
        assert np.abs(found - everybody).max() > 0.1


def test_the_factor_of_two_agents_is_that_of_the_formula():
    """rho(|gap|/phi_0) of a cosine, by hand: (1 + cos(pi (z - k0)/(1 - k0)))/2."""
    gaps = np.array([0.1, 0.5, 0.9, 1.19, 1.2, 2.0])
    z = gaps / 1.2
    rho = np.where(z <= 0.25, 1.0, np.where(z < 1.0, 0.5 * (1.0 + np.cos(np.pi * (z - 0.25) / 0.75)), 0.0))
    law = fk.Law(fk.SmoothCone(2.0, 0.25, 1.2, "cosine", "wrapped"), (fk.Consensus(1.0, weighted=True),))
    for gap, factor in zip(gaps, rho, strict=True):
        for turns in (0.0, 2.0 * np.pi, -40.0 * np.pi):
            state = fk.State([[0.0, 0.0], [0.4, 0.0]], [[0.0, 0.0], [1.0, 0.0]])
            agents = fk.PointMass(headings=[0.3, 0.3 + gap + turns])
            found = accelerations(law, state, agents=agents)[0]
            np.testing.assert_allclose(found, [[factor, 0.0], [-factor, 0.0]], rtol=0.0, atol=1e-13)


@pytest.mark.parametrize("opening", [0.4, 1.5, 2.5])
def test_rotations_in_space_are_compared_by_their_traces(opening):
    n = 200
    turned = Rotation.random(n // 2, rng=np.random.default_rng(2)).as_matrix()
    agents = fk.PointMass(headings=np.concatenate([turned, turned]))
    law = fk.Law(fk.SmoothCone(1.8, 0.3, opening, measure="rotation"), TERMS)
    found, expected, scale = accelerations(law, states(n, 3, seed=5)["random"], agents=agents)
    assert np.abs(found - expected).max() <= 1e-12 * (1.0 + scale.max())


@pytest.mark.parametrize("measure", ["real", "wrapped", "rotation"])
@pytest.mark.parametrize("size", [1.0, 1e3, 1e7, 1e15])
def test_headings_of_very_many_turns_are_compared_as_the_definition_rounds(size, measure):
    n = 200
    agents = fk.PointMass(headings=size * angles(n))
    law = fk.Law(fk.SmoothCone(1.8, 0.2, 1.0, measure=measure), TERMS)
    found, expected, scale = accelerations(law, states(n, 2, seed=8)["random"], agents=agents)
    assert np.abs(found - expected).max() <= 1e-12 * (1.0 + scale.max())


@pytest.mark.parametrize("name", CONES)
def test_links_of_frames_are_those_of_the_graph_there(name):
    made = faded(CONES[name])
    run = fk.simulate(made, engine="tiles", step=0.01, progress=False)
    for q, p, t, links in zip(run.q, run.p, run.t, run.links, strict=True):
        expected = links_at_state(made.law.graph, made.space, fk.State(q, p, t), made.agents.headings)
        assert (links == expected).all()
    assert (run.links[0] != run.links[-1]).any()


@pytest.mark.parametrize("weighting", ["energy", "force"])
@pytest.mark.parametrize("name", ["real", "wrapped", "rotation"])
def test_motion_and_ledger_tend_to_those_of_the_exact_engine(name, weighting):
    spring = fk.Gradient(fk.Potential("k*(r - 1)**2/2", k=0.3), weighting=weighting)
    made = faded(CONES[name], terms=(spring, fk.Consensus(0.4, weighted=True)), t_end=0.6)
    exact = fk.simulate(made, engine="exact", progress=False)
    assert len(exact.switches) > 3
    coarse, fine = (deviations(made, exact, step) for step in (8e-3, 1e-3))
    assert coarse.max() < 0.02
    assert fine.sum() < 0.2 * coarse.sum(), (coarse, fine)


@pytest.mark.parametrize("information", [None, LOST])
@pytest.mark.parametrize("name", ["wrapped", "rotation"])
def test_motions_under_held_control_are_those_of_the_other_engine(name, information):
    more = {} if information is None else {"information": information}
    made = faded(CONES[name], n=30, control=fk.Held(0.05), **more)
    tiles = fk.simulate(made, engine="tiles", step=0.005, progress=False)
    other = fk.simulate(made, engine="sampled", progress=False)
    assert np.abs(tiles.q - other.q).max() < 1e-9
    assert np.abs(tiles.p - other.p).max() < 1e-9
    assert (tiles.links == other.links).all()
    apart = fk.Law(fk.Smooth(1.6, CONES[name].onset, CONES[name].bump), TERMS)
    everybody = fk.simulate(made.with_(law=apart), engine="tiles", step=0.005, progress=False)
    assert np.abs(everybody.q - tiles.q).max() > 1e-3


@pytest.mark.parametrize("ledger", [True, False])
def test_another_session_goes_on_bit_for_bit(ledger):
    made = faded(CONES["wrapped"], n=200, t_end=0.6)
    whole = fk.simulate(made, engine="tiles", step=0.01, ledger=ledger, progress=False)
    session = fk.start(made, engine="tiles", step=0.01, ledger=ledger)
    session.advance(0.21)
    again = session.moment()()
    assert isinstance(again, TilesSession)
    again.advance(0.6)
    assert (again.run().q == whole.q).all()


def test_another_law_takes_another_cone():
    made = faded(CONES["wrapped"])
    session = fk.start(made, engine="tiles", step=0.01)
    session.advance(0.1)
    for graph in (fk.SmoothCone(1.6, 0.2, 2.8, "quintic", "wrapped"), fk.SmoothCone(1.9, 0.5, 0.7), fk.Proximity(1.5)):
        law = fk.Law(graph, TERMS)
        session.replace(law=law)
        expected = fk.evaluate(law, session.state, agents=made.agents)
        forces = expected.u - 0.1 * session.state.p
        np.testing.assert_allclose(session.accelerations() * made.agents.masses[:, None], forces, atol=1e-12)


@pytest.mark.parametrize("change", [0.9, 0.0])
def test_wrong_factors_stop_the_run(monkeypatch, change):
    made, found = faded(CONES["wrapped"], n=600), ListedFactors.of

    def wrong(self, *arguments):
        factors = found(self, *arguments)
        return np.where(np.isfinite(factors), change * factors, factors)

    monkeypatch.setattr(ListedFactors, "of", wrong)
    session = TilesSession(made, TilesOptions(step=0.005))
    with pytest.raises(LawNotObeyed, match="declared law"):
        session.advance(0.4)


def test_factors_follow_lists_that_are_built_anew():
    """Their memory is used again: what was found for the old entries must not be taken for the new ones."""
    made = faded(CONES["wrapped"], n=300, terms=TERMS[:1], t_end=3.0)
    masses = made.agents.masses[:, None]
    made = made.with_(agents=fk.PointMass(masses[:, 0], headings=made.agents.headings))
    session = TilesSession(made, TilesOptions(step=0.01, skin=0.05))
    for t in (0.5, 1.0, 1.5):
        session.advance(t)
        expected = fk.evaluate(made.law, session.state, agents=made.agents).u
        np.testing.assert_allclose(session.accelerations() * masses, expected, atol=1e-12)
    assert session._particles.search.rebuilds > 10


def test_large_groups_with_smooth_cones_are_run_by_the_tiles():
    n = 2500
    start = fk.start.box(n, side=60.0, speed=0.5, seed=1)
    made = fk.Scenario(fk.Law(fk.SmoothCone(2.0, 0.3, 1.0), TERMS), start, t_end=1.0)
    assert isinstance(fk.start(made.with_(agents=fk.PointMass(headings=angles(n)))), TilesSession)
    for headings, rule in (
        (None, "must be given for each of the 2500 agents"), (np.tile(2.0 * np.eye(2), (n, 1, 1)), "rotation")
    ):  # fmt: skip
        with pytest.raises(InvalidInput, match=rule):
            fk.start(made.with_(agents=fk.PointMass(headings=headings)), engine="tiles")


@dataclass(frozen=True, eq=False)
class Halves(fk.SmoothCone):
    """A cone of a user: agents of even numbers and those of odd ones are not linked."""

    def allowed(self, headings):
        number = np.arange(len(headings)) % 2
        return super().allowed(headings) & (number[:, None] == number[None, :])


def test_cones_of_users_that_link_others_are_refused_by_name():
    with pytest.raises(UnsupportedLaw, match="the graph Halves"):
        fk.start(faded(Halves(1.6, 0.3, 1.2), n=20), engine="tiles")


def test_links_of_a_start_that_contradict_the_cone_are_refused():
    made = faded(CONES["wrapped"])
    links = made.law.graph.start_links(made.start.q, made.agents.headings)
    given = fk.State(made.start.q, made.start.p, links=links)
    assert fk.start(made.with_(start=given), engine="tiles").state.links.sum() == links.sum()
    i, j = np.argwhere(links)[0]
    links[i, j] = links[j, i] = False
    with pytest.raises(UnsupportedLaw, match=f"differ from it for agents {i} and {j}"):
        fk.start(made.with_(start=fk.State(made.start.q, made.start.p, links=links)), engine="tiles")


def test_what_is_stored_beside_the_lists_counts_towards_their_memory():
    made = faded(fk.SmoothCone(1.6, 0.3, 9.0), n=600)
    without = made.with_(law=fk.Law(fk.Smooth(1.6, 0.3), TERMS))
    lists = TilesSession(without, TilesOptions(step=0.01, skin=0.3))._particles.lists[0]
    limit = 2.0 * lists.nbytes  # An entry has 4 bytes, and its factor 8.
    assert TilesSession(without, TilesOptions(step=0.01, skin=0.3, memory_limit=limit)).time == 0.0
    with pytest.raises(TooCrowded, match="memory_limit"):
        TilesSession(made, TilesOptions(step=0.01, skin=0.3, memory_limit=limit)).advance(0.01)
