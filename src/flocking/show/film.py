"""Films as files that a notebook plays, and the progress of drawing them."""

from __future__ import annotations

import base64
import sys
import time
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from flocking.engine.driver.notebook_line import line_of_notebook

if TYPE_CHECKING:
    from rich.progress import Progress

QUIET_SECONDS = 2.0
"""Drawing that takes less shows no progress."""

LINE_SECONDS = 5.0
"""Seconds between two lines where there is no terminal for a bar."""

LARGEST_SHOWN = 30_000_000
"""Bytes of a film that is embedded in a notebook; a larger one is named."""


class Film(type(Path())):  # type: ignore[misc]
    """Path of a film, which a notebook plays."""

    def _repr_html_(self) -> str:
        """The film itself, unless it is large or gone."""
        path = Path(self)
        if not path.is_file() or path.stat().st_size > LARGEST_SHOWN:
            return f"<code>{escape(str(path))}</code>"
        data = base64.b64encode(path.read_bytes()).decode()
        if path.suffix == ".gif":
            return f'<img src="data:image/gif;base64,{data}" alt="film of a run">'
        return f'<video src="data:video/mp4;base64,{data}" controls loop muted playsinline></video>'


class Pictures:
    """Counts the pictures of a film: a bar on a terminal, else lines, once drawing takes some time.

    Parameters
    ----------
    shown
        Whether to show anything.
    total
        Number of pictures.
    """

    def __init__(self, shown: bool, total: int) -> None:
        self._shown, self._total, self._done = shown, total, 0
        self._begin = self._last = time.monotonic()
        self._bar: Progress | None = None
        self._below_cell = line_of_notebook()

    def __enter__(self) -> Pictures:
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def count(self) -> None:
        """Count a picture that is drawn."""
        self._done += 1
        now = time.monotonic()
        if not self._shown or now - self._begin < QUIET_SECONDS:
            return
        left = (now - self._begin) * (self._total - self._done) / self._done
        line = f"film: {self._done} of {self._total} pictures, about {left:.0f} s left"
        if self._below_cell is not None:
            self._below_cell.say(line)
            return
        if not sys.stderr.isatty():
            if now - self._last >= LINE_SECONDS:
                self._last = now
                print(line, file=sys.stderr, flush=True)
            return
        if self._bar is None:
            from rich.console import Console
            from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

            columns = (TextColumn("film"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
            self._bar = Progress(*columns, console=Console(stderr=True), transient=True)
            self._bar.add_task("film", total=self._total)
            self._bar.start()
        self._bar.update(self._bar.tasks[0].id, completed=self._done)
