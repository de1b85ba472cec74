from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import flocking as fk
from flocking.errors import InvalidInput
from flocking.model.graphs.weights import pair_uniform

PSI = fk.Potential("1/r + 1/(R - r)", R=4)
GRAPH = fk.Proximity(4)
START = fk.start.box(3, side=2, seed=1)
ONE_WAY = np.array([[0, 0, 1], [0, 0, 0], [0, 0, 0]], dtype=bool)


def law(*terms, graph=GRAPH):
    return fk.Law(graph, terms or (fk.Gradient(PSI), fk.Consensus()))


@given(st.integers(0, 2**40), st.integers(2, 60))
def test_hashed_weights_are_symmetric_repeatable_and_in_range(seed, n):
    weights = fk.HashedWeights(0.5, 2.0, seed).matrix(n)
    off = ~np.eye(n, dtype=bool)
    assert (weights == weights.T).all()
    assert (weights.diagonal() == 0).all()
    assert ((weights[off] >= 0.5) & (weights[off] < 2)).all()
    assert (weights == fk.HashedWeights(0.5, 2.0, seed).matrix(n + 7)[:n, :n]).all()


def test_hashed_weights_are_spread_evenly_and_depend_on_the_seed():
    i, j = np.triu_indices(300, 1)
    values = pair_uniform(5, i, j)
    counts, _ = np.histogram(values, bins=10, range=(0, 1))
    assert (abs(counts / len(values) - 0.1) < 0.01).all()
    other = pair_uniform(6, i, j)
    assert abs(np.corrcoef(values, other)[0, 1]) < 0.02
    assert abs(np.corrcoef(values[:-1], values[1:])[0, 1]) < 0.02


def test_a_law_lists_its_parts():
    other, leader = fk.Fixed.complete(3), fk.Sink([0, 0])
    made = law(fk.Gradient(PSI), fk.Consensus(over=other), fk.Track(leader, 1.0), fk.Track(leader, 0.0, 2.0))
    assert made.graphs == (GRAPH, other)
    assert made.leaders == (leader,)
    assert len(made.pair_terms) == len(made.body_terms) == 2
    assert made.distributed
    shared = law(fk.Track(leader, 1.0, shared=True))
    assert shared.beyond_neighbours == ("centre of mass",)
    assert law(fk.Consensus(functional=True)).beyond_neighbours == ("graph functional",)


def test_declared_symmetries():
    every = {"momentum", "rotation", "relabelling", "galilean", "locality"}
    assert law().symmetries == every
    assert law(fk.Consensus([1.0, 2.0, 3.0])).symmetries == every - {"momentum", "relabelling"}
    assert law(fk.Consensus(weights=fk.HashedWeights(0, 1, 2))).symmetries == every - {"relabelling"}
    assert "momentum" not in law(fk.Consensus(weights=[[0, 1, 1], [2, 0, 1], [1, 1, 0]])).symmetries
    assert law(fk.Track(fk.Sink([0, 0]))).symmetries == {"relabelling", "locality"}
    assert "momentum" not in law(graph=fk.Fixed(3, [(0, 1)], directed=True)).symmetries


def test_a_vector_is_read_as_a_leader_with_that_velocity():
    track = fk.Track([1.0, 2.0])
    assert isinstance(track.leader, fk.Velocity)
    assert track.leader.at(0.0)[1].tolist() == [1, 2]


