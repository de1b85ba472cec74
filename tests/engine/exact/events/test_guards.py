"""The certified scans against brute force."""

from __future__ import annotations

from math import comb

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flocking.engine.adaptive_steps.segment import Segment, bound_excursions
from flocking.engine.exact.crossings.band_guards import find_fastest
from flocking.engine.exact.crossings.guards import crossings, deepest_dip, find_closest, squared_distance
from flocking.engine.exact.crossings.nearby_pairs import NearbyPairs, all_pairs
from flocking.engine.kernels.bernstein import NEVER, first_above, first_all_above, smallest_value


def reach(B):
    """How far each agent strays from its start."""
    far = np.zeros(B.shape[1])
    bound_excursions(B, far)
    return far


def closest(B, far, linked, best_linked, best_free):
    """Closest approaches, a row for linked pairs and one for the others."""
    found = np.empty((2, 4))
    find_closest(B, far, linked, all_pairs(B.shape[1]), best_linked, best_free, found)
    return found


GRID = np.linspace(0.0, 1.0, 4001)
coefficients = st.lists(st.floats(-1.0, 1.0), min_size=15, max_size=15).map(np.array)


def value(g: np.ndarray, x: np.ndarray | float) -> np.ndarray:
    d = len(g) - 1
    x = np.atleast_1d(x)
    return np.asarray(sum(g[k] * comb(d, k) * x**k * (1 - x) ** (d - k) for k in range(d + 1)))


def bernstein(powers: np.ndarray, degree: int = 14) -> np.ndarray:
    """Bernstein coefficients of a polynomial given in powers of x."""
    return np.array([
        sum(powers[i] * comb(k, i) / comb(degree, i) for i in range(min(k, len(powers) - 1) + 1))
        for k in range(degree + 1)
    ])  # fmt: skip


def random_segment(rng: np.random.Generator, n: int, m: int, wiggle: float) -> np.ndarray:
    start, end = rng.normal(size=(2, n, m)) * 3
    line = np.linspace(0, 1, 8)[:, None, None]
    return np.asarray(start + line * (end - start) + wiggle * rng.normal(size=(8, n, m)))


def paths(B: np.ndarray, x: np.ndarray) -> np.ndarray:
    k = np.arange(8)
    basis = np.array([comb(7, int(j)) for j in k]) * x[:, None] ** k * (1 - x[:, None]) ** (7 - k)
    return np.einsum("xk,kim->xim", basis, B)


@given(coefficients)
@settings(max_examples=150, deadline=None)
def test_first_rise_above_zero_is_never_missed_and_never_early(g: np.ndarray) -> None:
    x = first_above(g)
    sampled = value(g, GRID)
    before = sampled[x > GRID + 1e-12]
    assert (before <= 1e-13).all()
    if x == NEVER:
        assert (sampled <= 1e-13).all()
    elif x > 0:
        assert abs(value(g, x)[0]) < 1e-11
    else:
        assert g[0] >= -1e-15


@given(st.floats(0.05, 0.95), st.floats(1e-9, 1e-3))
@settings(max_examples=100, deadline=None)
def test_a_double_root_is_a_crossing_only_when_it_rises(root: float, height: float) -> None:
    parabola = -np.array([root**2, -2 * root, 1.0])
    lifted, lowered = parabola + [height, 0, 0], parabola - [height, 0, 0]
    assert first_above(bernstein(lifted)) == pytest.approx(
        max(root - np.sqrt(height), 0.0), abs=1e-11 / np.sqrt(height)
    )
    assert first_above(bernstein(lowered)) == NEVER


@given(coefficients)
@settings(max_examples=150, deadline=None)
def test_smallest_value_against_dense_sampling(g: np.ndarray) -> None:
    best, x = smallest_value(g, np.inf)
    sampled = value(g, GRID).min()
    assert best <= sampled + 1e-12
    assert value(g, x)[0] == pytest.approx(best, abs=1e-12)
    assert smallest_value(g, best - 1e-9) == (best - 1e-9, NEVER)


@given(st.integers(0, 10_000), st.sampled_from([1, 2, 3]))
@settings(max_examples=40, deadline=None)
def test_squared_distance_is_the_polynomial_of_the_pair(seed: int, m: int) -> None:
    B = random_segment(np.random.default_rng(seed), 2, m, 0.5)
    out = np.empty(15)
    squared_distance(B, 0, 1, out)
    q = paths(B, GRID[::100])
    exact = ((q[:, 1] - q[:, 0]) ** 2).sum(axis=1)
    np.testing.assert_allclose(value(out, GRID[::100]), exact, rtol=1e-12, atol=1e-12)


