"""Every row of the equation table: its test passes, and goes red when its object is off by 1 %."""

from __future__ import annotations

import importlib

import pytest

from flocking.papers import KEYS, paper
from flocking.study.equations import KINDS, Row

ROWS = [row for key in KEYS for row in paper(key).equations()]


def check_of(row: Row):
    checks = importlib.import_module(f"tests.papers.checks_{row.paper.replace('-', '_')}").CHECKS
    return checks[row.number]


def identity(row: Row) -> str:
    return f"{row.paper} {row.number}"


@pytest.mark.parametrize("row", ROWS, ids=identity)
def test_row(row: Row) -> None:
    check_of(row)(row.build(1.0))


@pytest.mark.parametrize("row", ROWS, ids=identity)
def test_row_goes_red_when_perturbed_by_one_percent(row: Row) -> None:
    with pytest.raises(AssertionError):
        check_of(row)(row.build(1.01))


@pytest.mark.parametrize("row", ROWS, ids=identity)
def test_row_is_complete(row: Row) -> None:
    assert row.kind in KINDS
    module, _, name = row.home.rpartition(".")
    while True:
        try:
            found = importlib.import_module(module)
            break
        except ModuleNotFoundError:
            module, _, outer = module.rpartition(".")
            name = f"{outer}.{name}"
    for part in name.split("."):
        found = getattr(found, part)
    verdict, shown = row.verdict()
    assert verdict in ("as printed", "read so", "wrong")
    assert (verdict == "wrong") == (shown is not None)
    if row.demonstration is not None:
        assert verdict == "wrong", "a demonstration that refutes nothing"


def test_numbers_are_unique_within_a_paper() -> None:
    names = [identity(row) for row in ROWS]
    assert len(names) == len(set(names))
