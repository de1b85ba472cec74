"""Watches worker processes: workers that do nothing, while runs wait for them, end a sweep with an error."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path

LOOK_SECONDS = 5.0
"""Seconds between two looks at the workers while no result arrives."""

STALL_SECONDS = 600.0
"""Workers that use almost no processor time for so many seconds, while runs wait for them, count as stuck."""

WORK_SECONDS = 0.1
"""Seconds of processor time that show that workers are at work."""


class WorkerWatch:
    """Measures for how long workers have done nothing.

    Parameters
    ----------
    spent
        Gives the processor time of all workers so far, in seconds; None where it is unknown, which counts as work.
    """

    def __init__(self, spent: Callable[[], float | None]) -> None:
        self._spent = spent
        self._base: float | None = None
        self._idle = 0.0
        self._looked = time.monotonic()

    def begin(self) -> None:
        """Begin to wait for the workers, which may have had nothing to do before."""
        self._base, self._idle, self._looked = self._spent(), 0.0, time.monotonic()

    def idle(self) -> float:
        """Seconds for which the workers have done nothing, as of this look."""
        now, spent = time.monotonic(), self._spent()
        # A process that was stopped, and its workers with it, has not looked for long.
        self._idle += min(now - self._looked, 2 * LOOK_SECONDS)
        self._looked = now
        if spent is None or self._base is None or abs(spent - self._base) > WORK_SECONDS:
            self._base, self._idle = spent, 0.0
        return self._idle


def processor_time(processes: Iterable[int]) -> float | None:
    """Processor time in seconds of processes and of those that they started; None where the system has none.

    Parameters
    ----------
    processes
        Process ids; those that have ended count as zero.
    """
    parents: dict[int, int] = {}
    seconds: dict[int, float] = {}
    try:
        names = os.listdir("/proc")
        ticks = os.sysconf("SC_CLK_TCK")
    except (OSError, ValueError, AttributeError):
        return None
    for name in filter(str.isdigit, names):
        with suppress(OSError, ValueError, IndexError):  # It has ended.
            # The name of a program may contain anything, also blanks and brackets.
            fields = Path("/proc", name, "stat").read_text(errors="replace").rpartition(")")[2].split()
            parents[int(name)] = int(fields[1])
            # User and system time, of the process and of ended processes that it started.
            seconds[int(name)] = sum(map(int, fields[11:15])) / ticks
    if not seconds:
        return None
    tree = set(processes)
    grown = True
    while grown:
        further = {child for child, parent in parents.items() if parent in tree} - tree
        tree |= further
        grown = bool(further)
    return sum(seconds.get(process, 0.0) for process in tree)
