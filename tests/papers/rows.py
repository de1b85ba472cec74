"""The test of a row of an equation table: it passes for the paper's number, and goes red when that is off by 1 %."""

from __future__ import annotations

import importlib

import pytest

from flocking.papers import KEYS, paper
from flocking.study.equations import Row

ROWS = [row for key in KEYS for row in paper(key).equations()]


def check_of(row: Row):
    checks = importlib.import_module(f"tests.papers.checks_{row.paper.replace('-', '_')}").CHECKS
    return checks[row.number]


def identity(row: Row) -> str:
    return f"{row.paper} {row.number}"


def examine(row: Row) -> None:
    check = check_of(row)
    check(row.build(1.0))
    with pytest.raises(AssertionError):
        check(row.build(1.01))
