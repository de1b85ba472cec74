"""Lists that cannot fit are refused before any pair is looked at, and only those."""

from __future__ import annotations

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import flocking as fk
from flocking.engine.fixed_step.certain_pairs import ENTRY_BYTES, PARTS, certain_pairs
from flocking.engine.tiles.neighbours.neighbour_lists import TooManyNeighboursError
from flocking.engine.tiles.neighbours.pair_count_bound import PairCountBound
from flocking.errors import TooCrowded
from tests.engine.tiles.laws import saber

MOST_SECONDS = 1.0


@given(st.integers(0, 2**32 - 1), st.sampled_from([2, 3]), st.floats(0.01, 30.0), st.floats(-1e6, 1e6))
@settings(max_examples=25, deadline=None)
def test_no_more_pairs_are_certain_than_there_are(seed: int, m: int, size: float, place: float) -> None:
    rng = np.random.default_rng(seed)
    q = place + size * rng.random((60, m)) ** 3
    reach = float(rng.uniform(0.1, 3.0))
    apart = np.linalg.norm(q[:, None] - q[None], axis=-1)
    assert certain_pairs(q, reach) <= (apart < reach * (1 + 1e-9)).sum() - 60


@pytest.mark.parametrize("m", sorted(PARTS))
def test_all_pairs_of_one_spot_are_certain(m: int) -> None:
    assert certain_pairs(np.full((500, m), 3.0), 1.0) == 500 * 499
    assert certain_pairs(np.zeros((1, m)), 1.0) == 0.0


def test_a_wide_crowd_has_most_of_its_pairs_certain() -> None:
    rng = np.random.default_rng(1)
    q = 5.0 * rng.random((2000, 2))
    apart = np.linalg.norm(q[:, None] - q[None], axis=-1)
    assert certain_pairs(q, 2.0) > 0.6 * ((apart < 2.0).sum() - 2000)


def test_boxes_too_many_to_be_numbered_tell_nothing() -> None:
    assert certain_pairs(np.array([[0.0, 0.0, 0.0], [1e12, 1e12, 1e12]]), 1e-3) == 0.0


@pytest.mark.parametrize("spread", [0.0, 0.5, 3.0])
def test_a_hundred_thousand_agents_in_one_spot_are_refused_within_a_second(spread: float) -> None:
    law = fk.Law(saber().graph, saber().terms)
    fk.simulate(fk.Scenario(law, fk.start.box(20, side=9, seed=1), t_end=0.02, frames=1), engine="tiles", step=0.01)
    q = spread * np.random.default_rng(2).random((100_000, 2))
    scenario = fk.Scenario(law, fk.State(q), t_end=1.0, frames=1)
    began = time.process_time()
    with pytest.raises(TooCrowded, match="neighbour lists would take at least"):
        fk.simulate(scenario, engine="tiles", step=0.01, memory_limit=4e9, progress=False)
    assert time.process_time() - began < MOST_SECONDS


def test_one_far_sighted_agent_does_not_make_a_crowd_too_crowded() -> None:
    """The lists of an agent with a radius of its own hold whom it senses, not whom the farthest-sighted one would."""
    radii = np.full(3000, 1e-3)
    radii[7] = 5.0
    law = fk.Law(fk.PerAgentRadii(radii), [fk.Consensus(1.0)])
    q = np.random.default_rng(3).random((3000, 2))
    scenario = fk.Scenario(law, fk.State(q), t_end=0.02, frames=2)
    run = fk.simulate(scenario, engine="tiles", step=0.01, memory_limit=5e6, skin=0.01, progress=False)
    assert run.t[-1] == pytest.approx(0.02)


def test_images_of_one_spot_are_counted_where_axes_repeat() -> None:
    box = fk.Periodic([7.0, 7.0])
    q = np.full((500, 2), 3.0) + 7.0 * np.random.default_rng(0).integers(-50, 50, (500, 2))
    limit = 0.9 * ENTRY_BYTES * 500 * 499
    crowded = 1e6
    with pytest.raises(TooManyNeighboursError):
        PairCountBound(limit).check(crowded, q, lambda: [1.0], box)
    PairCountBound(limit).check(crowded, q, lambda: [1.0])
