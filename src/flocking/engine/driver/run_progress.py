"""Progress of many runs on a terminal's error stream: runs done, failures and the time left."""

from __future__ import annotations

from types import TracebackType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import Progress as Bar
    from rich.progress import TaskID


class Progress:
    """A bar on a terminal; nothing elsewhere.

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

    def __enter__(self) -> Progress:
        if not self._enabled:
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
        self._bar = Bar(*columns, console=console, transient=True, speed_estimate_period=120)
        self._task = self._bar.add_task("runs", total=self._total, completed=self._done, failed="")
        self._bar.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        if self._bar is not None:
            self._bar.stop()

    def advance(self, done: int, failed: int) -> None:
        """Count ``done`` runs, some of which failed."""
        self._failed += failed
        if self._bar is not None and self._task is not None:
            text = f"{self._failed} failed" if self._failed else ""
            self._bar.update(self._task, advance=done, failed=text)
