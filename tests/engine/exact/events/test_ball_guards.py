"""Crossings of balls on polynomial paths, against dense sampling and against the general way."""

from __future__ import annotations

from math import comb

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import flocking as fk
from flocking.engine.exact.crossings.ball_guards import ball_crossings, centre_paths, uniform_balls
from flocking.model.leaders_and_obstacles.leaders import Path, Velocity
from flocking.model.leaders_and_obstacles.obstacles import Ball


def bernstein_basis(x: np.ndarray) -> np.ndarray:
    k = np.arange(8)
    return np.array([comb(7, int(j)) for j in k]) * x[:, None] ** k * (1.0 - x[:, None]) ** (7 - k)


def paths(seed: int, n: int, m: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(8, n, m)) * 2.0


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([2, 3]), st.floats(0.05, 1.5), st.booleans())
def test_first_crossing_is_that_of_a_dense_sample(seed: int, m: int, level: float, moving: bool) -> None:
    B = paths(seed, 4, m)
    rng = np.random.default_rng(seed + 1)
    speed = rng.normal(size=(3, m)) * (1.0 if moving else 0.0)
    balls = [Ball(Velocity(v, start=c), 0.4) for v, c in zip(speed, rng.normal(size=(3, m)), strict=True)]
    centres = centre_paths(balls, 0.0, 1.0)
    x = np.linspace(0.0, 1.0, 20001)
    basis = bernstein_basis(x)
    q = np.einsum("xa,aik->xik", basis, B)
    c = np.array([b.centre.at(0.0)[0] for b in balls])[None] + x[:, None, None] * speed[None]
    clear = np.linalg.norm(q[:, :, None] - c[:, None], axis=3) - 0.4
    near = clear[0] < level
    everyone = np.ones_like(near)
    when, who = ball_crossings(B, centres, np.full(3, 0.4), near, everyone, level, 1e-13)
    found = {(int(i), int(o)): float(w) for w, (i, o) in zip(when, who, strict=True)}
    for i in range(4):
        for o in range(3):
            beyond = clear[:, i, o] > level if near[i, o] else clear[:, i, o] < level
            if beyond.any():
                first = x[int(np.argmax(beyond))]
                assert (i, o) in found, "a crossing was missed"
                assert found[i, o] <= first + 1e-12
                assert found[i, o] > first - 1.01e-4 or _grazes(clear[:, i, o], level, found[i, o], x)
            elif (i, o) in found:
                assert _grazes(clear[:, i, o], level, found[i, o], x)


def _grazes(clear: np.ndarray, level: float, when: float, x: np.ndarray) -> bool:
    """Whether the sample comes so close to the level there that it may have missed a short excursion."""
    k = int(np.searchsorted(x, when))
    return bool(abs(clear[max(k - 2, 0) : k + 2] - level).min() < 1e-2)


def test_a_visit_far_shorter_than_a_step_is_seen() -> None:
    B = np.zeros((8, 1, 2))
    B[:, 0, 0] = np.linspace(-1e6, 1e6, 8)
    B[:, 0, 1] = 1.0 - 1e-9
    centres = centre_paths([Ball([0.0, 0.0], 0.5)], 0.0, 1.0)
    no = np.zeros((1, 1), dtype=bool)
    when, who = ball_crossings(B, centres, np.array([0.5]), no, ~no, 0.5, 1e-13)
    assert len(when) == 1
    assert when[0] == pytest.approx(0.5, abs=1e-9)


def test_only_balls_that_move_uniformly_take_this_way() -> None:
    def groups(*obstacles):
        return fk.Avoid(obstacles, range=1.0, gamma_agents=False).groups

    assert uniform_balls(groups(Ball([0.0, 0.0], 1.0))[0])
    assert uniform_balls(groups(Ball(Velocity([1.0, 0.0]), 1.0))[0])
    assert not uniform_balls(groups(Ball(Path(["sin(t)", "0*t"]), 1.0))[0])
    assert not uniform_balls(groups(fk.Wall([0.0, 0.0], [1.0, 0.0]))[0])
