"""The list of nearby pairs misses none that may cross a distance before the list is made anew."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.engine.adaptive_steps.segment import Motion, split_motion
from flocking.engine.exact import session
from flocking.engine.exact.blocks import block
from flocking.engine.exact.crossings.nearby_pairs import (
    BASE,
    SKIN,
    NearbyPairs,
    all_pairs,
    note_displacements,
    require_pairs,
    unknown_pairs,
)
from flocking.engine.exact.crossings.watch_tables import PairWatches
from tests.engine.exact.groups import spring
from tests.engine.exact.test_blocks import assert_same, one_by_one, run


def watches(n: int, radius: float) -> PairWatches:
    none, levels = np.zeros((1, n, n), dtype=bool), np.full((1, n), radius)
    flag = np.zeros(1, dtype=bool)
    return PairWatches(none, ~none, levels, levels, np.zeros(1), flag, flag, flag)


def motion(q: np.ndarray, p: np.ndarray) -> Motion:
    """Straight motion from ``q`` to ``q + p``."""
    n, m = q.shape
    rows = [np.concatenate([(q + a / 7 * p).ravel(), p.ravel()]) for a in range(8)]
    B, P, far = np.empty((8, n, m)), np.empty((8, n, m)), np.empty(n)
    return Motion(B, P, far, split_motion(np.array(rows), B, P, far))


def listed(nearby: NearbyPairs) -> set[tuple[int, int]]:
    starts, partners = nearby.starts, nearby.partners
    return {(i, int(j)) for i in range(len(starts) - 1) for j in partners[starts[i] : starts[i + 1]]}


def test_all_pairs_are_all_pairs() -> None:
    assert listed(all_pairs(4)) == {(i, j) for i in range(4) for j in range(4) if i != j}
    assert listed(all_pairs(1)) == set()


@pytest.mark.parametrize("seed", range(5))
def test_no_pair_comes_close_without_being_listed(seed: int) -> None:
    """Random walks of 60 agents in many steps: whoever is within the radius at any of 8 places of a step is listed."""
    rng = np.random.default_rng(seed)
    n, radius = 60, 1.0
    watched, linked = watches(n, radius), np.zeros((1, n, n), dtype=bool)
    nearby = unknown_pairs(watched, n)
    q, made, missed = rng.uniform(0, 12, (n, 2)), 0, 0
    for step in range(150):
        p = rng.normal(size=(n, 2)) * (0.6 if step % 50 == 25 else 0.02)
        moving = motion(q, p)
        before = nearby.partners[: nearby.starts[-1]].copy()
        require_pairs(nearby, moving, watched, linked, 20.0)
        made += not np.array_equal(before, nearby.partners[: nearby.starts[-1]])
        for a in range(8):
            apart = np.linalg.norm(moving.positions[a][None] - moving.positions[a][:, None], axis=-1)
            close = {(int(i), int(j)) for i, j in zip(*np.nonzero(apart < radius), strict=True) if i != j}
            missed += len(close - listed(nearby))
        nearby.moved[:] += moving.far
        q = q + p
    assert missed == 0
    assert 3 < made < 100, "the list must last for several steps"
    assert nearby.starts[-1] < n * (n - 1) / 4, "the list must leave pairs out"


def test_linked_pairs_and_those_within_a_distance_are_listed_however_far() -> None:
    watched, linked = watches(3, 1.0), np.zeros((1, 3, 3), dtype=bool)
    q = np.array([[0.0, 0.0], [50.0, 0.0], [100.0, 0.0]])
    nearby = unknown_pairs(watched, 3)
    watched.near[0, 0, 1], linked[0, 1, 2], linked[0, 2, 1] = True, True, True
    require_pairs(nearby, motion(q, 0.0 * q), watched, linked, 100.0)
    assert listed(nearby) == {(0, 1), (1, 0), (1, 2), (2, 1)}


@pytest.mark.parametrize("seed", range(4))
def test_a_list_is_that_of_all_pairs_looked_at_one_by_one(seed: int) -> None:
    """Two watches and two graphs; few, many or no pairs that belong to it are far apart, in one order or both."""
    rng = np.random.default_rng(seed)
    n, radius, share = 40, 1.0, (0.0, 1e-3, 0.02, 0.5)[seed]
    one = watches(n, radius)
    watched = PairWatches(*(np.concatenate([field, field]) for field in one))
    linked = rng.random((2, n, n)) < share
    watched.near[:] = rng.random((2, n, n)) < share
    q = rng.uniform(0, 12, (n, 3 if seed % 2 else 2))
    nearby = unknown_pairs(watched, n)
    require_pairs(nearby, motion(q, 0.0 * q), watched, linked, 12.0)
    tied = (linked | watched.near).any(axis=0)
    apart = np.linalg.norm(q[None] - q[:, None], axis=-1)
    reach = nearby.bounds[BASE] + nearby.bounds[SKIN]
    expected = (apart <= reach) | tied | tied.T
    np.fill_diagonal(expected, False)
    assert listed(nearby) == {(int(i), int(j)) for i, j in zip(*np.nonzero(expected), strict=True)}
    assert all(
        (np.diff(nearby.partners[a:b]) > 0).all() for a, b in zip(nearby.starts, nearby.starts[1:], strict=False)
    )
    assert nearby.moved.max() == 0.0


def test_displacements_of_steps_add_up() -> None:
    nearby = unknown_pairs(watches(2, 1.0), 2)
    for far in ([0.25, 1.0], [0.5, 0.0]):
        note_displacements(nearby, np.array(far))
    assert nearby.moved.tolist() == [0.75, 1.0]


def test_lists_are_kept_from_call_to_call_and_forgotten_after_other_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """Calls of three steps: a new list for the first, and for those that follow a step that the session took."""
    start = fk.start.box(40, side=16, speed=2.0, seed=4)
    scenario = fk.Scenario(spring(fk.Proximity(2.0)), start, t_end=4.0, frames=11)
    expected, made, by_session = one_by_one(monkeypatch, scenario), [], []
    make, step = block.unknown_pairs, session.found_step
    monkeypatch.setattr(block, "MOST_STEPS", 3)
    monkeypatch.setattr(block, "unknown_pairs", lambda *given: made.append(given) or make(*given))
    monkeypatch.setattr(session, "found_step", lambda *given: by_session.append(given) or step(*given))
    assert_same(run(scenario), expected)
    assert 1 <= len(made) <= 1 + len(by_session)
    assert expected.provenance["steps"] > 3 * (10 + len(by_session))


def test_a_sparse_group_has_the_bits_of_single_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """Forty agents of which few are near each other: lists are made and worn out."""
    start = fk.start.box(40, side=16, speed=2.0, seed=4)
    scenario = fk.Scenario(spring(fk.Proximity(2.0)), start, t_end=4.0, frames=11)
    expected = one_by_one(monkeypatch, scenario)
    assert len(expected.switches) > 40
    assert_same(run(scenario), expected)
