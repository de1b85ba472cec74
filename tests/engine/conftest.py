"""Tests that compile exported C need a compiler; without one they are left out, which is said."""

from __future__ import annotations

import pytest

from tests.engine.c_export.building import COMPILER

LEFT_OUT: list[str] = []


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if COMPILER is None:
        left = [item for item in items if item.get_closest_marker("compiler")]
        LEFT_OUT.extend(item.nodeid for item in left)
        config.hook.pytest_deselected(items=left)
        items[:] = [item for item in items if item not in left]


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    if LEFT_OUT:
        terminalreporter.write_line(f"{len(LEFT_OUT)} tests need a C compiler and were left out: install gcc.")
