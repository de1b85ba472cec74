"""Whole agents as lanes and back, and inverse square roots."""

import numpy as np
import pytest

from flocking.engine.tiles.simd.inverse_square_root import inverse_root
from flocking.engine.tiles.simd.row_transposition import GATHERERS, LOADERS, STORERS
from flocking.engine.tiles.simd.vectors import load, store
from flocking.formula.native.functions import native

load_four, gather_four, store_four = LOADERS[4], GATHERERS[4], STORERS[4]
load_six, gather_six, store_six = LOADERS[6], GATHERERS[6], STORERS[6]


@native
def move_four(agents, entries, target):
    store_four(target, 16, load_four(agents, 16))
    store_four(target, 32, gather_four(agents, entries, 16, 0x7FFFFFFF))


@native
def move_six(agents, entries, target):
    store_six(target, 16, load_six(agents, 16))
    store_six(target, 32, gather_six(agents, entries, 16, 0x7FFFFFFF))


@native
def fill(x, y):
    for k in range(0, len(x), 16):
        store(y, k, inverse_root(load(x, k)))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("columns", [4, 6])
def test_agents_come_and_go_whole(dtype, columns):
    move = {4: move_four, 6: move_six}[columns]
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
