"""What the record of a sweep holds of functions and values: whatever may change a run shows in it."""

import functools
import subprocess
import sys

import numpy as np
import pytest

import flocking as fk
from flocking.errors import StorageError
from flocking.study.sweeps.plan import make_plan
from flocking.study.sweeps.recorded_content import code_of, content_of
from tests.study.sweeps.sweep_cases import make

ARRAY = np.zeros((800, 2))


def changed(array, place=(400, 1)):
    other = array.copy()
    other[place] = 1.0
    return other


def scenario(q):
    return fk.Scenario(fk.Law(fk.Fixed.complete(3), [fk.Consensus(1.0)]), fk.State(q, np.zeros_like(q)), t_end=0.1)


def holding(x):
    return lambda seed: x


PAIRS = {
    "long arrays": (ARRAY, changed(ARRAY)),
    "arrays in lists": ([ARRAY], [changed(ARRAY)]),
    "arrays in tables": ({"q": ARRAY}, {"q": changed(ARRAY)}),
    "starts": (scenario(ARRAY[:3]).start, scenario(changed(ARRAY[:3], (1, 1))).start),
    "scenarios": (scenario(ARRAY[:3]), scenario(changed(ARRAY[:3], (1, 1)))),
    "arrays of objects": (np.array([1, "a"], dtype=object), np.array([1, "b"], dtype=object)),
    "sets": ({1, 2}, {1, 3}),
    "numbers": (1.0, 1.5),
}


@pytest.mark.parametrize("kind", PAIRS)
@pytest.mark.parametrize("hold", [
    holding, lambda x: functools.partial(make, x), lambda x: functools.partial(make, speed=x),
    lambda x: lambda seed, q=x: q, lambda x: lambda seed, *, q=x: q,
])  # fmt: skip
def test_another_value_held_by_a_function_is_other_code(kind, hold):
    one, other = PAIRS[kind]
    assert code_of(hold(one)) == code_of(hold(one))
    assert code_of(hold(one)) != code_of(hold(other))


@pytest.mark.parametrize("kind", PAIRS)
def test_values_of_an_axis_differ_wherever_their_numbers_do(kind):
    one, other = PAIRS[kind]
    same, different = (make_plan({"x": values}, None, 1, 0, 10) for values in ([one], [one, other]))
    assert different.points == 2
    assert same.as_data() != make_plan({"x": [other]}, None, 1, 0, 10).as_data()


def test_functions_that_refer_to_themselves_and_objects_inside_themselves_end():
    def again(seed):
        return again(seed)

    inside = []
    inside.append(inside)
    assert code_of(again) == code_of(again)
    assert code_of(holding(inside)) == code_of(holding(inside))


def test_content_is_the_same_in_another_process():
    code = (
        "import numpy as np, flocking as fk; from flocking.study.sweeps.recorded_content import content_of; "
        "law = fk.Law(fk.Fixed.complete(3), [fk.Consensus(1.0)]); q = np.zeros((3, 2)); "
        "print(content_of([{'b', 'a'}, q, fk.Scenario(law, fk.State(q, q), t_end=0.1)]))"
    )
    other = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip()
    assert content_of([{"a", "b"}, np.zeros((3, 2)), scenario(np.zeros((3, 2)))]) == other


def test_a_sweep_around_another_start_is_another_sweep(tmp_path):
    def stored(q):
        return fk.sweep(holding(scenario(q)), measures=["diameter"], out=tmp_path / "x", workers=1, progress=False)

    q = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    stored(q)
    assert stored(q).complete
    with pytest.raises(StorageError, match="make"):
        stored(2 * q)


KNOWN, ONE, TWO, OTHER = ["speed"], {"speed": lambda run: 1.0}, {"speed": lambda run: 2.0}, {"speed": "diameter"}


@pytest.mark.parametrize(("one", "other"), [(KNOWN, ONE), (ONE, TWO), (KNOWN, OTHER), (OTHER, ONE)])
def test_another_measure_under_the_same_name_is_another_sweep(tmp_path, one, other):
    def stored(measures):
        return fk.sweep(make, measures=measures, out=tmp_path / "x", workers=1, progress=False)

    stored(one)
    assert stored(one).complete
    with pytest.raises(StorageError, match=r"measures\.speed"):
        stored(other)


def test_functions_that_are_not_written_in_python_are_named():
    assert code_of(len) != code_of(max)
    assert code_of(holding(len)) == code_of(holding(len))
