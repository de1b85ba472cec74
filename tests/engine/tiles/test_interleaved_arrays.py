"""Whole agents as lanes and back, and inverse square roots."""

import numba
import numpy as np
import pytest

from flocking.engine.tiles.simd.interleaved_arrays import GATHERERS, LOADERS, STORERS
from flocking.engine.tiles.simd.inverse_square_root import inverse_root
from flocking.engine.tiles.simd.vectors import load, store


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("columns", [4, 6])
def test_agents_come_and_go_whole(dtype, columns):
    load_agents, gather_agents, store_agents = LOADERS[columns], GATHERERS[columns], STORERS[columns]

    @numba.njit
    def move(agents, entries, target):
        store_agents(target, 16, load_agents(agents, 16))
        store_agents(target, 32, gather_agents(agents, entries, 16, 0x7FFFFFFF))

    rng = np.random.default_rng(columns)
    agents, target = rng.random((64, columns)).astype(dtype), np.zeros((64, columns), dtype)
    entries = rng.integers(0, 64, 48).astype(np.uint32)
    # The last agent is read without reading beyond it; the top bit says something else than who.
    entries[17] = 63
    marked = entries.copy()
    marked[20] |= 1 << 31
    move(agents, marked, target)
    assert (target[16:32] == agents[16:32]).all()
    assert (target[32:48] == agents[entries[16:32]]).all()
    assert (target[:16] == 0).all()
    assert (target[48:] == 0).all()


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_inverse_roots(dtype):
    @numba.njit
    def fill(x, y):
        for k in range(0, len(x), 16):
            store(y, k, inverse_root(load(x, k)))

    x = np.exp(np.random.default_rng(0).uniform(-60, 60, 16000)).astype(dtype)
    y = np.empty_like(x)
    fill(x, y)
    error = np.abs(y.astype(np.longdouble) * np.sqrt(x.astype(np.longdouble)) - 1).max()
    assert error < 2 * np.finfo(dtype).eps
    x[:5] = [0, np.inf, np.nan, -1, 4]
    fill(x, y)
    assert y[:2].tolist() == [np.inf, 0.0]
    assert np.isnan(y[2:4]).all()
    assert y[4] == 0.5