@given(st.integers(0, 10_000), st.sampled_from([1, 2, 3]), st.sampled_from([0.05, 1.0]), st.booleans())
@settings(max_examples=60, deadline=None)
def test_crossings_of_all_pairs_against_dense_sampling(seed: int, m: int, wiggle: float, directed: bool) -> None:
    rng = np.random.default_rng(seed)
    n = 6
    B = random_segment(rng, n, m, wiggle)
    enter = np.full(n, 2.0) if not directed else rng.uniform(1.0, 3.0, n)
    leave = enter + 0.2
    q = paths(B, GRID)
    distance = np.linalg.norm(q[:, None] - q[:, :, None], axis=-1)
    near = distance[0] < leave[:, None]
    everyone = np.ones((n, n), dtype=bool)
    when, who = crossings(B, reach(B), near, everyone, enter, leave, directed, 1e-13, B[:, :0])
    found = {tuple(pair): x for pair, x in zip(who.tolist(), when, strict=True)}
    for i in range(n):
        for j in range(n) if directed else range(i + 1, n):
            if i == j:
                continue
            d = distance[:, i, j]
            out = d > leave[i] + 1e-9 if near[i, j] else d < enter[i] - 1e-9
            if out.any():
                x = found[i, j]
                assert x <= GRID[np.argmax(out)] + 1e-12
                at = paths(B, np.array([x]))[0]
                level = leave[i] if near[i, j] else enter[i]
                started_beyond = x == 0.0
                assert started_beyond or np.linalg.norm(at[j] - at[i]) == pytest.approx(level, abs=1e-10)


def test_a_pair_that_meets_and_parts_between_two_samples_is_found() -> None:
    # It is within the distance for a 2e-6 of the segment only: no scan of samples would see it.
    line = np.linspace(-1.0, 1.0, 8)
    B = np.zeros((8, 2, 2))
    B[:, 1, 0] = line * 1000.0
    B[:, 1, 1] = 1.0 - 5e-7
    when, who = crossings(
        B,
        reach(B),
        np.zeros((2, 2), dtype=bool),
        np.ones((2, 2), dtype=bool),
        np.ones(2),
        np.ones(2),
        False,
        1e-13,
        B[:, :0],
    )
    assert who.tolist() == [[0, 1]]
    assert when[0] == pytest.approx(0.5 - np.sqrt(1e-6) / 2000.0, abs=1e-11)


@given(st.integers(0, 10_000), st.sampled_from([1, 2, 3]), st.sampled_from([0.05, 1.0]))
@settings(max_examples=60, deadline=None)
def test_a_pair_crosses_only_while_its_velocities_agree(seed: int, m: int, wiggle: float) -> None:
    """The first sample at which a pair is beyond its distance and moves that way, velocities given independently."""
    rng = np.random.default_rng(seed)
    n = 5
    B, P = random_segment(rng, n, m, wiggle), random_segment(rng, n, m, 1.0)
    radius = np.full(n, 2.0)
    q, v = paths(B, GRID), paths(P, GRID)
    offset, change = q[:, None] - q[:, :, None], v[:, None] - v[:, :, None]
    distance, rate = np.linalg.norm(offset, axis=-1), (offset * change).sum(axis=-1)
    near = distance[0] < 2.0
    when, who = crossings(B, reach(B), near, np.ones((n, n), dtype=bool), radius, radius, False, 1e-13, P)
    found = {tuple(pair): x for pair, x in zip(who.tolist(), when, strict=True)}
    for i in range(n):
        for j in range(i + 1, n):
            sign = 1.0 if near[i, j] else -1.0
            beyond = (sign * (distance[:, i, j] - 2.0) > 1e-9) & (sign * rate[:, i, j] > 1e-9)
            x = found.get((i, j), NEVER)
            if beyond.any():
                assert x <= GRID[np.argmax(beyond)] + 1e-12
            if x <= 1.0:
                at, moving = paths(B, np.array([x]))[0], paths(P, np.array([x]))[0]
                d, w = at[j] - at[i], moving[j] - moving[i]
                assert sign * (np.linalg.norm(d) - 2.0) > -1e-9
                assert sign * (d @ w) > -1e-9


@given(st.integers(0, 10_000), st.sampled_from([1, 2, 3]), st.sampled_from([0.05, 1.0]))
@settings(max_examples=60, deadline=None)
def test_closest_approach_is_below_every_sample_and_attained(seed: int, m: int, wiggle: float) -> None:
    rng = np.random.default_rng(seed)
    B = random_segment(rng, 7, m, wiggle)
    linked = np.triu(rng.random((7, 7)) < 0.4, 1)
    linked |= linked.T
    q = paths(B, GRID)
    distance = np.linalg.norm(q[:, None] - q[:, :, None], axis=-1)
    rows = closest(B, reach(B), linked, 1e150, 1e150)
    for row, wanted in zip(rows, (linked, ~linked & ~np.eye(7, dtype=bool)), strict=True):
        if not wanted.any():
            assert row[1] == NEVER
            continue
        assert np.sqrt(row[0]) <= distance[:, wanted].min() + 1e-9
        at = paths(B, row[1:2])[0]
        i, j = int(row[2]), int(row[3])
        assert wanted[i, j]
        assert np.linalg.norm(at[j] - at[i]) == pytest.approx(np.sqrt(row[0]), abs=1e-7)


