"""Puts the tests that ``slow_cases.txt`` names, whole or single cases of them, into the slow tier."""

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
