from __future__ import annotations

import networkx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import flocking as fk
from flocking.errors import InvalidInput
from flocking.model.graphs import connectivity
from flocking.model.graphs.connectivity import components, is_connected, linked_pairs
from flocking.model.graphs.distance_graphs import pair_distances


def line(*x):
    return np.array(x, dtype=float)[:, None]


def test_fixed_links_do_not_depend_on_positions():
    graph = fk.Fixed(3, [(0, 1), (1, 2), (2, 1)])
    links = graph.initial(line(0, 100, 1e6))
    assert np.argwhere(links).tolist() == [[0, 1], [1, 0], [1, 2], [2, 1]]
    assert graph.update(line(0, 0, 0), links) is links
    one_way = fk.Fixed(3, [(0, 1)], directed=True)
    assert np.argwhere(one_way.initial(line(0, 1, 2))).tolist() == [[0, 1]]


def test_proximity_is_open_unless_closed():
    q = line(0, 1, 2.5)
    assert not fk.Proximity(1.0).initial(q).any()
    assert fk.Proximity(1.0, closed=True).initial(q)[0, 1]
    links = fk.Proximity(2.0).initial(q)
    assert np.argwhere(links).tolist() == [[0, 1], [1, 0], [1, 2], [2, 1]]


def test_hysteresis_remembers():
    graph = fk.Hysteresis(radius=2, gap=0.5)
    near, between, far = line(0, 1.4), line(0, 1.7), line(0, 2.1)
    assert graph.initial(between)[0, 1]
    linked, loose = graph.initial(near), graph.initial(far)
    assert linked[0, 1]
    assert not loose[0, 1]
    assert graph.update(between, linked)[0, 1]
    assert not graph.update(between, loose)[0, 1]
    assert graph.update(near, loose)[0, 1]
    assert not graph.update(far, linked)[0, 1]


@given(st.integers(1, 12), st.integers(0, 10**6), st.floats(0.2, 3), st.sampled_from([1, 2, 3]))
def test_without_a_gap_memory_is_nothing(n, seed, radius, m):
    rng = np.random.default_rng(seed)
    q, before = rng.normal(size=(n, m)), rng.normal(size=(n, m))
    graph = fk.Hysteresis(radius, 0.0)
    memory = graph.initial(before)
    links = graph.update(q, memory)
    assert (links == fk.Proximity(radius).initial(q)).all()
    assert (links == links.T).all()
    assert not links.diagonal().any()


@given(st.integers(1, 12), st.integers(0, 10**6), st.floats(0.02, 0.6))
def test_components_agree_with_networkx(n, seed, chance):
    links = np.random.default_rng(seed).random((n, n)) < chance
    np.fill_diagonal(links, False)
    graph = networkx.from_numpy_array(links, create_using=networkx.DiGraph)
    groups = list(networkx.weakly_connected_components(graph))
    labels = components(links)
    assert len(set(labels.tolist())) == len(groups)
    assert all(len({labels[k] for k in group}) == 1 for group in groups)
    assert is_connected(links) is (len(groups) == 1)


