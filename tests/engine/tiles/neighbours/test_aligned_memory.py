"""Arrays that kernels read sixteen numbers at a time begin with a line of memory."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.engine.tiles.engine import ENGINE
from flocking.engine.tiles.options import TilesOptions
from flocking.engine.tiles.simd.aligned_memory import aligned
from flocking.formula.native.kinds import LINE


@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.uint32])
@pytest.mark.parametrize("shape", [(1,), (7, 3), (64, 4), (1000, 16), (5,)])
def test_arrays_of_any_size_begin_with_a_line(dtype, shape):
    kept = [aligned(shape, dtype) for _ in range(20)]
    for array in kept:
        assert array.shape == shape
        assert array.dtype == dtype
        assert array.ctypes.data % LINE == 0
        array[...] = 1
    assert all((array == 1).all() for array in kept)


def test_states_lists_and_samples_of_a_run_begin_with_one():
    start = fk.start.hexagonal(500, spacing=7.0, noise=0.5, speed=1.0, seed=0)
    law = fk.Law(fk.Proximity(8.4), [fk.Gradient(fk.Potential("(r - d)**2/2", d=7.0)), fk.Consensus(1.0)])
    world = fk.Scenario(
        law, start, t_end=1.0, frames=2, control=fk.Held(0.1), information=fk.Messages(0.1, expires=0.3, loss=0.2)
    )
    session = ENGINE.open(world, TilesOptions(step=0.01))
    session.advance(0.5)
    particles = session._particles
    held = [particles.store.rows, *particles.used, *particles.senders]
    for array in [particles.agents, particles.successor, *(lists.rows for lists in particles.lists), *held]:
        assert array.ctypes.data % LINE == 0
