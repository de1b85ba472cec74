from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import flocking as fk
from flocking.errors import InvalidInput
from flocking.model.graphs.connectivity import is_connected

SEEDS = st.integers(0, 10**6)


@given(SEEDS, st.integers(1, 40), st.sampled_from([1, 2, 3]))
def test_box_and_ball_stay_inside(seed, n, m):
    box = fk.start.box(n, side=3, speed=2, seed=seed, dimension=m, corner=[-1] * m)
    assert box.q.shape == (n, m)
    assert ((box.q >= -1) & (box.q < 2)).all()
    assert (np.linalg.norm(box.p, axis=1) <= 2).all()
    ball = fk.start.ball(n, radius=3, speed=2, seed=seed, dimension=m, velocities="box")
    assert (np.linalg.norm(ball.q, axis=1) <= 3).all()
    assert ((ball.p >= 0) & (ball.p < 2)).all()


def test_a_seed_fixes_the_start():
    first, twin, other = (fk.start.box(9, side=[2, 3], speed=1, seed=s) for s in (3, 3, 4))
    assert (first.q == twin.q).all()
    assert (first.p == twin.p).all()
    assert not (first.q == other.q).any()


def test_draws_are_uniform():
    ball = fk.start.ball(4000, radius=2, speed=1, seed=1)
    inside = (np.linalg.norm(ball.q, axis=1) < 1).mean()
    assert inside == pytest.approx(0.25, abs=0.03)
    assert abs(ball.q.mean(axis=0)).max() < 0.1
    speeds = np.linalg.norm(ball.p, axis=1)
    assert speeds.mean() == pytest.approx(0.5, abs=0.03)
    box = fk.start.box(4000, side=[4, 2], seed=1)
    assert box.q.mean(axis=0) == pytest.approx([2, 1], abs=0.1)


@given(SEEDS)
def test_connected_starts_are(seed):
    graph = fk.Hysteresis(2.0, 0.1)
    start = fk.start.box(6, side=4, seed=seed, connected_under=graph)
    assert is_connected(graph.initial(start.q))


def test_a_hexagonal_start_has_the_spacing():
    q = fk.start.hexagonal(37, spacing=1.5, seed=0).q
    d = np.linalg.norm(q[:, None] - q[None], axis=-1)
    np.fill_diagonal(d, np.inf)
    assert d.min(axis=1) == pytest.approx(1.5)
    assert (np.isclose(d, 1.5).sum(axis=1) == 6).sum() == 19


def test_an_unreachable_start_says_so(monkeypatch):
    from flocking.model.graphs import connectivity

    monkeypatch.setattr(connectivity, "MOST_DRAWS", 20)
    with pytest.raises(InvalidInput, match="no connected graph of 10 agents in 20 draws"):
        fk.start.box(10, side=1000, seed=0, connected_under=fk.Proximity(1))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: fk.start.box(0, side=1, seed=0), "n must be at least 1"),
        (lambda: fk.start.box(2.5, side=1, seed=0), "n must be an integer"),
        (lambda: fk.start.box(2, side=-1, seed=0), "side must be greater than 0"),
        (lambda: fk.start.box(2, side=[1, 0], seed=0), "side must be greater than 0"),
        (lambda: fk.start.box(2, side="x", seed=0), "side must be"),
        (lambda: fk.start.box(2, side=1, speed=-1, seed=0), "speed must be at least 0"),
        (lambda: fk.start.box(2, side=1, seed=-1), "seed must be at least 0"),
        (lambda: fk.start.box(2, side=1, seed=0, corner=[1]), "corner must have 2 coordinates"),
        (lambda: fk.start.box(2, side=1, seed=0, corner=[np.nan, 0]), "corner must be finite"),
        (lambda: fk.start.box(2, side=1, seed=0, dimension=0), "dimension must be at least 1"),
        (lambda: fk.start.box(2, side=1, seed=0, velocities="x"), "must be 'disc', 'box' or 'sphere'"),
        (lambda: fk.start.ball(2, radius=0, seed=0), "radius must be greater than 0"),
        (lambda: fk.start.ball(2, radius=1, dimension=0, seed=0), "dimension must be at least 1"),
        (lambda: fk.start.hexagonal(0, spacing=1, seed=0), "n must be at least 1"),
        (lambda: fk.start.hexagonal(3, spacing=0, seed=0), "spacing must be greater than 0"),
        (lambda: fk.start.hexagonal(3, spacing=1, noise=-1, seed=0), "noise must be at least 0"),
        (lambda: fk.start.hexagonal(3, spacing=1, speed=np.nan, seed=0), "speed must be finite"),
        (lambda: fk.start.hexagonal(3, spacing=1, seed=-4), "seed must be at least 0"),
    ],
)
def test_bad_input_is_explained(make, words):
    with pytest.raises(InvalidInput, match=words):
        make()


@pytest.mark.parametrize(
    "draw",
    [
        lambda seed: fk.start.box(5, side=2.0, speed=1.0, seed=seed),
        lambda seed: fk.start.ball(5, radius=2.0, speed=1.0, seed=seed),
        lambda seed: fk.start.hexagonal(5, spacing=1.0, noise=0.1, speed=1.0, seed=seed),
    ],
)
def test_a_generator_is_taken_in_the_place_of_a_seed_and_drawn_from(draw):
    generator = np.random.default_rng(3)
    first, second, seeded = draw(generator), draw(generator), draw(3)
    assert np.array_equal(first.q, seeded.q)
    assert np.array_equal(first.p, seeded.p)
    assert not np.array_equal(first.q, second.q)
    with pytest.raises(fk.InvalidInput, match="seed must be an integer"):
        draw(np.random.RandomState(3))
