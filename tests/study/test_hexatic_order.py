"""Hexatic order against lattices of known direction, sums over all pairs, and networkx."""

import networkx as nx
import numpy as np
import pytest

import flocking as fk
from flocking.errors import InvalidInput
from flocking.study.hexatic_order import hexatic, hexatic_map, largest_share, neighbour_pairs


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


def test_images_of_one_place_are_no_neighbours_where_space_repeats():
    """Whole lengths are added with a rounding, whose direction is none."""
    space, rng = fk.Periodic([4.7, 6.1]), np.random.default_rng(0)
    for _ in range(50):
        place = rng.uniform(0.0, 4.0, 2)
        q = np.array([place, place, place, place + [0.3, 0.4]]) + np.array(space.lengths) * rng.integers(-9, 9, (4, 2))
        order, count = hexatic(q, 1.0, space)
        assert count.tolist() == [1, 1, 1, 3]
        assert order == pytest.approx(np.full(4, ((3 + 4j) / 5) ** 6), abs=1e-12)


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


@pytest.mark.parametrize("lengths", [(10.0, 9.0), (10.0, None)], ids=["both", "one"])
def test_where_space_repeats_neighbours_are_nearest_images(lengths):
    """Sums over all images, written out; agents have left the box."""
    rng = np.random.default_rng(4)
    sides = np.array([10.0, 9.0])
    repeats = np.array([x is not None for x in lengths])
    q = rng.random((60, 2)) * sides
    moved = q + rng.integers(-2, 3, q.shape) * sides * repeats
    order, count = hexatic(moved, 2.0, fk.Periodic(lengths))
    shifts = [np.array([a, b]) * sides * repeats for a in (-1, 0, 1) for b in (-1, 0, 1)]
    images = np.unique(np.concatenate([q + x for x in shifts]).round(9), axis=0)
    net = nx.Graph()
    net.add_nodes_from(range(len(q)))
    for i in range(len(q)):
        offset = images - q[i]
        distance = np.linalg.norm(offset, axis=1)
        near = (distance < 2.0) & (distance > 1e-6)
        z = (offset[near, 0] + 1j * offset[near, 1]) / distance[near]
        assert count[i] == near.sum()
        assert order[i] == pytest.approx((z**6).mean() if near.any() else 0.0, abs=1e-6)
        for x in images[near]:
            rest = (x - q + sides / 2) % sides - sides / 2 if repeats.all() else np.stack(
                [(x - q)[:, 0] - 10.0 * np.rint((x - q)[:, 0] / 10.0), (x - q)[:, 1]], axis=1)  # fmt: skip
            net.add_edge(i, int(np.argmin(np.linalg.norm(rest, axis=1))))
    flocks = sorted(map(len, nx.connected_components(net)))
    assert largest_share(moved, 2.0, fk.Periodic(lengths)) == (len(flocks), flocks[-1] / 60)


def test_a_lattice_that_fills_a_box_is_perfect_everywhere():
    rows = np.arange(8)
    q = np.stack([np.add.outer(0.5 * (rows % 2), rows).ravel(), np.repeat(rows * np.sqrt(0.75), 8)], axis=1)
    order, count = hexatic(q + 100.0, 1.2, fk.Periodic([8.0, 8 * np.sqrt(0.75)]))
    assert (count == 6).all()
    assert order == pytest.approx(np.ones(64), abs=1e-9)


def test_a_reach_over_half_a_box_is_refused():
    with pytest.raises(InvalidInput, match="less than half of 4"):
        hexatic(np.zeros((2, 2)), 2.0, fk.Periodic([9.0, 4.0]))


def test_agents_at_one_place_have_no_direction_to_each_other():
    """They are no neighbours: their directions would be those of the first axis, whatever way space is turned."""
    q = np.array([[0.0, 0.0], [0.0, 0.0], [0.3, 0.4], [5.0, 5.0], [5.0, 5.0]])
    for space in (fk.Open(), fk.Periodic([20.0, 20.0])):
        order, count = hexatic(q, 1.0, space)
        assert count.tolist() == [1, 1, 2, 0, 0]
        assert order == pytest.approx([(0.6 + 0.8j) ** 6] * 3 + [0.0, 0.0])
    # They are linked, and count in a flock.
    assert largest_share(q, 1.0) == (2, 0.6)
    images = np.array([[0.0, 0.0], [20.0, 0.0]])
    assert hexatic(images, 1.0, fk.Periodic([20.0, 20.0]))[1].tolist() == [0, 0]


def test_pairs_at_the_reach_are_neighbours():
    q = np.array([[0.0, 0.0], [1.0, 0.0], [2.5, 0.0]])
    assert neighbour_pairs(q, 1.0).tolist() == [[0, 1]]
    assert len(neighbour_pairs(q, np.nextafter(1.0, 0.0))) == 0


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (lambda: hexatic([[0.0, 0.0], [np.nan, 1.0]], 1.0), "q must be finite"),
        (lambda: neighbour_pairs([[0.0, 0.0], [np.inf, 1.0]], 1.0), "q must be finite"),
        (lambda: neighbour_pairs(np.zeros(4), 1.0), "q must have 2 axes"),
        (lambda: neighbour_pairs(np.zeros((2, 2)), np.nan), "reach must be finite"),
        (lambda: neighbour_pairs(np.zeros((2, 2)), np.nan, fk.Periodic([3.0, 3.0])), "reach must be finite"),
        (lambda: largest_share(np.zeros((2, 2)), -1.0), "reach must be greater than 0"),
        (lambda: largest_share(np.zeros((0, 2)), 1.0), "q must hold at least 1 agent"),
        (lambda: neighbour_pairs(np.zeros((2, 2)), 1.0, fk.Periodic([9.0, 9.0, 9.0])), "lengths must be 2"),
    ],
)
def test_what_gives_no_neighbours_is_refused_in_a_sentence(function, words):
    with pytest.raises(InvalidInput, match=words):
        function()
