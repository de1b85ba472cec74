"""Waits: how far work is that takes longer than two seconds, on a terminal, below a notebook's cell, or in a log.

A command opens a `Wait`; what it calls states with `counted` and `stage` what is done now, and imports no command.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Collection, Iterator
from contextvars import ContextVar, Token
from types import TracebackType
from typing import TYPE_CHECKING, Self, TypeVar

from flocking.engine.driver.notebook_line import line_of_notebook
from flocking.errors import escaped

if TYPE_CHECKING:
    from rich.progress import Progress as Bar

T = TypeVar("T")

QUIET_SECONDS = 2.0
"""Duration in seconds of a wait that shows nothing."""
LINE_SECONDS = 10.0
"""Wall time in seconds between two lines where there is no terminal for a bar."""
TICK_SECONDS = 0.5
"""Wall time in seconds between two looks at whether there is something to show: a line is late by at most this."""

BAR_WIDTH = 12
"""Characters of a bar: a line of 80 leaves most of its room for words, by convention."""


class Wait:
    """Progress of work on standard error: a bar on a terminal, a line below a notebook's cell, else sparse lines.

    It is shown while a single long step lasts, too, by a thread that looks at the clock; not below a cell, where output
    of threads goes astray.

    Parameters
    ----------
    title
        What is waited for.
    total
        Number of equal pieces of work, from which the time left is estimated; None where it is unknown.
    done
        How many were done before.
    unit
        What the pieces are, such as ``"runs"``.
    shown
        Whether to show anything.
    """

    def __init__(
        self, title: str, total: float | None = None, *, done: float = 0, unit: str = "", shown: bool = True
    ) -> None:
        # Names of scenarios may come from untrusted files, and lines go to terminals.
        self.title, self.total, self.done, self.unit = escaped(title), total, done, unit
        self.note = ""
        self.shown = shown
        self._estimated = self.counting = total is not None
        self._first = done
        self._begin = time.monotonic()
        self._said_at: float | None = None
        self._below_cell = line_of_notebook() if shown else None
        self._bar: Bar | None = None
        self._hidden = False
        self._lock = threading.Lock()
        self._ended = threading.Event()
        self._thread: threading.Thread | None = None
        self._outer: Token[Wait | None] | None = None

    def __enter__(self) -> Self:
        if not self.shown:
            return self
        outer = _OPEN.get()
        if outer is not None:
            outer.hide(True)
        self._outer = _OPEN.set(self)
        if self._below_cell is None:
            self._thread = threading.Thread(target=self._look, name=f"progress of {self.title}", daemon=True)
            self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        self._ended.set()
        if self._thread is not None:
            self._thread.join()
        self._stop_bar()
        if self._outer is not None:
            _OPEN.reset(self._outer)
            outer = _OPEN.get()
            if outer is not None:
                outer.hide(False)

    def hide(self, hidden: bool) -> None:
        """Show nothing while a wait within this one shows itself.

        Parameters
        ----------
        hidden
            Whether to be silent.
        """
        with self._lock:
            self._hidden = hidden
            self._stop_bar()

    def _stop_bar(self) -> None:
        if self._bar is not None:
            self._bar.stop()
            self._bar = None

    def stage(self, note: str, total: float | None = None, unit: str = "") -> None:
        """Begin another stage, of ``total`` pieces which may be unequal: no time left is shown.

        Parameters
        ----------
        note
            What is done now.
        total, unit
            As for the wait.
        """
        self.note, self.total, self.unit, self.done, self._estimated = note, total, unit, 0, False
        self.refresh()

    def count(self, done: float = 1, note: str | None = None) -> None:
        """Count ``done`` pieces of work.

        Parameters
        ----------
        done
            How many.
        note
            What is done now, or what came of it; as before when absent.
        """
        self.done += done
        self.note = self.note if note is None else note
        self.refresh()

    def more(self, pieces: float) -> None:
        """Wait for more pieces of work than before.

        Parameters
        ----------
        pieces
            How many more.
        """
        self.total = pieces + (self.total or 0)

    def refresh(self) -> None:
        """Show how far the work is, where there is something to show and the last time is long enough ago."""
        now = time.monotonic()
        if not self.shown or now - self._begin < QUIET_SECONDS:
            return
        try:
            with self._lock:
                self._show(now)
        except (OSError, ValueError):
            # Standard error was closed: the work goes on without.
            self.shown = False

    def line(self, now: float) -> str:
        """How far the work is, in a line; ``now`` is the reading of the clock."""
        passed = now - self._begin
        counted = "" if self.total is None else f"{self.done:g} of {self.total:g} {self.unit}".rstrip()
        new = self.done - self._first
        if self._estimated and self.total is not None:
            clock = f"about {passed * (self.total - self.done) / new:.0f} s left" if new > 0 else ""
        else:
            clock = f"{passed:.0f} s so far"
        return f"{self.title}: {', '.join(filter(None, (counted, self.note, clock)))}"

    def _show(self, now: float) -> None:
        if self._hidden:
            return
        if self._below_cell is not None:
            self._below_cell.say(self.line(now))
        elif sys.stderr is not None and sys.stderr.isatty():
            self._update_bar(now)
        elif self._said_at is None or now - self._said_at >= LINE_SECONDS:
            self._said_at = now
            print(self.line(now), file=sys.stderr, flush=True)

    def _look(self) -> None:
        """Refresh from time to time while the work lasts."""
        while not self._ended.wait(TICK_SECONDS):
            self.refresh()

    def _update_bar(self, now: float) -> None:
        if self._bar is None:
            from rich.console import Console
            from rich.progress import BarColumn, Progress, TextColumn
            from rich.table import Column

            one_line = Column(no_wrap=True, overflow="ellipsis")
            text = TextColumn("{task.description}", markup=False, table_column=one_line)
            # What is printed meanwhile goes on to standard output, which may be a file.
            self._bar = Progress(
                BarColumn(BAR_WIDTH), text, console=Console(stderr=True), transient=True, redirect_stdout=False
            )
            self._bar.add_task("", total=None)
            self._bar.start()
        task = self._bar.tasks[0]
        self._bar.update(task.id, description=self.line(now), total=self.total, completed=self.done)


_OPEN: ContextVar[Wait | None] = ContextVar("the wait that is open", default=None)


def stage(note: str) -> None:
    """State in the wait that is open what is done now; nothing where none is, or where pieces of it are counted.

    Parameters
    ----------
    note
        What is done now.
    """
    wait = _OPEN.get()
    if wait is not None and not wait.counting:
        wait.stage(note)


def counted(items: Collection[T], unit: str, name_of: Callable[[T], str] = str) -> Iterator[T]:
    """Go through pieces of work, counted in the wait that is open.

    Nothing is shown where none is open; pieces of a piece are not counted.

    Parameters
    ----------
    items
        The pieces.
    unit
        What they are, such as ``"claims"``.
    name_of
        Name of a piece.
    """
    wait = _OPEN.get()
    if wait is None or wait.counting:
        yield from items
        return
    wait.stage("", len(items), unit)
    wait.counting = True
    try:
        for number, item in enumerate(items):
            wait.done, wait.note = number, name_of(item)
            wait.refresh()
            yield item
    finally:
        wait.counting = False
