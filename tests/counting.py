"""What a run of the tests says at its end: how often it killed, damaged and fuzzed something, where its time went."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
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


LONG_RUN = 120.0
"""Seconds of all tests together from which on a run says which files took longest: that of a single folder need not."""
FILES_SHOWN = 15
"""Files that are named; in most runs these take more than half of the time."""


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """Show the tables, each where it has something to say."""
    reports = [r for found in terminalreporter.stats.values() for r in found if hasattr(r, "when")]
    _show_counts(terminalreporter, reports)
    seconds = seconds_of_files(reports)
    if sum(seconds.values()) < LONG_RUN:
        return
    terminalreporter.section("slowest files (s of all workers together)")
    for name, spent in seconds.most_common(FILES_SHOWN):
        terminalreporter.write_line(f"{spent:8.1f} {name}")
    terminalreporter.write_line(f"{sum(seconds.values()):8.1f} all {len(seconds)} files")


def seconds_of_files(reports: Iterable[Any]) -> Counter[str]:
    """Seconds of the tests of each file, fixtures included; files that could not be read have none."""
    seconds: Counter[str] = Counter()
    for report in reports:
        seconds[report.nodeid.partition("::")[0]] += getattr(report, "duration", 0.0)
    return seconds


def _show_counts(terminalreporter: Any, reports: Iterable[Any]) -> None:
    total: Counter[str] = Counter()
    for report in reports:
        if report.when == "teardown":
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
