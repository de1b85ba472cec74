"""Matrices of nets, and the agreement protocol on them."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.errors import InvalidInput
from flocking.study.nets import matrices as nets
from flocking.study.nets.agreement import agree, agreement_law, nets_of


def random_net(n: int = 9, seed: int = 0, directed: bool = False) -> np.ndarray:
    rng = np.random.default_rng(seed)
    weights = rng.uniform(0.2, 2, (n, n)) * (rng.random((n, n)) < 0.5)
    np.fill_diagonal(weights, 0.0)
    return weights if directed else (weights + weights.T) / 2


def test_degrees_are_row_and_column_sums() -> None:
    """deg_in is the column sum: on a star that listens outwards the hub has in-degree 0."""
    star = np.zeros((4, 4), dtype=bool)
    star[0, 1:] = True
    np.testing.assert_array_equal(nets.out_degree(star), [3, 0, 0, 0])
    np.testing.assert_array_equal(nets.in_degree(star), [0, 1, 1, 1])
    assert not nets.is_balanced(star)
    np.testing.assert_array_equal(nets.degree_matrix(star), np.diag([3, 0, 0, 0]))


@pytest.mark.parametrize("directed", [False, True])
def test_balanced_means_zero_column_sums(directed: bool) -> None:
    """Proposition 1(ii)."""
    weights = random_net(directed=directed)
    L = nets.laplacian(weights)
    np.testing.assert_allclose(L.sum(axis=1), 0.0, atol=1e-12)
    assert nets.is_balanced(weights) == bool(np.allclose(L.sum(axis=0), 0.0))
    cycle = np.roll(np.eye(5), 1, axis=1)
    assert nets.is_balanced(cycle)


def test_laplacian_from_incidence() -> None:
    links = random_net() > 0
    B = nets.incidence(links)
    np.testing.assert_array_equal(B @ B.T, nets.laplacian(links))
    with pytest.raises(InvalidInput, match="undirected"):
        nets.incidence(np.array([[0, 1], [0, 0]]))


def test_algebraic_connectivity_of_known_nets() -> None:
    n = 7
    complete = np.ones((n, n)) - np.eye(n)
    path = np.diag(np.ones(n - 1), 1) + np.diag(np.ones(n - 1), -1)
    cycle = np.roll(np.eye(n), 1, axis=1) + np.roll(np.eye(n), -1, axis=1)
    assert nets.algebraic_connectivity(complete) == pytest.approx(n)
    assert nets.algebraic_connectivity(path) == pytest.approx(2 - 2 * np.cos(np.pi / n))
    assert nets.algebraic_connectivity(cycle) == pytest.approx(2 - 2 * np.cos(2 * np.pi / n))
    apart = np.zeros((4, 4))
    apart[0, 1] = apart[1, 0] = apart[2, 3] = apart[3, 2] = 1
    assert nets.algebraic_connectivity(apart) == pytest.approx(0.0, abs=1e-12)


def test_flocks_and_density() -> None:
    links = np.zeros((10, 10), dtype=bool)
    for i, j in [(0, 1), (1, 2), (2, 3), (3, 4), (4, 5), (5, 6), (6, 7), (7, 8)]:
        links[i, j] = True
    members = nets.flock_members(links)
    assert [list(m) for m in members] == [list(range(9)), [9]]
    assert nets.density(links) == 0.9
    assert nets.is_quasi_flock(links)
    assert not nets.is_quasi_flock(links, 0.95)
    assert not nets.is_quasi_flock(np.ones((3, 3), dtype=bool) ^ np.eye(3, dtype=bool))


def test_no_agent_senses_itself() -> None:
    with pytest.raises(InvalidInput, match="diagonal"):
        nets.laplacian(np.eye(2))


@pytest.mark.parametrize("directed", [False, True])
def test_agreement_on_one_net(directed: bool) -> None:
    """(12)-(13): to the mean on an undirected net, to xi^T theta on a strongly connected directed one."""
    n = 9
    links = random_net(n, directed=directed) > 0
    links |= np.roll(np.eye(n, dtype=bool), 1, axis=1)
    if not directed:
        links |= links.T
    theta = np.random.default_rng(5).normal(size=n)
    agents = fk.Agents(order=1)
    scenario = fk.Scenario(agreement_law(links), fk.State(theta[:, None]), 12.0, agents=agents, frames=5)
    run = fk.simulate(scenario, progress=False)
    exact = agree(theta, [links] * 4, run.t)
    np.testing.assert_allclose(run.q[:, :, 0], exact, atol=1e-7)
    limit = nets.agreement_limit(links, theta)
    np.testing.assert_allclose(run.q[-1, :, 0], limit, atol=1e-4)
    if directed:
        assert abs(limit - theta.mean()) > 1e-2
    else:
        assert limit == pytest.approx(theta.mean(), rel=1e-12)


def test_agreement_on_the_nets_of_a_run() -> None:
    """theta evolves while q gives the net: the mean stays, on the switching undirected nets of a moving group."""
    rng = np.random.default_rng(6)
    start = fk.State(rng.uniform(0, 4, (8, 2)), rng.normal(size=(8, 2)))
    graph = fk.Proximity(2.5)
    run = fk.simulate(fk.Scenario(fk.Law(graph, [fk.Consensus(0.3)]), start, 2.0, frames=201), progress=False)
    switching, times = nets_of(run)
    assert len(switching) >= 5
    for net, t0, t1 in zip(switching, times[:-1], times[1:], strict=True):
        for k in np.flatnonzero((run.t > t0) & (run.t < t1)):
            np.testing.assert_array_equal(run.links[k], net)
    theta = rng.normal(size=8)
    values = agree(theta, switching, times)
    np.testing.assert_allclose(values.mean(axis=1), theta.mean(), atol=1e-12)
    assert (np.diff(np.ptp(values, axis=1)) <= 1e-12).all()
    assert np.ptp(values[-1]) < 0.5 * np.ptp(theta)


@pytest.mark.parametrize("unit", [1e-200, 1e-13, 1.0, 1e13])
def test_balance_and_symmetry_do_not_depend_on_the_unit_of_weights(unit: float) -> None:
    one_way = unit * np.array([[0.0, 1.0], [0.0, 0.0]])
    assert not nets.is_balanced(one_way)
    with pytest.raises(InvalidInput, match="symmetric"):
        nets.algebraic_connectivity(one_way)
    both = unit * np.array([[0.0, 1.0], [1.0, 0.0]])
    assert nets.is_balanced(both)
    assert nets.algebraic_connectivity(both) == pytest.approx(2 * unit, rel=1e-12)
    rounded = both * [[1.0, 1.0 + 1e-15], [1.0, 1.0]]
    assert nets.algebraic_connectivity(rounded) == pytest.approx(2 * unit, rel=1e-12)
    slightly = both * [[1.0, 1.0 + 1e-9], [1.0, 1.0]]
    assert not nets.is_balanced(slightly)
    with pytest.raises(InvalidInput, match="symmetric"):
        nets.algebraic_connectivity(slightly)


def test_weights_that_are_no_numbers_are_neither_balanced_nor_symmetric() -> None:
    weights = np.array([[0.0, np.nan], [np.nan, 0.0]])
    assert not nets.is_balanced(weights)
    with pytest.raises(InvalidInput, match="finite"):
        nets.algebraic_connectivity(weights)


def test_agreement_refuses_what_it_cannot_solve() -> None:
    net = np.array([[0.0, 1.0], [1.0, 0.0]])
    for theta, all_nets, times, words in (
        ([0.0, 1.0], [net], [0.0, np.nan], "times must be finite"),
        ([0.0, np.inf], [net], [0.0, 1.0], "theta must be finite"),
        ([0.0, 1.0, 2.0], [net], [0.0, 1.0], r"nets\[0\] must be a matrix of 3 agents"),
    ):
        with pytest.raises(InvalidInput, match=words):
            agree(theta, all_nets, times)


@pytest.mark.parametrize("directed", [False, True])
@pytest.mark.parametrize("lasted", [1e4, 1e8, 1e12, 1e100])
def test_long_agreement_stays_at_its_limit(directed: bool, lasted: float) -> None:
    """Squares of a matrix exponential double its error each time: after 1e14 the limit was off by 8 per cent."""
    weights = np.roll(np.eye(5), 1, axis=1) if directed else np.eye(5, k=1) + np.eye(5, k=-1)
    weights[2] *= 0.3 if directed else 1.0
    theta = np.array([1.0, 2.0, 3.0, 7.0, -4.0])
    limit = nets.agreement_limit(weights, theta)
    np.testing.assert_allclose(agree(theta, [weights], [0.0, lasted])[-1], limit, rtol=1e-13)
    np.testing.assert_allclose(agree(theta, [weights * lasted], [0.0, 1e4])[-1], limit, rtol=1e-13)


def test_agreement_with_weights_of_very_different_sizes() -> None:
    """Two pairs, each agreed at once, whose two means come together at the rate 1e-12: exp(-1e-12 t) is left."""
    weights = np.array([[0, 1.0, 0, 0], [1.0, 0, 1e-12, 0], [0, 1e-12, 0, 1.0], [0, 0, 1.0, 0]])
    found = agree([1.0, 1.0, -1.0, -1.0], [weights], [0.0, 1e12])[-1]
    np.testing.assert_allclose(found, np.exp(-1.0) * np.array([1.0, 1.0, -1.0, -1.0]), rtol=1e-10)


def test_agreement_far_from_zero_keeps_differences() -> None:
    both = np.array([[0.0, 1.0], [1.0, 0.0]])
    found = agree([1e9, 1e9 + 1.0], [both], [0.0, 0.5])[-1]
    assert found[1] - found[0] == pytest.approx(np.exp(-1.0), abs=3e-7)


def test_agreement_with_negative_weights_is_the_matrix_exponential() -> None:
    """x = theta_1 - theta_2 has x' = -(1 - 0.5) x."""
    found = agree([1.0, 0.0], [[[0.0, 1.0], [-0.5, 0.0]]], [0.0, 2.0])[-1]
    assert found[0] - found[1] == pytest.approx(np.exp(-1.0), rel=1e-13)


def test_agreement_refuses_times_and_weights_whose_product_is_no_number() -> None:
    with pytest.raises(InvalidInput, match="times"):
        agree([1.0, 0.0], [[[0.0, 1e300], [1e300, 0.0]]], [0.0, 1e300])
