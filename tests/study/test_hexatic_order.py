"""Hexatic order against lattices of known direction, sums over all pairs, and networkx."""

import networkx as nx
import numpy as np
import pytest

import flocking as fk
from flocking.errors import InvalidInput
from flocking.study.hexatic_order import hexatic, hexatic_map, largest_share


def lattice(angle, n=400):
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return fk.start.hexagonal(n, spacing=7.0, seed=0).q @ turn.T


@pytest.mark.parametrize("angle", [0.0, 0.2, -0.4, np.pi / 3])
def test_a_lattice_says_its_direction(angle):
    q = lattice(angle)
    order, count = hexatic(q, 8.4)
    inner = np.linalg.norm(q, axis=1) < 50
    assert (count[inner] == 6).all()
    assert order[inner] == pytest.approx(np.full(inner.sum(), np.exp(6j * angle)), abs=1e-9)
    assert count[~inner].min() < 6


def test_against_the_sum_over_all_pairs():
    q = np.random.default_rng(3).random((80, 2)) * 10
    order, count = hexatic(q, 2.0)
    for i in range(len(q)):
        offset = np.delete(q - q[i], i, axis=0)
        near = offset[np.linalg.norm(offset, axis=1) < 2.0]
        z = (near[:, 0] + 1j * near[:, 1]) / np.linalg.norm(near, axis=1)
        assert count[i] == len(near)
        assert order[i] == pytest.approx((z**6).mean() if len(near) else 0.0, abs=1e-12)


def test_nobody_near_gives_no_order():
    order, count = hexatic(np.array([[0.0, 0.0], [9.0, 0.0]]), 1.0)
    assert order.tolist() == [0, 0]
    assert count.tolist() == [0, 0]


def test_a_map_means_over_cells_and_fills_gaps_from_the_nearest():
    q = np.array([[0.5, 0.5], [0.6, 0.5], [2.5, 0.5]])
    order = np.array([1.0, 1j, -1.0])
    made = hexatic_map(q, order, low=np.zeros(2), cell=1.0, shape=(1, 6), reach=1.2)
    assert made[0, 0] == pytest.approx((1 + 1j) / 2)
    assert made[0, 1] == 1j
    assert made[0, 2:4].tolist() == [-1, -1]
    assert made[0, 4:].tolist() == [0, 0]


def test_flocks_are_the_components_of_the_net():
    q = np.random.default_rng(1).random((200, 2)) * 20
    count, share = largest_share(q, 1.4)
    net = nx.Graph(fk.Proximity(1.4).initial(q))
    sizes = [len(c) for c in nx.connected_components(net)]
    assert count == len(sizes) > 3
    assert share == max(sizes) / 200


def test_space_is_refused():
    with pytest.raises(InvalidInput):
        hexatic(np.zeros((4, 3)), 1.0)
