"""The entry that takes NumPy's arrays as they are: it takes what it was compiled for, and nothing else."""

import numpy as np
import pytest

from flocking.formula.native import entries
from flocking.formula.native.functions import NativeFunction


def total(values, factor, count):
    found = 0.0
    for i in range(values.shape[0]):
        for k in range(values.shape[1]):
            found += factor * values[i, k]
    return found, count


def compiled():
    function = NativeFunction(total)
    assert function(np.ones((2, 3)), 2.0, 4) == (12.0, 4)
    return function, function._latest


def test_numpy_keeps_arrays_as_its_interface_states():
    assert entries.usable()


def test_arrays_of_the_kind_are_taken_as_they_are():
    _, fast = compiled()
    for array in (np.arange(6.0).reshape(2, 3), np.zeros((0, 3)), np.arange(24.0).reshape(8, 3)[4:6]):
        assert fast.attempt((array, 0.5, 7)) == (0.5 * array.sum(), 7)
    assert fast.attempt((np.ones((2, 2)), np.float64(0.5), 7)) == (2.0, 7)


class Special(np.ndarray):
    """An array of another class."""


@pytest.mark.parametrize(
    "values",
    [
        (np.ones((2, 3), np.float32), 0.5, 1),
        (np.ones((2, 3), ">f8"), 0.5, 1),
        (np.ones(6), 0.5, 1),
        (np.ones((2, 3, 1)), 0.5, 1),
        (np.ones((3, 2)).T, 0.5, 1),
        (np.ones((2, 6))[:, ::2], 0.5, 1),
        (np.frombuffer(bytes(49), np.uint8)[1:].view(np.float64).reshape(2, 3), 0.5, 1),
        (np.ones((2, 3)).view(Special), 0.5, 1),
        ([[1.0, 2.0]], 0.5, 1),
        (None, 0.5, 1),
        (np.ones((2, 3)), 1, 1),
        (np.ones((2, 3)), "2", 1),
        (np.ones((2, 3)), 0.5, 1.0),
        (np.ones((2, 3)), 0.5, 2**70),
        (np.ones((2, 3)), 0.5, True),
        (np.ones((2, 3)), 0.5),
    ],
)
def test_everything_else_is_left_to_the_careful_way(values):
    _, fast = compiled()
    assert fast.attempt(values) is NotImplemented


def test_the_careful_way_gives_the_same():
    function, _ = compiled()
    array = np.arange(6.0).reshape(2, 3)
    assert function(array.view(Special), 0.5, 3) == function(array, 0.5, 3)
    assert function(array.astype(np.float32), 0.5, 3) == function(array, 0.5, 3)
    with pytest.raises(TypeError, match="row by row"):
        function(array.T, 0.5, 3)
    assert function(array, 0.5, 3) == (7.5, 3)


def scaled(values, factor):
    return values[2] * factor


@pytest.mark.parametrize("kind", [np.float32, np.float64, np.int32, np.int64, np.uint32, np.uint64, np.bool_])
def test_numbers_of_numpy_are_taken_as_they_are(kind):
    function = NativeFunction(scaled)
    assert function(np.arange(3.0), kind(1)) == 2.0
    assert function._latest.attempt((np.arange(3.0), kind(1))) == 2.0
    assert function._latest.attempt((np.arange(3.0), "1")) is NotImplemented
