"""Native functions that are compiled by themselves and called by others."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from flocking.formula.native.functions import native, native_apart, provide


@native_apart
def smallest(values: np.ndarray, above: float) -> tuple[float, int, bool]:
    best, place = np.inf, -1
    for k in range(values.shape[0]):
        if above < values[k] < best:
            best, place = values[k], k
    return best, place, place >= 0


@native_apart
def shifted(values: np.ndarray, by: float, wanted: bool) -> None:
    for k in range(values.shape[0]):
        if wanted:
            values[k] += by


@native_apart
def quotient(a: int, b: int) -> int:
    return a // b


@native
def in_turn(table: np.ndarray, below: float) -> tuple[float, int, bool]:
    total, places = 0.0, 0
    found = True
    for row in range(table.shape[0]):
        best, place, some = smallest(table[row], 0)
        found = found and some
        total += best
        places += place
        shifted(table[row], below, row > 0)
    return total, places, found


@native
def shares(a: int, b: int) -> int:
    return quotient(a, b) + 1


def test_a_function_that_is_called_gives_what_python_gives():
    table = np.array([[3.0, 1.0, -2.0], [0.5, 4.0, 0.25], [-1.0, -1.0, -1.0]])
    other = table.copy()
    assert in_turn(table, 0.125) == in_turn.py_func(other, 0.125) == (np.inf, 2, False)
    assert table.tobytes() == other.tobytes()
    assert in_turn(table[:2], 1.0)[2] is True


def test_a_fault_of_a_function_that_is_called_is_passed_on():
    assert shares(7, 2) == 4
    with pytest.raises(ZeroDivisionError):
        shares(7, 0)
    assert shares(7, 3) == 3


def test_what_is_called_is_known_by_module_name_and_kinds():
    symbol, address = provide(f"{__name__}:quotient:i8, i8")
    assert symbol.startswith("native_")
    assert address


def test_a_process_that_finds_the_code_in_the_cache_finds_what_it_calls(tmp_path):
    folder = str(Path(__file__).parents[__name__.count(".")])
    program = f"import sys; sys.path.insert(0, {folder!r}); import {__name__} as t; print(t.shares(9, 2))"
    environment = {**os.environ, "FLOCKING_CACHE": str(tmp_path / "cache")}
    for _ in range(2):
        found = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True)
        assert found.stdout.split() == ["5"], found.stderr
    assert len(list((tmp_path / "cache").rglob("*.o"))) == 2
