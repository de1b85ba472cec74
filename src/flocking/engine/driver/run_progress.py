"""Progress of many runs on a terminal or below a notebook's cell: runs done, failures and the time left."""

from __future__ import annotations

import time
from types import TracebackType
from typing import TYPE_CHECKING

from flocking.engine.driver.notebook_line import line_of_notebook
from flocking.engine.driver.progress import QUIET_SECONDS

if TYPE_CHECKING:
    from rich.progress import Progress as Bar
    from rich.progress import TaskID

SPEED_SECONDS = 120
"""Seconds of the past whose runs the time left is computed from: runs differ, and the load of a machine changes."""


class Progress:
    """A bar on a terminal, a line below a notebook's cell; nothing elsewhere.

    Parameters
    ----------
    enabled
        Whether to show it.
    total, done
        Number of runs, and how many were done before.
    """

    def __init__(self, enabled: bool, total: int, done: int) -> None:
        self._enabled, self._total, self._done = enabled, total, done
        self._failed = 0
        self._bar: Bar | None = None
        self._task: TaskID | None = None
        self._below_cell = line_of_notebook() if enabled else None
        self._begin, self._new = time.monotonic(), 0

    def __enter__(self) -> Progress:
        if not self._enabled or self._below_cell is not None:
            return self
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
        from rich.progress import Progress as Bar

        console = Console(stderr=True)
        if not console.is_terminal:
            return self
        columns = (
            TextColumn("runs"), BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[failed]}"),
            TimeElapsedColumn(), TextColumn("left"), TimeRemainingColumn(),
        )  # fmt: skip
        self._bar = Bar(*columns, console=console, transient=True, speed_estimate_period=SPEED_SECONDS)
        self._task = self._bar.add_task("runs", total=self._total, completed=self._done, failed="")
        self._bar.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        if self._bar is not None:
            self._bar.stop()

    def advance(self, done: int, failed: int) -> None:
        """Count ``done`` runs, some of which failed."""
        self._failed += failed
        self._new += done
        if self._below_cell is not None:
            self._say()
        if self._bar is not None and self._task is not None:
            text = f"{self._failed} failed" if self._failed else ""
            self._bar.update(self._task, advance=done, failed=text)

    def _say(self) -> None:
        passed = time.monotonic() - self._begin
        if self._below_cell is None or passed < QUIET_SECONDS:
            return
        done = self._done + self._new
        text = f"runs: {done} of {self._total}" + (f", {self._failed} failed" if self._failed else "")
        left = f", about {passed * (self._total - done) / self._new:.0f} s left" if self._new else ""
        self._below_cell.say(text + left)
