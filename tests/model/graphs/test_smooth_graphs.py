"""Smooth graphs and graphs with one radius per agent."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.errors import InvalidInput
from flocking.model.potentials.bumps import BUMPS
from flocking.study.nets.matrices import adjacency, in_degree, is_balanced, out_degree


@pytest.mark.parametrize("bump", BUMPS)
def test_weight_is_the_bump_of_the_distance(bump: str) -> None:
    graph = fk.Smooth(8.4, 5 / 6, bump)
    r = np.array([3.0, 7.0, 7.2, 8.0, 8.39, 8.4, 9.0])
    q = np.concatenate([[[0.0, 0.0]], np.stack([r, np.zeros(7)], axis=1)])
    weights = adjacency(graph, q)
    expected = BUMPS[bump](r / 8.4, 5 / 6)
    np.testing.assert_allclose(weights[0, 1:], expected, rtol=1e-12, atol=1e-15)
    np.testing.assert_array_equal(weights, weights.T)
    assert not weights.diagonal().any()
    assert weights[0, 6] == 0
    assert weights[0, 1] == 1


def test_smooth_law_is_the_gradient_of_its_energy() -> None:
    """(35): the force is minus the gradient of V = sum a_ij psi, also where the weight falls."""
    rng = np.random.default_rng(3)
    q = rng.uniform(0, 12, (8, 2))
    law = fk.Law(fk.Smooth(8.4, 0.4), [fk.Gradient(fk.structural_potential(7.0))])
    found = fk.evaluate(law, fk.State(q))
    h = 1e-6
    gradient = np.zeros_like(q)
    for k in np.ndindex(*q.shape):
        shift = np.zeros_like(q)
        shift[k] = h
        low, high = (fk.evaluate(law, fk.State(q + s * shift)).storage for s in (-1, 1))
        gradient[k] = (high - low) / (2 * h)
    np.testing.assert_allclose(found.u, -gradient, atol=1e-6)


def test_forms_34_and_36_against_a_plain_loop() -> None:
    rng = np.random.default_rng(4)
    q, p = rng.uniform(0, 14, (9, 2)), rng.normal(size=(9, 2))
    psi, a, b, d, radius, k0, c1 = fk.structural_potential(7.0), 1.0, 5.0, 7.0, 8.4, 0.5, 1.3
    c = (b - a) / (2 * np.sqrt(a * b))
    expected = np.zeros_like(q)
    for i in range(9):
        for j in range(9):
            r = np.linalg.norm(q[j] - q[i])
            if i != j and r < radius:
                z = r - d
                phi = (a + b) / 2 * (z + c) / np.sqrt(1 + (z + c) ** 2) + (a - b) / 2
                rho = 1.0 if r <= k0 * radius else (1 + np.cos(np.pi * (r / radius - k0) / (1 - k0))) / 2
                expected[i] += rho * phi * (q[j] - q[i]) / r + c1 * (p[j] - p[i])
    law = fk.Law(fk.Smooth(radius, k0), [fk.Gradient(psi, weighting="force"), fk.Consensus(c1)])
    np.testing.assert_allclose(fk.control(law, fk.State(q, p)), expected, rtol=1e-12, atol=1e-12)


def test_radii_per_agent_make_a_directed_net() -> None:
    graph = fk.PerAgentRadii([1.0, 3.0, 2.0])
    q = np.array([[0.0, 0.0], [2.0, 0.0], [4.0, 0.0]])
    links = graph.initial(q)
    np.testing.assert_array_equal(links, [[False, False, False], [True, False, True], [False, True, False]])
    assert not fk.PerAgentRadii([1.0, 3.0, 2.0], closed=False).initial(q)[2, 1]
    np.testing.assert_array_equal(out_degree(links), [0, 2, 1])
    np.testing.assert_array_equal(in_degree(links), [1, 1, 1])
    assert not is_balanced(links)
    assert graph.directed


def test_errors() -> None:
    with pytest.raises(InvalidInput, match="onset"):
        fk.Smooth(1.0, 1.0)
    with pytest.raises(InvalidInput, match="bump"):
        fk.Smooth(1.0, 0.5, "square")
    with pytest.raises(InvalidInput, match="agent 1"):
        fk.PerAgentRadii([1.0, 0.0])
    with pytest.raises(InvalidInput, match="3 agents"):
        fk.PerAgentRadii([1.0, 1.0]).initial(np.zeros((3, 2)))


def test_runs_keep_the_links_of_their_radii() -> None:
    rng = np.random.default_rng(5)
    graph = fk.PerAgentRadii(rng.uniform(1, 3, 8))
    state = fk.State(rng.uniform(0, 5, (8, 2)), rng.normal(size=(8, 2)))
    run = fk.simulate(fk.Scenario(fk.Law(graph, [fk.Consensus(0.4)]), state, 3.0, frames=101), progress=False)
    assert len(run.switches) > 5
    for k in range(101):
        np.testing.assert_array_equal(run.links[k], graph.initial(run.q[k]))