def test_a_dip_is_a_pair_that_comes_close_inside_the_step_only() -> None:
    line = np.linspace(-1.0, 1.0, 8)
    B = np.zeros((8, 2, 1))
    B[:, 1, 0] = line
    pair = np.array([0]), np.array([1])
    assert deepest_dip(B, reach(B), *pair) == pytest.approx(0.5, abs=1e-6)
    B[:, 1, 0] = 2.0 + line * 0.1
    assert deepest_dip(B, reach(B), *pair) == NEVER


@given(st.integers(0, 10_000), st.floats(0.01, 0.99))
@settings(max_examples=40, deadline=None)
def test_a_cut_segment_is_the_same_curve(seed: int, x: float) -> None:
    c = np.random.default_rng(seed).normal(size=(8, 5))
    whole = Segment(1.0, 3.0, c)
    part = whole.cut(x)
    for share in (0.0, 0.3, 0.77, 1.0):
        t = part.t0 + share * (part.t1 - part.t0)
        np.testing.assert_allclose(part.at(t), whole.at(t), atol=2e-15 * 50)


@pytest.mark.parametrize("place", [0, 1, 7, 14])
def test_what_is_no_number_is_never_above(place: int) -> None:
    g = np.ones((1, 15))
    g[0, 0] = -1.0
    assert first_all_above(g) < 1.0
    g[0, place] = np.nan
    assert first_all_above(g) == NEVER


def test_a_search_of_what_is_no_number_ends() -> None:
    """Halves of it are no numbers either, so that none would ever be left out."""
    for bad in ([1.0, np.nan, 2.0], [np.inf] * 3, [1.0, -np.inf, 2.0]):
        best, x = smallest_value(np.array(bad), np.inf)
        assert np.isnan(best)
        assert x == 0.0
    assert first_above(np.full(8, np.nan)) < 1.0
    assert first_all_above(np.full((2, 8), np.nan)) == NEVER


@pytest.mark.parametrize("m", [1, 2, 3])
@pytest.mark.parametrize("bounds", [(np.inf, np.inf), (4.0, 0.5), (0.5, 4.0), (0.3, 0.3)])
def test_rows_of_pairs_are_looked_at_as_listed_pairs_are(m: int, bounds: tuple[float, float]) -> None:
    """Whole rows are passed over by vectors, with links in one direction, in both, and none."""
    n, rng = 37, np.random.default_rng(7)
    for _ in range(40):
        B, linked = random_segment(rng, n, m, 0.1), rng.random((n, n)) < 0.3
        far, rows, listed = reach(B), np.empty((2, 4)), np.empty((2, 4))
        find_closest(B, far, linked, all_pairs(n), *bounds, rows)
        once = [np.arange(i + 1, n) for i in range(n)]
        starts = np.cumsum([0, *map(len, once)])
        find_closest(
            B, far, linked, NearbyPairs(starts, np.concatenate(once), far, np.full(3, np.inf)), *bounds, listed
        )
        assert rows.tobytes() == listed.tobytes()


@pytest.mark.parametrize("m", [1, 2, 3])
def test_the_fastest_is_no_slower_than_every_sample_and_attained(m: int) -> None:
    """Speeds, those relative to the mean and to a goal; nothing is found where none is above what is known."""
    n, rng = 12, np.random.default_rng(3)
    shares, goal, moving = rng.dirichlet(np.ones(n)), rng.normal(size=m), rng.normal(size=m)
    x = np.linspace(0.0, 1.0, 301)
    for _ in range(30):
        P, rows = random_segment(rng, n, m, 1.0), np.empty((3, 3))
        v = np.array([[value(P[:, i, k] + moving[k], x) for k in range(m)] for i in range(n)])
        mean = np.tensordot(shares, v, 1)
        sizes = [np.linalg.norm(v - middle, axis=1) for middle in (0.0 * mean, mean, goal[:, None])]
        find_fastest(P, moving, shares, goal, 0.0, 0.0, 0.0, rows)
        for (most, where, which), size in zip(rows, sizes, strict=True):
            assert size.max() <= most * (1 + 1e-12)
            assert np.interp(where, x, size[int(which)]) == pytest.approx(most, rel=1e-3)
        known = rows[:, 0].copy()
        find_fastest(P, moving, shares, goal, *(1.0 + 1e-9) * known, rows)
        assert (rows[:, 1] == NEVER).all()
        find_fastest(P, moving, shares, goal, *(1.0 - 1e-9) * known, rows)
        assert rows[:, 0] == pytest.approx(known, rel=1e-12)
