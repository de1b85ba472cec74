"""Agents at the same point, found without a matrix of all pairs."""

from __future__ import annotations

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import flocking as fk
from flocking.errors import InvalidInput
from flocking.model.graphs.coincident_starts import coincident_groups, linked_pair

N = 9


class Apart(fk.Proximity):
    """Links as its base, but never agents at the same point."""

    def initial(self, q):
        distance = np.linalg.norm(q[:, None] - q[None], axis=2)
        return super().initial(q) & (distance > 0)


def graphs(rng):
    edges = tuple((int(i), int(j)) for i, j in rng.integers(0, N, (4, 2)) if i != j)
    return [
        fk.Proximity(1.0), fk.Hysteresis(1.0, 0.2), fk.Smooth(1.0, 0.5), fk.PerAgentRadii(rng.uniform(0.5, 2, N)),
        fk.Fixed(N, edges), fk.Fixed(N, edges, directed=True), fk.FieldOfView(1.0, 0.3), fk.Cone(1.0, 0.3),
        fk.Cone(1.0, rng.uniform(0, 1, N)), fk.SmoothCone(1.0, 0.5, 0.3), fk.Cone(1.0, 0.3, "wrapped"), Apart(1.0),
    ]  # fmt: skip


@settings(max_examples=60)
@given(st.integers(0, 2**32))
def test_pairs_are_those_of_the_whole_matrix(seed):
    rng = np.random.default_rng(seed)
    q = rng.integers(0, 3, (N, 2)) * rng.choice([1.0, -1.0])
    headings = rng.uniform(-3, 3, N)
    groups = coincident_groups(q)
    same = (q[:, None] == q[None]).all(axis=2) & ~np.eye(N, dtype=bool)
    assert {(int(i), int(j)) for i, j in np.argwhere(same)} == {
        (int(i), int(j)) for g in groups for i in g for j in g if i != j
    }
    for graph in graphs(rng):
        links = graph.start_links(q, headings)
        both = same & (links | links.T)
        pair = linked_pair(graph, groups, q, headings)
        assert (pair is not None) == both.any(), graph
        assert pair is None or both[pair], graph


@pytest.mark.parametrize("seed", [0])
def test_a_million_agents_are_checked_in_no_time(seed):
    n = 10**6
    rng = np.random.default_rng(seed)
    q = rng.uniform(0, 1000, (n, 2))
    i, j = sorted(int(k) for k in rng.choice(n, 2, replace=False))
    law = fk.Law(fk.Proximity(1.0), [fk.Gradient(fk.Potential("1/r"))])
    free = fk.State(q)
    begin = time.process_time()
    fk.Scenario(law, free, 1.0)
    once = time.process_time() - begin
    q[i] = q[j]
    state = fk.State(q)
    begin = time.process_time()
    with pytest.raises(InvalidInput, match=f"agents {i} and {j} at the same point"):
        fk.Scenario(law, state, 1.0)
    assert time.process_time() - begin < 2 * once + 5.0
    chain = fk.Law(fk.Fixed(n, tuple((k, k + 1) for k in range(10))), [fk.Gradient(fk.Potential("1/r"))])
    fk.Scenario(chain, state, 1.0)


def test_everybody_at_one_point_is_told_at_once():
    law = fk.Law(fk.Proximity(1.0), [fk.Gradient(fk.Potential("1/r"))])
    with pytest.raises(InvalidInput, match="at the same point"):
        fk.Scenario(law, fk.State(np.zeros((200_000, 2))), 1.0)
