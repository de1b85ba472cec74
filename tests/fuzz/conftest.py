"""Prints how many cases were tried, also where several processes shared the work."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.fuzz.guard import tried


@pytest.fixture(autouse=True)
def _own_cache(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """Formulas nobody will see again do not belong in the user's cache."""
    monkeypatch.setenv("FLOCKING_CACHE", str(tmp_path_factory.getbasetemp() / "fuzz_cache"))


@pytest.fixture(autouse=True)
def _counted(record_property: Any) -> Any:
    before = dict(tried)
    yield
    record_property("fuzz_cases", {name: count - before.get(name, 0) for name, count in tried.items()})


def pytest_terminal_summary(terminalreporter: Any) -> None:
    total: dict[str, int] = {}
    for report in (r for reports in terminalreporter.stats.values() for r in reports):
        if getattr(report, "when", None) == "teardown" and Path(report.fspath).parent.name == "fuzz":
            for name, count in dict(report.user_properties).get("fuzz_cases", {}).items():
                total[name] = total.get(name, 0) + count
    parts = ", ".join(f"{count} {name}" for name, count in sorted(total.items()) if count)
    if parts:
        terminalreporter.write_line(f"fuzz: {sum(total.values())} cases ({parts})")
