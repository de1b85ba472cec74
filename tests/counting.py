"""What a run of the tests says at its end: how often it killed, damaged and fuzzed something, where its time went."""

from __future__ import annotations

import resource
import time
from collections import Counter
from collections.abc import Iterable, Iterator
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
"""Seconds of all tests together from which on a run names its dearest files: that of a single folder need not."""
FILES_SHOWN = 15
"""Files that are named."""


BUDGETS = {"default": 16.0, "validate": 120.0}
"""Minutes of processor time of the two tiers: 8 and 60 minutes on two processors that are never idle. Tests that wait
take longer than their processor time; a busy machine, or an empty cache of generated code, makes it larger."""
PROCESSOR = "processor seconds"
"""Name of a test's processor time among its properties, and of a worker's in what it hands over."""
_workers: list[float] = []
"""Processor time of each worker of this run that has ended."""


def processor_seconds() -> float:
    """Processor time of this process, and of the processes that it started and that have ended."""
    ended = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + ended.ru_utime + ended.ru_stime


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Note the processor time at which a test begins: its teardown hands on the difference."""
    item.stash[_BEGUN] = processor_seconds()
    return (yield)


_BEGUN = pytest.StashKey[float]()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: Any) -> Any:
    """Hand on the processor time of a test, fixtures included, with the report of its teardown."""
    report = yield
    if report.when == "teardown":
        report.user_properties.append((PROCESSOR, processor_seconds() - item.stash[_BEGUN]))
    return report


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    """A worker hands over its processor time, collection included."""
    if hasattr(session.config, "workeroutput"):
        session.config.workeroutput[PROCESSOR] = processor_seconds()


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    """Take the processor time of a worker that has ended."""
    _workers.append(getattr(node, "workeroutput", {}).get(PROCESSOR, 0.0))


def tier_of(config: Any) -> str | None:
    """The tier that a run belongs to by its selection of markers; None for others, such as those of an extra."""
    chosen = config.option.markexpr
    if chosen and chosen in config.getini("addopts"):
        return "default"
    return "validate" if chosen.startswith("slow and not repeated") else None


def over_budget(minutes: float, tier: str | None) -> str:
    """What is said of a run that took more processor time than its tier may; empty otherwise."""
    if tier is None or minutes <= BUDGETS[tier]:
        return ""
    return (
        f"{minutes:.1f} minutes of processor time are more than the {BUDGETS[tier]:g} of the tier {tier!r}: "
        "make the dearest files cheaper, or move what they can spare to a slower tier"
    )


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """Show the tables, each where it has something to say."""
    reports = [r for found in terminalreporter.stats.values() for r in found if hasattr(r, "when")]
    _show_counts(terminalreporter, reports)
    minutes = (sum(_workers) if _workers else processor_seconds()) / 60.0
    said = over_budget(minutes, tier_of(terminalreporter.config))
    seconds = seconds_of_files(reports)
    if sum(seconds.values()) < LONG_RUN and not said:
        return
    spent = processor_seconds_of_files(reports)
    terminalreporter.section("dearest files (s of processor time; s of all workers together)")
    for name, processor in spent.most_common(FILES_SHOWN):
        terminalreporter.write_line(f"{processor:8.1f} {seconds[name]:8.1f} {name}")
    terminalreporter.write_line(f"{sum(spent.values()):8.1f} {sum(seconds.values()):8.1f} all {len(seconds)} files")
    terminalreporter.write_line(f"{minutes:8.1f} minutes of processor time, collection included")
    if said:
        terminalreporter.write_line(said, red=True)


def processor_seconds_of_files(reports: Iterable[Any]) -> Counter[str]:
    """Processor time of the tests of each file; processes that outlive a test, as idle workers do, are not in it."""
    seconds: Counter[str] = Counter()
    for report in reports:
        seconds[report.nodeid.partition("::")[0]] += dict(getattr(report, "user_properties", ())).get(PROCESSOR, 0.0)
    return seconds


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
            total.update(dict(getattr(report, "user_properties", ())).get("counted", {}))
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
