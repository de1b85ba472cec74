"""Interrupts and failures within Zarr: they end the call that they meet, and no later one waits for them."""

from __future__ import annotations

import concurrent.futures._base as futures
import os
import random
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import zarr.core.sync as zarr_sync

import flocking as fk
from flocking.engine.storage.stored_runs import read_run, write_run
from flocking.engine.storage.zarr_thread import zarr_calls
from tests.counting import count
from tests.engine.storage.stored_runs import finished

NEVER = 120.0
"""Seconds after which a reading counts as one that never ends, on a busy machine."""


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A stored run."""
    return write_run(finished(), tmp_path_factory.mktemp("stored") / "run")


def assert_readable(stored: Path) -> None:
    """It is read in good time: in a thread of its own, as one that waits for ever cannot be ended."""
    found: list[fk.Run] = []
    reader = threading.Thread(target=lambda: found.append(read_run(stored)), daemon=True)
    reader.start()
    reader.join(NEVER)
    assert found, "the reading does not end"
    assert np.array_equal(found[0].q, finished().q)


def test_an_interrupt_that_leaves_a_lock_held_does_not_stop_later_readings(
    stored: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The lock that Zarr's thread needs to hand over its result."""
    read_run(stored)
    enter, left = futures._AcquireFutures.__enter__, [1]

    def interrupted(self: futures._AcquireFutures) -> None:
        enter(self)
        if left and threading.current_thread() is threading.main_thread():
            left.clear()
            raise KeyboardInterrupt

    monkeypatch.setattr(futures._AcquireFutures, "__enter__", interrupted)
    with pytest.raises(KeyboardInterrupt):
        read_run(stored)
    assert_readable(stored)


@pytest.mark.parametrize("moments", [25, pytest.param(100, marks=pytest.mark.repeated)])
def test_interrupts_at_moments_of_a_reading(stored: Path, moments: int) -> None:
    begin = time.perf_counter()
    read_run(stored)
    longest, met = time.perf_counter() - begin, 0
    rng = random.Random(moments)
    # A timer's signal, as another thread would get its turn late.
    before = signal.signal(signal.SIGALRM, lambda *_: signal.raise_signal(signal.SIGINT))
    try:
        while met < moments:
            try:
                signal.setitimer(signal.ITIMER_REAL, rng.uniform(1e-4, longest))
                read_run(stored)
                signal.setitimer(signal.ITIMER_REAL, 0.0)
            except KeyboardInterrupt:
                met += 1
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    count("interrupts of the reading of a stored run", met)
    assert_readable(stored)


def test_ctrl_c_waits_for_the_end_of_a_call() -> None:
    done = []

    def called() -> None:
        with zarr_calls():
            os.kill(os.getpid(), signal.SIGINT)
            done.append(True)

    with pytest.raises(KeyboardInterrupt):
        called()
    assert done


@pytest.mark.filterwarnings("ignore:coroutine 'open_group' was never awaited")
def test_a_thread_that_could_not_be_started_is_started_later(stored: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    zarr_sync.cleanup_resources()
    start, left = threading.Thread.start, [1]

    def starved(self: threading.Thread) -> None:
        if left and self.name == "zarr_io":
            left.clear()
            raise RuntimeError("can't start new thread")
        start(self)

    monkeypatch.setattr(threading.Thread, "start", starved)
    with pytest.raises(fk.StorageError, match="memory"):
        read_run(stored)
    assert_readable(stored)


ENDS = """
import threading
from flocking.engine.storage.stored_runs import read_run
from flocking.errors import StorageError
def starved(self):
    raise RuntimeError("can't start new thread")
threading.Thread.start = starved
try:
    read_run({stored!r})
except StorageError as error:
    print(error)
"""


def test_a_process_whose_thread_could_not_be_started_ends(stored: Path) -> None:
    code = ENDS.format(stored=str(stored))
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=600)
    assert ended.returncode == 0
    assert "Traceback" not in ended.stderr, ended.stderr
    assert "memory" in ended.stdout
