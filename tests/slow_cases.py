"""Puts the tests and cases that ``slow_cases.txt`` names into the slow tier, and the longest of the others first."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import pytest

NAMED = {
    line
    for line in Path(__file__).with_suffix(".txt").read_text(encoding="utf-8").splitlines()
    if line and not line.startswith("#")
}
"""Names as pytest prints them; without a case all cases are meant."""


LONGEST = "tests/test_floors.py::test_types_hold"
"""The longest of the default tests: mypy reads the whole library, on one processor, for minutes in a fresh clone."""


def put_longest_first(items: list[pytest.Item]) -> None:
    """Let the first process begin with the longest test: begun late, it would hold up the end of a run by itself."""
    items.sort(key=lambda item: item.nodeid != LONGEST)


def mark_slow_cases(items: Iterable[pytest.Item]) -> set[str]:
    """Mark the named tests as slow.

    Returns
    -------
    set of str
        Names of tests or cases that are not there, of files that were collected.
    """
    found: set[str] = set()
    files: set[str] = set()
    for item in items:
        files.add(item.nodeid.partition("::")[0])
        for name in {item.nodeid, item.nodeid.partition("[")[0]} & NAMED:
            found.add(name)
            item.add_marker(pytest.mark.slow)
    return {name for name in NAMED - found if name.partition("::")[0] in files}
