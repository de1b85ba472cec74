"""The end of a long run of the tests names the files that took longest."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace

import pytest

from tests import counting


class Terminal:
    """What pytest hands to its summary, as far as it is read."""

    def __init__(self, seconds: dict[str, float]) -> None:
        self.lines: list[str] = []
        reports = [report for name, each in seconds.items() for report in _reports(name, each)]
        self.stats = {"passed": reports[::2], "": reports[1::2], "warnings": [SimpleNamespace(nodeid="no report")]}

    def section(self, name: str) -> None:
        self.lines.append(name)

    def write_line(self, line: str) -> None:
        self.lines.append(line)


def _reports(name: str, seconds: float) -> Iterator[SimpleNamespace]:
    """Setup, call and teardown of one test of a file."""
    for when, part in (("setup", 0.25), ("call", 0.5), ("teardown", 0.25)):
        yield SimpleNamespace(nodeid=f"{name}::test", when=when, duration=part * seconds, user_properties=[])


def test_a_long_run_names_its_slowest_files_in_order() -> None:
    terminal = Terminal({f"tests/test_{k}.py": float(k) for k in range(40)})
    counting.pytest_terminal_summary(terminal)
    found = [line.split() for line in terminal.lines[1:]]
    assert [line[1] for line in found[:-1]] == [f"tests/test_{k}.py" for k in range(39, 39 - counting.FILES_SHOWN, -1)]
    assert found[0][0] == "39.0"
    assert found[-1][:3] == ["780.0", "all", "40"]


@pytest.mark.parametrize("seconds", [0.0, 1.0])
def test_a_short_run_names_none(seconds: float) -> None:
    terminal = Terminal({"tests/test_one.py": seconds})
    counting.pytest_terminal_summary(terminal)
    assert terminal.lines == []
