"""How commands end, where the machine is slow or a signal comes at a bad moment."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

import flocking as fk
from tests.engine.storage.stored_runs import finished

BUSY = """
import sys, time
import zarr.core.sync as sync
from flocking.engine.storage.stored_runs import read_run
read_run(sys.argv[1])
sync.loop[0].call_soon_threadsafe(time.sleep, 1.0)
"""


def test_the_end_waits_for_the_thread_of_zarr(whole: Path) -> None:
    found = subprocess.run([sys.executable, "-c", BUSY, str(whole)], capture_output=True, text=True, check=False)
    assert (found.returncode, found.stderr) == (0, "")


LOST = """
import signal, sys, time
from flocking.apps.process import ended_by_signals
class Late:
    def __del__(self):
        signal.raise_signal(signal.SIGINT)
        time.sleep(0)
with ended_by_signals():
    try:
        Late()
        for k in range(6000):
            time.sleep(0.01)
    except KeyboardInterrupt:
        print("interrupted")
"""


def test_an_interrupt_that_falls_into_a_destructor_is_not_lost() -> None:
    found = subprocess.run([sys.executable, "-c", LOST], capture_output=True, text=True, check=False)
    assert (found.returncode, found.stdout, found.stderr) == (0, "interrupted\n", "")


DEAF = """
import signal, threading
from flocking.apps.process import ended_by_signals
from flocking.study.sweeps.worker_pool import without_interrupts
with ended_by_signals():
    try:
        with without_interrupts():
            signal.raise_signal(signal.SIGTERM)
        threading.Event().wait(60)
    except KeyboardInterrupt:
        print("interrupted")
"""


def test_sigterm_while_worker_processes_begin_is_not_lost() -> None:
    found = subprocess.run([sys.executable, "-c", DEAF], capture_output=True, text=True, check=False)
    assert (found.returncode, found.stdout, found.stderr) == (0, "interrupted\n", "")


HALF = """
import signal, sys
from flocking.apps.process import ended_by_signals
class Half:
    def __init__(self):
        signal.raise_signal(signal.SIGINT)
        self.handle = 1
    def __del__(self):
        self.handle
kept = []
with ended_by_signals(for_good=True):
    try:
        Half()
    except KeyboardInterrupt as error:
        print("interrupted")
        kept = [error] if sys.argv[1] == "late" else []
"""


@pytest.mark.parametrize("when", ["soon", "late"])
def test_what_an_interrupt_left_half_made_goes_quietly(when: str) -> None:
    found = subprocess.run([sys.executable, "-c", HALF, when], capture_output=True, text=True, check=False)
    assert (found.returncode, found.stdout, found.stderr) == (0, "interrupted\n", "")


AFTER = """
import os, signal, sys, time
from flocking.apps import cli
sys.argv = ["flocking", "cache"]
cli.main()
os.kill(os.getpid(), {number})
time.sleep(60)
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_after_the_work_ends_quietly(number: signal.Signals) -> None:
    words = [sys.executable, "-c", AFTER.format(number=int(number))]
    found = subprocess.run(words, capture_output=True, text=True, check=False)
    assert (found.returncode, found.stderr) == (130, "")


def test_an_interrupt_before_the_first_picture_of_a_film_is_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("matplotlib.animation.PillowWriter.grab_frame", stop)
    with pytest.raises((KeyboardInterrupt, IndexError)) as caught:
        fk.animate(finished(), tmp_path / "film.gif", seconds=0.1)
    assert caught.type is KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []
