"""The left eigenvector of Shi's Remark 3, alone and in a law."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.errors import InvalidInput
from flocking.model.graphs.functionals import is_strongly_connected, left_eigenvector
from flocking.study.nets.matrices import laplacian


def random_weights(n: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    weights = rng.uniform(0.1, 3.0, (n, n)) * (rng.random((n, n)) < 0.4)
    ring = np.roll(np.eye(n), 1, axis=1)
    weights = weights + ring
    np.fill_diagonal(weights, 0.0)
    return weights


@pytest.mark.parametrize("seed", range(5))
def test_left_eigenvector(seed: int) -> None:
    weights = random_weights(9, seed)
    xi = left_eigenvector(weights)
    assert (xi > 0).all()
    assert xi.sum() == pytest.approx(1.0, rel=1e-14)
    np.testing.assert_allclose(xi @ laplacian(weights), 0.0, atol=1e-13)


def test_keeps_relative_accuracy_over_many_magnitudes() -> None:
    """A chain with rates e forwards and 1 back has xi_k proportional to e^-k."""
    n, rate = 8, 1e-6
    weights = np.diag(np.ones(n - 1), 1) * rate + np.diag(np.ones(n - 1), -1)
    expected = rate ** np.arange(n)
    np.testing.assert_allclose(left_eigenvector(weights) / expected * expected.sum(), 1.0, rtol=1e-12)


def test_needs_strong_connection() -> None:
    one_way = np.array([[0.0, 1.0], [0.0, 0.0]])
    assert not is_strongly_connected(one_way > 0)
    with pytest.raises(InvalidInput, match="strongly"):
        left_eigenvector(one_way)
    assert left_eigenvector(np.zeros((1, 1))) == 1.0


def law_of(weights: np.ndarray) -> fk.Law:
    edges = [(int(i), int(j)) for i, j in np.argwhere(weights > 0)]
    return fk.Law(fk.Fixed(len(weights), edges, directed=True), [fk.Consensus(1.5, weights=weights, functional=True)])


def test_coefficient_is_xi_i_w_ij() -> None:
    weights = random_weights(6, 3)
    rng = np.random.default_rng(0)
    state = fk.State(rng.normal(size=(6, 2)), rng.normal(size=(6, 2)))
    xi = left_eigenvector(weights)
    expected = -1.5 * xi[:, None] * (laplacian(weights) @ state.p)
    np.testing.assert_allclose(fk.control(law_of(weights), state), expected, atol=1e-13)
    assert "graph functional" in law_of(weights).beyond_neighbours


def test_symmetrised_laplacian_makes_the_energy_fall_and_the_momentum_stay() -> None:
    """With xi_i in front, Lambda L is balanced: the mean velocity is kept and the ledger closes."""
    weights = random_weights(6, 4)
    rng = np.random.default_rng(1)
    state = fk.State(rng.normal(size=(6, 2)), rng.normal(size=(6, 2)))
    run = fk.simulate(fk.Scenario(law_of(weights), state, 20.0), progress=False)
    np.testing.assert_allclose(run.p[-1].mean(axis=0), state.p.mean(axis=0), atol=1e-8)
    assert (np.diff(run.trace["energy"]) < 1e-9).all()
    assert np.abs(run.residual).max() < 1e-7
    without = fk.Law(law_of(weights).graph, [fk.Consensus(1.5, weights=weights)])
    other = fk.simulate(fk.Scenario(without, state, 20.0), progress=False)
    assert np.abs(other.p[-1].mean(axis=0) - state.p.mean(axis=0)).max() > 1e-2


def test_follows_the_links_of_a_moving_net() -> None:
    """Recomputed at every switch: the compiled control equals the reference's, which computes xi anew."""
    rng = np.random.default_rng(2)
    radii = rng.uniform(3.0, 4.5, 7)
    law = fk.Law(fk.PerAgentRadii(radii), [fk.Consensus(0.2, functional=True)])
    state = fk.State(rng.uniform(0, 3, (7, 2)), rng.normal(size=(7, 2)))
    h = 1e-5
    frames = [1.0 - h, 1.0, 1.0 + h]
    run = fk.simulate(fk.Scenario(law, state, 1.0 + h, frames=frames, tolerance=1e-12), progress=False)
    assert len(run.switches) >= 2
    u = (run.p[2] - run.p[0]) / (2 * h)
    np.testing.assert_allclose(u, fk.control(law, run.state(1)), atol=1e-7)
    stale = fk.control(law, fk.State(run.q[1], run.p[1], 1.0, law.graph.initial(state.q)))
    assert np.abs(u - stale).max() > 1e-4


def test_a_run_that_loses_strong_connection_says_so_and_keeps_its_frames() -> None:
    law = fk.Law(fk.PerAgentRadii([2.0, 3.0]), [fk.Consensus(1e-6, functional=True)])
    state = fk.State([[0.0], [1.0]], [[0.0], [1.0]])
    with pytest.raises(fk.SimulationError, match="strongly") as caught:
        fk.simulate(fk.Scenario(law, state, 4.0, frames=9), progress=False)
    assert caught.value.time == pytest.approx(1.0, rel=1e-5)
    assert len(caught.value.run.t) >= 2


def test_weighted_links_are_refused() -> None:
    law = fk.Law(fk.Smooth(3.0, 0.5), [fk.Consensus(weighted=True, functional=True)])
    with pytest.raises(InvalidInput, match="weighted"):
        fk.control(law, fk.State(np.zeros((2, 2))))
