"""Times at which a session stops to report and save, and the progress report."""

from __future__ import annotations

import sys
import time
from typing import Any

import numpy as np

from flocking.engine.driver.notebook_line import line_of_notebook
from flocking.model.law import Scenario

QUIET_SECONDS = 2.0
"""Duration in seconds below which a run shows no progress."""
LINE_SECONDS = 10.0
"""Wall time in seconds between two lines, and before the first, if there is no terminal for a bar."""
STOPS = 100
"""Stops of a session for its progress, a percent apart."""


def stops(scenario: Scenario, now: float, *, often: bool) -> list[float]:
    """Times at which a session stops before the end of its scenario; ``often``: also at its frames.

    Parameters
    ----------
    now
        Time of the session.
    """
    times = np.linspace(scenario.start.t, scenario.t_end, STOPS + 1)
    if often:
        times = np.union1d(times, scenario.frame_times)
    return [float(t) for t in times if now < t < scenario.t_end] + [scenario.t_end]


class Progress:
    """A progress bar, or a line below a notebook's cell, shown only for runs that take some time.

    Parameters
    ----------
    enabled
        Whether to show anything.
    lines
        Whether to write lines instead if there is no terminal, as under ``mpiexec`` or in the log of a batch job.
    """

    def __init__(self, enabled: bool, scenario: Scenario, *, lines: bool = False) -> None:
        self._below_cell = line_of_notebook()
        self._lines = lines and not sys.stderr.isatty()
        self._enabled = enabled
        self._scenario = scenario
        self._begin = time.monotonic()
        self._shown_at = self._begin
        self._first: tuple[float, float] | None = None
        self._bar: Any = None
        self._task: Any = None

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def show(self, t: float, agent_steps: int, note: str = "") -> None:
        """Report the time reached.

        Parameters
        ----------
        agent_steps
            Number of steps so far times the number of agents.
        note
            Further text, such as the reason for a delay.
        """
        now = time.monotonic()
        if self._first is None:
            self._first = (now, t)
        if not self._enabled or now - self._begin < QUIET_SECONDS:
            return
        rate = f"{agent_steps / (now - self._begin):.3g} agent-steps/s" + (f", {note}" if note else "")
        if self._below_cell is not None:
            self._below_cell.say(self._line(t, rate, now))
            return
        if self._lines:
            if now - self._shown_at >= LINE_SECONDS:
                self._shown_at = now
                print(self._line(t, rate, now), file=sys.stderr, flush=True)
            return
        if self._bar is None:
            from rich.console import Console
            from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

            speed = TextColumn("{task.fields[rate]}")
            columns = (TextColumn("{task.description}"), BarColumn(), speed, TimeRemainingColumn())
            self._bar = Progress(*columns, console=Console(stderr=True), transient=True)
            self._task = self._bar.add_task(self._name, total=self._scenario.t_end - self._scenario.start.t, rate="")
            self._bar.start()
        self._bar.update(self._task, completed=t - self._scenario.start.t, rate=rate)

    @property
    def _name(self) -> str:
        return self._scenario.name or "simulation"

    def _line(self, t: float, rate: str, now: float) -> str:
        start, end = self._scenario.start.t, self._scenario.t_end
        assert self._first is not None
        begin, first = self._first
        left = f", about {(now - begin) * (end - t) / (t - first):.0f} s left" if t > first else ""
        return f"{self._name}: t = {t:g} of {end:g} ({100 * (t - start) / (end - start):.0f} %), {rate}{left}"
