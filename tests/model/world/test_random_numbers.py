"""Philox4x32-10 against its published test vectors, and the distributions drawn from it."""

import numpy as np
import pytest
from scipy import stats

from flocking.model.world.random_numbers import FEW_DRAWS, Purpose, normal_pairs, philox, uniform, words

# Known answers of the authors' library, file kat_vectors: counter, key, result.
VECTORS = [
    ((0, 0, 0, 0), (0, 0), (0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8)),
    ((0xFFFFFFFF,) * 4, (0xFFFFFFFF,) * 2, (0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD)),
    (
        (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344), (0xA4093822, 0x299F31D0),
        (0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1),
    ),
]  # fmt: skip


@pytest.mark.parametrize(("counter", "key", "expected"), VECTORS)
def test_published_vectors(counter, key, expected):
    assert philox(counter, key) == expected
    found = philox(tuple(np.full(3, x, dtype=np.uint64) for x in counter), key)
    assert [x.dtype for x in found] == [np.uint64] * 4
    assert tuple(int(x[2]) for x in found) == expected


def test_a_draw_depends_on_all_that_it_is_for_and_on_nothing_else():
    base = tuple(int(x) for x in words(7, Purpose.LOSS, 1, 2, 3))
    others = [(8, Purpose.LOSS, 1, 2, 3), (7, Purpose.JITTER, 1, 2, 3), (7, Purpose.LOSS, 2, 2, 3),
              (7, Purpose.LOSS, 1, 3, 3), (7, Purpose.LOSS, 1, 2, 4), (7, Purpose.LOSS, 1, 2, 3 + 2**32),
              (7 + 2**32, Purpose.LOSS, 1, 2, 3)]  # fmt: skip
    drawn = {tuple(int(x) for x in words(*other)) for other in others}
    assert base not in drawn
    assert len(drawn) == len(others)
    many = words(7, Purpose.LOSS, np.arange(5)[:, None], np.arange(4), 3)
    assert tuple(int(x[1, 2]) for x in many) == base


@pytest.mark.parametrize("count", [0, 1, FEW_DRAWS, FEW_DRAWS + 1])
def test_few_draws_are_those_of_many(count):
    k = np.arange(20) * 10**11
    many, few = words(5**20, Purpose.NOISE, 3, 4, k), words(5**20, Purpose.NOISE, 3, 4, k[:count])
    for one, other in zip(many, few, strict=True):
        assert (one[:count] == other).all()
        assert other.shape == (count,)
        assert one.dtype == other.dtype == np.uint64
    assert [np.shape(x) for x in words(5, Purpose.NOISE, 3, 4, 1)] == [()] * 4
    assert [x.shape for x in words(5, Purpose.NOISE, np.ones((2, 1), int), np.ones(3, int), 1)] == [(2, 3)] * 4


def test_uniform_and_normal_numbers():
    k = np.arange(200_000)
    u = uniform(3, Purpose.LOSS, 0, 1, k)
    assert 0.0 < u.min() < u.max() < 1.0
    assert stats.kstest(u, "uniform").pvalue > 1e-4
    a, b = normal_pairs(3, Purpose.NOISE, 0, 1, k)
    assert stats.kstest(a, "norm").pvalue > 1e-4
    assert stats.kstest(b, "norm").pvalue > 1e-4
    assert abs(np.corrcoef(a, b)[0, 1]) < 5 / np.sqrt(len(k))