TWO = fk.State([[0, 0], [0, 0.0]])


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: fk.Law("graph", [fk.Consensus()]), "graph must be a graph"),
        (lambda: fk.Law(GRAPH, []), "at least one term"),
        (lambda: fk.Law(GRAPH, [PSI]), "must be pair, body or steering terms"),
        (lambda: fk.Law(GRAPH, 3), "must be pair, body or steering terms"),
        (lambda: fk.Law(GRAPH, None), "must be pair, body or steering terms"),
        (lambda: fk.Gradient("1/r"), "must be a Potential"),
        (lambda: fk.Gradient(PSI, weighting="x"), "must be 'energy' or 'force'"),
        (lambda: fk.Gradient(PSI, over=4), "over must be a graph"),
        (lambda: fk.Consensus(-1), "gain must be at least 0"),
        (lambda: fk.Consensus(np.nan), "gain must be finite"),
        (lambda: fk.Consensus([1, -1]), "for agent 1"),
        (lambda: fk.Consensus(weights=[1, 2]), "weights must have 2 axes"),
        (lambda: fk.Consensus(weights=[[1, 2]]), "square matrix"),
        (lambda: fk.Consensus(weights=[[0, -2], [1, 0]]), "must not be negative"),
        (lambda: fk.Consensus(over="g"), "over must be a graph"),
        (lambda: fk.HashedWeights(1, 0, 0), "high must be at least 1"),
        (lambda: fk.HashedWeights(-1, 0, 0), "low must be at least 0"),
        (lambda: fk.HashedWeights(0, 1, 0.5), "seed must be an integer"),
        (lambda: fk.Track(fk.Sink([0, 0]), -1.0), "position_gain must be at least 0"),
        (lambda: fk.Track(fk.Sink([0, 0]), velocity_gain=np.inf), "velocity_gain must be finite"),
        (lambda: fk.Track("leader"), "array of numbers"),
        (lambda: fk.Energy("moon"), "frame must be one of"),
        (lambda: fk.Energy("leader"), "must be given exactly"),
        (lambda: fk.Energy("lab", leader=fk.Sink([0])), "must be given exactly"),
        (lambda: fk.Energy(unlinked=np.nan), "unlinked must be finite"),
        (lambda: fk.control(law(fk.Consensus([1.0, 2])), START), "one value for each of the 3 agents"),
        (lambda: fk.control(law(fk.Consensus(weights=np.zeros((2, 2)))), START), r"must have shape \(3, 3\)"),
        (lambda: fk.control(law(fk.Track(fk.Sink([0, 0, 0]))), START), "dimension must be that of the agents, 2"),
        (lambda: fk.control(law(graph=fk.Fixed(4, [])), START), "must be the number of agents, 3"),
        (lambda: fk.control(law(), START, agents=fk.Agents([1, 2])), "one value for each of the 3 agents"),
        (lambda: fk.Scenario("law", START, 1), "law must be a Law"),
        (lambda: fk.Scenario(law(), START.q, 1), "start must be a State"),
        (lambda: fk.Scenario(law(), START, -1), "t_end must be at least 0"),
        (lambda: fk.Scenario(law(), START, np.nan), "t_end must be finite"),
        (lambda: fk.Scenario(law(), START, 1, tolerance=0), "tolerance must be greater than 0"),
        (lambda: fk.Scenario(law(), START, 1, tolerance=1), "tolerance must be less than 0.1"),
        (lambda: fk.Scenario(law(), START, 1, frames=0), "frames must be at least 1"),
        (lambda: fk.Scenario(law(), START, 1, frames=2.5), "frames must be an integer"),
        (lambda: fk.Scenario(law(), START, 1, frames=[0.5, 0.2]), "ascending times"),
        (lambda: fk.Scenario(law(), START, 1, frames=[0.5, 2]), "between the start and t_end"),
        (lambda: fk.Scenario(law(), START, 1, frames=[]), "ascending times"),
        (lambda: fk.Scenario(law(), START, 1, agents="x"), "agents must be"),
        (lambda: fk.Scenario(law(), START, 1, energy="x"), "energy must be"),
        (lambda: fk.Scenario(law(), TWO, 1), r"agents 0 and 1 at the same point; got \[0.0, 0.0\]"),
        (lambda: fk.Scenario(law(fk.Gradient(PSI, over=fk.Fixed.complete(2)), graph=fk.Fixed(2, [])), TWO, 1),
         "agents 0 and 1 at the same point"),
        (lambda: fk.Scenario(law(), fk.State(START.q, START.p, links=ONE_WAY), 1),
         "links must be mutual under .*agent 0 senses agent 2, which does not sense it"),
        (lambda: fk.control(law(), START.q), "state must be a State"),
    ],
)  # fmt: skip
def test_bad_input_is_explained(make, words):
    with pytest.raises(InvalidInput, match=words):
        make()


def test_links_of_one_way_are_fine_under_a_directed_graph() -> None:
    start = fk.State(START.q, START.p, links=ONE_WAY)
    run = fk.simulate(
        fk.Scenario(law(fk.Consensus(), graph=fk.Fixed(3, [(0, 2)], directed=True)), start, 0.1), progress=False
    )
    assert (run.p[-1, 2] == START.p[2]).all()


def test_coincident_agents_are_fine_where_nothing_is_singular():
    calm = law(fk.Gradient(fk.Potential("(r - 1)^2")), fk.Consensus())
    assert fk.Scenario(calm, TWO, 1).start is TWO
    assert np.isfinite(fk.control(calm, TWO)).all()


def test_frames():
    scenario = fk.Scenario(law(), START, 2, frames=5)
    assert scenario.frame_times.tolist() == [0, 0.5, 1, 1.5, 2]
    assert scenario.with_(frames=1).frame_times.tolist() == [0]
    assert scenario.with_(frames=[0.25, 2]).frame_times.tolist() == [0.25, 2]


def test_an_error_names_owner_parameter_value_and_fix():
    with pytest.raises(InvalidInput) as caught:
        fk.Hysteresis(4, 9)
    error = caught.value
    assert (error.owner, error.parameter, error.value) == ("Hysteresis", "gap", 9)
    assert str(error).startswith("Hysteresis: gap must be smaller than the radius, 4; got 9. ")
    assert isinstance(error, ValueError | fk.FlockingError)


def test_an_earlier_end_keeps_the_frames_before_it() -> None:
    scenario = fk.Scenario(
        fk.Law(fk.Fixed(2, []), [fk.Consensus(1.0)]), fk.State([[0.0], [1.0]]), 4.0, frames=(0, 1, 3)
    )
    assert scenario.with_(t_end=2.0).frames == (0.0, 1.0, 2.0)
    assert scenario.with_(t_end=1.0).frames == (0.0, 1.0)
    assert scenario.with_(t_end=6.0).frames == (0.0, 1.0, 3.0)
    assert scenario.with_(t_end=2.0, frames=(0.5,)).frames == (0.5,)
    with pytest.raises(InvalidInput, match="t_end"):
        scenario.with_(t_end=-1.0)
