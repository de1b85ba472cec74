"""The test of a row of an equation table: what it states, and the object at its home."""

from __future__ import annotations

import importlib
from functools import cache

import pytest

from flocking.papers import ALL_KEYS, STANDARD_KEYS, paper
from flocking.papers.equation_table import Row
from flocking.study.claims.audit import Report
from flocking.study.claims.judgement import Judgement
from tests.papers.homes import HOMES

ROWS = [row for key in ALL_KEYS for row in paper(key).equations()]


def check_of(row: Row):
    folder = "standard_laws." if row.paper in STANDARD_KEYS else ""
    module = f"tests.papers.transcriptions.{folder}checks_{row.paper.replace('-', '_')}"
    checks = importlib.import_module(module).CHECKS
    return checks[row.number]


def identity(row: Row) -> str:
    return f"{row.paper} {row.number}"


def judges_runs(found: object) -> bool:
    """Whether an object is the judgements of claims over several runs, or the audit of one."""
    several = isinstance(found, dict) and any(isinstance(value, Judgement) for value in found.values())
    return several or isinstance(found, Report)


def statement(row: Row) -> None:
    """The row's own check: it passes for the paper's number, and goes red when that is off by one per cent.

    Those that judge whole runs go red in the slow tests, see `goes_red`, for it takes as long again. By default the
    claims of these papers meet wrong laws in `tests/papers/test_claims.py` and in the mutants.
    """
    check = check_of(row)
    found = row.build(1.0)
    check(found)
    if not judges_runs(found):
        with pytest.raises(AssertionError):
            check(row.build(1.01))


def goes_red(row: Row) -> None:
    """The check of a row that judges whole runs fails when the paper's number is off by one per cent.

    That it passes for the number itself, and that the others go red, is tested by `statement`.
    """
    found = row.build(1.01)
    if judges_runs(found):
        with pytest.raises(AssertionError):
            check_of(row)(found)


@cache
def _at_home_once(home: str) -> None:
    check = HOMES.get(home)
    if check is not None:
        check()


def examine(row: Row) -> None:
    """The test of a row: its statement, and the object at its home.

    Rows of one home share the check of it once it has passed; while it fails, it is made, and fails, for each of them.
    """
    statement(row)
    _at_home_once(row.home)
