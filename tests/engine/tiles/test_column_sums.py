"""Sums over tiles are added from the first tile to the last, and do not depend on whether a state is written."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.engine.tiles.engine import ENGINE
from flocking.engine.tiles.measures import column_sums
from flocking.engine.tiles.options import TilesOptions


@pytest.mark.parametrize("rows", [0, 1, 2, 9, 1000])
@pytest.mark.parametrize("columns", [2, 8, 11])
def test_columns_are_summed_row_by_row(rows, columns):
    rng = np.random.default_rng(rows)
    values = rng.normal(size=(rows, columns)) * 10.0 ** rng.integers(-8, 8, (rows, columns))
    expected = list(values[0]) if rows else [0.0] * columns
    for row in values[1:]:
        expected = [a + b for a, b in zip(expected, row, strict=True)]
    found = np.full(columns, np.nan)
    column_sums(values, found)
    assert found.tolist() == expected
    assert found.tolist() == values.sum(axis=0).tolist()


def test_a_negative_zero_and_what_is_not_finite_stay():
    values = np.array([[-0.0, np.inf, 1.0, np.nan], [-0.0, 1.0, -np.inf, 1.0]])
    found = np.zeros(4)
    column_sums(values, found)
    assert np.signbit(found[0])
    assert found[1:3].tolist() == [np.inf, -np.inf]
    assert np.isnan(found[3])


def test_a_pass_that_writes_no_state_gives_the_same_sums():
    rng = np.random.default_rng(0)
    law = fk.Law(fk.Proximity(1.5), [fk.Gradient(fk.Potential("0.5*(r - 1)**2")), fk.Consensus(0.5)])
    start = fk.State(rng.uniform(0, 7, (50, 2)), rng.normal(size=(50, 2)))
    particles = ENGINE.open(fk.Scenario(law, start, t_end=1.0), TilesOptions(step=0.01))._particles
    rest = {"keep": 0.0, "kick": 1.0, "drift": 0.0, "exponential_damping": 0.0}
    particles.move(0.0, **rest)
    sums, extremes = particles.total_sums().copy(), particles.results.extremes.copy()
    particles.results.sums[:] = np.nan
    particles.successor[:] = 7.0
    particles.move(0.0, **rest, writes=False)
    assert (particles.total_sums() == sums).all()
    assert (particles.results.extremes == extremes).all()
    assert (particles.successor == 7.0).all()
