"""Neighbour lists against all pairs, and lanes that are kept side by side."""

import numpy as np
import pytest

from flocking.engine.fixed_step.threads import Workers
from flocking.engine.tiles.neighbours.cell_list import Sorter
from flocking.engine.tiles.neighbours.cell_search import ROOM
from flocking.engine.tiles.neighbours.nearest_image import box_of
from flocking.engine.tiles.neighbours.neighbour_lists import ListBuilder, Listed
from flocking.engine.tiles.simd import packing
from flocking.engine.tiles.simd.packing import pack
from flocking.engine.tiles.simd.vectors import load
from flocking.formula.native.functions import native
from flocking.model.space import OPEN, Periodic

REACH = 1.0


@native
def keep(values, mask, target, at, counts):
    counts[0] = pack(target, at, load(values, 0), load(mask, 0) > np.uint32(0))


@native
def keep_without_the_instruction(values, mask, target, at, counts):
    counts[0] = pack(target, at, load(values, 0), load(mask, 0) > np.uint32(0))


@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.uint32])
@pytest.mark.parametrize("instruction", [True, False], ids=["this processor", "any processor"])
def test_kept_lanes_stand_side_by_side(dtype, instruction, monkeypatch):
    function = keep
    if not instruction:
        monkeypatch.setattr(packing, "has_feature", lambda name: False)
        function = keep_without_the_instruction
    rng = np.random.default_rng(0)
    for share in (0.0, 0.3, 1.0):
        values, mask = rng.integers(0, 1000, 16).astype(dtype), (rng.random(16) < share).astype(np.uint32)
        target, counts = np.full(40, 7777, dtype), np.zeros(1, np.int64)
        function(values, mask, target, 5, counts)
        assert counts[0] == mask.sum()
        assert (target[5 : 5 + counts[0]] == values[mask > 0]).all()
        assert (target[:5] == 7777).all()
        assert (target[21:] == 7777).all()


def scattered(rng, n, m):
    return rng.random((n, m)) * (n ** (1 / m))


def far_apart(rng, n, m):
    return rng.random((n, m)) * 1e4 + np.where(rng.random((n, 1)) < 0.5, 0.0, rng.random((1, m)))


def crowded(rng, n, m):
    return rng.random((n, m)) * 1.5


def one_row(rng, n, m):
    q = rng.random((n, m)) * 0.5
    q[:, 0] *= 4.0 * n
    return q


def round_and_round(rng, n, m):
    return rng.random((n, m)) * 4.0 + 4.0 * rng.integers(-50, 50, (n, m))


def end_to_end(rng, n, m):
    return rng.random((n, m)) * 4.0


PLACES = {"scattered": scattered, "far apart": far_apart, "crowded": crowded, "one row": one_row,
          "round and round": round_and_round, "end to end": end_to_end}  # fmt: skip


def listed(q, dtype, space, each, threads=1):
    """Squared distances as the search computes them, within reach, and the lists, all as sorted arrays."""
    n, m = q.shape
    size = -(-n // 16) * 16
    agents = np.zeros((size, 2 * m), dtype)
    agents[:n, :m] = q
    workers = Workers(threads)
    sorter = Sorter(n, workers, space.lengths)
    sorter.sort(agents, sorter.survey(agents), REACH)
    agents[:n] = agents[sorter.order]
    agents[n:] = agents[n - 1]
    reaches = np.full(1, REACH) if each is None else np.resize(each, size)
    builder = ListBuilder(n, 1e9, workers, box_of(space, m, dtype))
    lists, _ = builder.build(
        agents, Listed(REACH, reaches.astype(dtype)), sorter.grid, sorter.start, None, sorter.order, sorter.key_buffer,
        begin=None, remember=False,
    )  # fmt: skip
    return agents[:n, :m].astype(np.float64), reaches, lists


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("m", [2, 3])
@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("uneven", [False, True])
def test_lists_hold_exactly_the_pairs_within_reach(place, m, dtype, uneven):
    space = Periodic([4.0] * m) if place in ("round and round", "end to end") else OPEN
    for n in (5, 16, 37, 900 if place != "crowded" else 1300):
        rng = np.random.default_rng(n)
        each = rng.uniform(0.3, 1.0, 64) if uneven else None
        q, reaches, lists = listed(PLACES[place](rng, n, m), dtype, space, each)
        square = (space.displacement((q[None] - q[:, None]).reshape(-1, m)) ** 2).sum(axis=1).reshape(n, n)
        np.fill_diagonal(square, np.inf)
        limit = np.resize(reaches, n)[:, None] ** 2
        # What lies on the border to rounding may be there or not.
        doubt = 1e-4 if dtype == np.float32 else 1e-9
        must, may = square < limit * (1 - doubt), square < limit * (1 + doubt)
        found = np.zeros((n, n), dtype=int)
        for tile, (first, count) in enumerate(zip(lists.first, lists.count, strict=True)):
            for lane in range(min(16, n - tile * 16)):
                i, column = tile * 16 + lane, lists.rows[first : first + count, lane]
                np.add.at(found[i], column[column != i], 1)
        assert found.max() <= 1
        assert (found[must] == 1).all()
        assert not found[~may].any()
        assert must.any() or place in ("far apart", "one row") or n == 5
        if place == "crowded" and n == 1300:
            # More candidates than are kept at once.
            assert must.sum(axis=1).min() > 0
            assert n > 2 * ROOM
    one, two = (listed(PLACES[place](np.random.default_rng(1), 2500, m), dtype, space, None, k)[2] for k in (1, 2))
    assert (one.count == two.count).all()
    for tile in range(len(one.count)):
        a, b = (x.rows[x.first[tile] : x.first[tile] + x.count[tile]] for x in (one, two))
        assert (a == b).all()