@pytest.mark.parametrize("n", [1, 2, 8, 9, 63, 64, 65, 130])
def test_a_chain_is_connected_until_a_link_is_left_out(n):
    order = np.random.default_rng(n).permutation(n)
    links = np.zeros((n, n), dtype=bool)
    links[order[:-1], order[1:]] = True
    assert is_connected(links)
    for k in {0, n // 2, n - 2} & set(range(n - 1)):
        broken = links.copy()
        broken[order[k], order[k + 1]] = False
        assert not is_connected(broken)


def test_distances_are_infinite_to_oneself():
    d = pair_distances(np.array([[0.0, 0], [3, 4]]))
    assert np.isinf(d.diagonal()).all()
    assert d[0, 1] == d[1, 0] == 5


def test_networkx_round_trip():
    graph = fk.Fixed.from_networkx(networkx.path_graph(4))
    assert graph.edges == ((0, 1), (1, 2), (2, 3))
    assert fk.Fixed.from_networkx(networkx.DiGraph([("a", "b")])).directed
    assert len(fk.Fixed.complete(5).edges) == 10
    assert fk.Fixed.complete(1).edges == ()


def test_weights_of_a_networkx_graph_are_not_dropped_without_a_word():
    graph = networkx.Graph([(0, 1)])
    graph.add_edge(1, 2, weight=2.0)
    with pytest.raises(InvalidInput, match="must have no weights other than 1"):
        fk.Fixed.from_networkx(graph)
    # Weights of 1 are links, and parallel edges one link.
    assert fk.Fixed.from_networkx(networkx.MultiGraph([(0, 1), (0, 1, {"weight": 1})])).edges == ((0, 1),)


def test_the_draws_of_a_large_graph_end(monkeypatch):
    monkeypatch.setattr(connectivity, "MOST_PAIRS", 90_000)
    with pytest.raises(InvalidInput, match="gave no connected graph in 100 draws"):
        fk.Fixed.random_connected(30, 1e-9, 1)


def test_a_pair_is_linked_with_probability_1():
    assert fk.Fixed.random_connected(6, 1.0, 0) == fk.Fixed.complete(6)


def test_random_connected_graphs_repeat_and_connect():
    first = fk.Fixed.random_connected(10, 0.3, seed=4)
    assert first == fk.Fixed.random_connected(10, 0.3, seed=4)
    assert first != fk.Fixed.random_connected(10, 0.3, seed=5)
    for seed in range(20):
        graph = fk.Fixed.random_connected(10, 0.3, seed)
        assert is_connected(graph.initial(np.zeros((10, 2))))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: fk.Proximity(-1), r"Proximity: radius must be greater than 0; got -1"),
        (lambda: fk.Proximity(0), "radius must be greater than 0"),
        (lambda: fk.Proximity(float("nan")), "radius must be finite"),
        (lambda: fk.Proximity("4"), "radius must be a number"),
        (lambda: fk.Proximity(None), "radius must be a number"),
        (lambda: fk.Hysteresis(-4, 0.1), "radius must be greater than 0"),
        (lambda: fk.Hysteresis(4, 4), "gap must be smaller than the radius, 4"),
        (lambda: fk.Hysteresis(4, 5), "gap must be smaller than the radius, 4"),
        (lambda: fk.Hysteresis(4, -0.1), "gap must be at least 0"),
        (lambda: fk.Fixed(3, [(0, 3)]), r"two different agents of 0..2; got \(0, 3\)"),
        (lambda: fk.Fixed(3, [(1, 1)]), "two different agents"),
        (lambda: fk.Fixed(3, [(-1, 1)]), "edges must be at least 0"),
        (lambda: fk.Fixed(3, [(0, 1, 2)]), "must be pairs"),
        (lambda: fk.Fixed(3, [5]), "must be pairs"),
        (lambda: fk.Fixed(3, [(0.5, 1)]), "edges must be an integer"),
        (lambda: fk.Fixed(0, []), "n must be at least 1"),
        (lambda: fk.Fixed(2.5, []), "n must be an integer"),
        (lambda: fk.Fixed.random_connected(5, 0.0, 1), "probability must be greater than 0"),
        (lambda: fk.Fixed.random_connected(5, 1.01, 1), "probability must be at most 1"),
        (lambda: fk.Fixed.random_connected(5, 30, 1), "probability must be at most 1"),
        (lambda: fk.Fixed.random_connected(10_001, 0.5, 1), "n must be at most 10000"),
        (lambda: fk.Fixed(3, []).initial(np.zeros((4, 2))), "must be the number of agents, 4"),
    ],
)
def test_bad_input_is_explained(make, words):
    with pytest.raises(InvalidInput, match=words):
        make()


@pytest.mark.parametrize("shape", [(1, 1), (6, 6), (6, 2), (2, 6), (6, 0)])
def test_linked_pairs_come_row_by_row(shape: tuple[int, int]) -> None:
    links = np.random.default_rng(1).random(shape) < 0.4
    for given_links in (links, np.asfortranarray(links), ~links):
        for found, expected in zip(linked_pairs(given_links), np.nonzero(given_links), strict=True):
            assert found.tolist() == expected.tolist()
            assert found.dtype == expected.dtype
