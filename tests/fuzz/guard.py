"""What every fuzz case must keep: its deadline, its share of memory, its folder, and the family of errors."""

from __future__ import annotations

import contextlib
import os
import resource
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from flocking.errors import FlockingError
from tests.counting import count, counted

DEADLINE = 20.0
"""Seconds of processor time that a case may take."""

WAITING = 300.0
"""Seconds that a case may take in all: on a busy machine it gets little of the processor."""

ROOM = 2 * 2**30
"""Address space in bytes that a case may ask for beyond what the process has."""

DEFAULT = {
    "files": 50, "formulas": 60, "constructors": 100, "calls": 30, "commands": 15, "stored runs": 8,
    "sweep files": 30, "stored sweeps": 40, "sampled audits": 6, "damaged audits": 5,
}  # fmt: skip
"""Cases of each kind in the default tests: fewer of the kinds whose cases compile a law."""

SLOW = {
    "files": 2400, "formulas": 1600, "constructors": 3000, "calls": 1000, "commands": 1200, "stored runs": 800,
    "sweep files": 1200, "stored sweeps": 1200, "sampled audits": 300, "damaged audits": 500,
}  # fmt: skip
"""Cases of each kind in `make fuzz` and `make robustness TIER=slow`."""


@contextlib.contextmanager
def guarded(kind: str) -> Iterator[None]:
    """Run a case: errors of the library's family are fine, everything else goes through as a failure."""
    count(f"fuzz: {kind}")

    def ring(*_: object) -> None:
        pytest.fail(
            f"longer than {DEADLINE} s of processor time, or {WAITING} s in all"
        )  # no `except Exception` catches it

    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    pages = int(Path("/proc/self/statm").read_text().split()[0]) if os.path.exists("/proc/self/statm") else 0
    before = [(number, signal.signal(number, ring)) for number in (signal.SIGPROF, signal.SIGALRM)]
    signal.setitimer(signal.ITIMER_PROF, DEADLINE)
    signal.setitimer(signal.ITIMER_REAL, WAITING)
    if pages:
        resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + ROOM, hard))
    try:
        yield
    except FlockingError as error:
        assert str(error).strip(), type(error)
        assert len(str(error)) < 20_000, type(error)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.setitimer(signal.ITIMER_REAL, 0)
        for number, handler in before:
            signal.signal(number, handler)
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def interrupted_after(seconds: float, work: Callable[[], Any]) -> Any:
    """Result of ``work``, or None where Ctrl-C ended it: what may rightly take long must end soon after."""
    running, result, begin = True, None, time.monotonic()

    def press(*_: object) -> None:
        if running:
            signal.raise_signal(signal.SIGINT)

    before = signal.signal(signal.SIGALRM, press)
    signal.setitimer(signal.ITIMER_REAL, seconds, 2.0)
    try:
        try:
            result = work()
            running = False
        except KeyboardInterrupt:
            running = False
    finally:
        running = False
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert time.monotonic() - begin < seconds + DEADLINE
    return result


def fuzz(kind: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Make a function of ``data`` a test with the kind's share of cases, and a repetition with many more."""

    def make(function: Callable[..., None]) -> Callable[..., None]:
        @pytest.mark.parametrize("cases", [DEFAULT[kind], pytest.param(SLOW[kind], marks=pytest.mark.repeated)])
        def test(cases: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
            monkeypatch.chdir(tmp_path)
            before = counted[f"fuzz: {kind}"]

            @settings(
                max_examples=cases,
                deadline=None,
                suppress_health_check=list(HealthCheck),
                database=None,
                phases=[Phase.generate],
            )
            @given(data=st.data())
            def run(data: Any) -> None:
                function(data, tmp_path)

            run()
            assert counted[f"fuzz: {kind}"] - before >= cases

        test.__doc__ = function.__doc__
        return test

    return make


def files_below(folder: Path) -> set[str]:
    """Every path below a folder."""
    return {str(p.relative_to(folder)) for p in folder.rglob("*")}
