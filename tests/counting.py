"""How often the tests killed, damaged and fuzzed something: counted as it happens, shown as a table at the end."""

from __future__ import annotations

from collections import Counter
from typing import Any

import pytest

counted: Counter[str] = Counter()
_told: Counter[str] = Counter()

ORDER = ("runs on disk", "cache", "sweeps", "Dask", "lab", "odd machines", "fuzz")
"""What the rows begin with, in the order they are shown."""


def count(what: str, number: int = 1) -> None:
    """Count ``number`` more of ``what``, such as ``"sweeps: workers killed"``."""
    counted[what] += number


@pytest.fixture(autouse=True)
def _counts_are_told(record_property: Any) -> Any:
    """Hand on what was counted since the last test, also to the process that prints it."""
    yield
    grown = counted - _told
    _told.update(grown)
    if grown:
        record_property("counted", dict(grown))


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """Show the table, where anything was counted."""
    total: Counter[str] = Counter()
    for report in (r for reports in terminalreporter.stats.values() for r in reports):
        if getattr(report, "when", None) == "teardown":
            total.update(dict(report.user_properties).get("counted", {}))
    if not total:
        return
    places = {kind: place for place, kind in enumerate(ORDER)}
    names = sorted(total, key=lambda name: (places.get(name.split(":")[0], len(ORDER)), name))
    width = max(map(len, names))
    terminalreporter.section("what was tried")
    for name in names:
        terminalreporter.write_line(f"{name:{width}} {total[name]:10,}")
    cases = sum(number for name, number in total.items() if name.startswith("fuzz:"))
    if cases:
        terminalreporter.write_line(f"{'fuzz, all families':{width}} {cases:10,}")
