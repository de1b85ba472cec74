"""The test of a row of an equation table: what it states, and the object at its home."""

from __future__ import annotations

import importlib
from collections.abc import Callable

import pytest

from flocking.papers import KEYS, paper
from flocking.study.equations import Row
from tests.papers.homes import HOMES

ROWS = [row for key in KEYS for row in paper(key).equations()]


def check_of(row: Row):
    checks = importlib.import_module(f"tests.papers.checks_{row.paper.replace('-', '_')}").CHECKS
    return checks[row.number]


def identity(row: Row) -> str:
    return f"{row.paper} {row.number}"


def at_home(row: Row) -> Callable[[], None] | None:
    """The check of what lives at the row's home, whole and against plain formulas; None where there is none."""
    return HOMES.get(row.home)


def statement(row: Row) -> None:
    """The row's own check: it passes for the paper's number, and goes red when that is off by one per cent."""
    check = check_of(row)
    check(row.build(1.0))
    with pytest.raises(AssertionError):
        check(row.build(1.01))


def examine(row: Row) -> None:
    """The test of a row: its statement, and the object at its home."""
    statement(row)
    whole = at_home(row)
    if whole is not None:
        whole()
