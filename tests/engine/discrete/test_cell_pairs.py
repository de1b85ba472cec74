"""Pairs from the cell list are those of the comparison of all pairs, with the same distances to the last bit."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import flocking as fk
from flocking.engine.discrete.cell_pairs import CellPairs
from flocking.model.graphs.distance_graphs import pair_distances


@settings(max_examples=150, deadline=None)
@given(
    st.integers(0, 10**9), st.integers(1, 90), st.integers(1, 3), st.sampled_from(["open", "all", "first"]),
    st.sampled_from([1.0, 5.0, 1e3, 1e9]), st.booleans(),
)  # fmt: skip
def test_pairs_are_those_of_brute_force(seed, n, m, kind, spread, on_a_grid):
    rng = np.random.default_rng(seed)
    side = float(rng.uniform(1, 12))
    lengths = [side if kind == "all" or k == 0 else None for k in range(m)]
    space = fk.Open() if kind == "open" else fk.Periodic(lengths)
    reach = float(rng.uniform(0.05, 0.499)) * side
    q = (rng.random((n, m)) - 0.3) * side * spread
    if on_a_grid:
        q = np.round(q * 4) / 4
    search, distance = CellPairs(space, reach, n), pair_distances(q, space)
    expected = np.nonzero(distance <= reach)
    for _ in range(2):
        i, j, r = search.near(q)
        order = np.lexsort((j, i))
        assert np.array_equal(i[order], expected[0])
        assert np.array_equal(j[order], expected[1])
        assert np.array_equal(r[order], distance[expected])
        assert (np.diff(j)[np.diff(i) == 0] > 0).all()


@pytest.mark.parametrize("n", [1, 700])
def test_agents_at_one_point_and_few_cells(n):
    """All pairs are near each other: more than the first guess of their number."""
    i, j, r = CellPairs(fk.Open(), 1.0, n).near(np.zeros((n, 2)))
    assert len(i) == n * (n - 1)
    assert not r.any()
    assert (i != j).all()


def test_a_thin_group_has_no_more_cells_than_memory_allows():
    q = np.zeros((5, 2))
    q[:, 0] = [0.0, 0.4, 1e9, 1e9 + 0.4, 3.0]
    i, j, _ = CellPairs(fk.Open(), 0.5, 5).near(q)
    assert sorted(zip(i.tolist(), j.tolist(), strict=True)) == [(0, 1), (1, 0), (2, 3), (3, 2)]
