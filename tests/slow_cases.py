"""Puts tests and cases into the slow tier, and the longest of the others first.

``slow_cases.txt`` names tests and single cases, ``sampled_cases.txt`` tests of which every k-th case stays
in the default tier.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from pathlib import Path

import pytest


def _lines(name: str) -> list[str]:
    lines = Path(__file__).with_name(name).read_text(encoding="utf-8").splitlines()
    return [line for line in lines if line and not line.startswith("#")]


NAMED = set(_lines("slow_cases.txt"))
"""Names as pytest prints them; without a case all cases are meant."""
SAMPLED = {name: int(k) for name, k in map(str.split, _lines("sampled_cases.txt"))}
"""Of the cases of these tests every k-th stays in the default tier, the first among them."""


LONGEST = "tests/test_floors.py::test_types_hold"
"""The longest of the default tests: mypy reads the whole library, on one processor, for minutes in a fresh clone."""


def put_longest_first(items: list[pytest.Item]) -> None:
    """Let the first process begin with the longest test: begun late, it would hold up the end of a run by itself."""
    items.sort(key=lambda item: item.nodeid != LONGEST)


def mark_slow_cases(items: Iterable[pytest.Item]) -> set[str]:
    """Mark the named tests as slow, and of the sampled ones all cases but every k-th.

    A case that is asked for alone is the first, and runs.

    Returns
    -------
    set of str
        Names of tests or cases that are not there, of files that were collected.
    """
    found: set[str] = set()
    files: set[str] = set()
    cases: Counter[str] = Counter()
    for item in items:
        files.add(item.nodeid.partition("::")[0])
        whole = item.nodeid.partition("[")[0]
        named = {item.nodeid, whole} & NAMED
        found |= {whole} & set(SAMPLED)
        slower = named or any(item.get_closest_marker(tier) for tier in ("slow", "repeated"))
        if whole in SAMPLED and not slower:
            if cases[whole] % SAMPLED[whole]:
                item.add_marker(pytest.mark.slow)
            cases[whole] += 1
        for name in named:
            found.add(name)
            item.add_marker(pytest.mark.slow)
    return {name for name in (NAMED | set(SAMPLED)) - found if name.partition("::")[0] in files}
