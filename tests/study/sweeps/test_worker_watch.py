"""Workers that do nothing end a sweep with their names; those that work, or were stopped, do not."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import pytest

import flocking as fk
from flocking.study.sweeps import worker_watch
from flocking.study.sweeps.scheduler import _scratch_folder
from flocking.study.sweeps.worker_pool import LocalProcesses
from flocking.study.sweeps.worker_watch import LOOK_SECONDS, WorkerWatch, processor_time
from tests.study.sweeps.sweep_cases import make, waiting


def wait_for(path: Path) -> None:
    deadline = time.monotonic() + 600
    while not path.exists():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def test_a_run_that_waits_without_end_ends_the_sweep_which_names_it_and_its_worker(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(worker_watch, "LOOK_SECONDS", 0.05)

    def hurry() -> None:
        wait_for(tmp_path / "waits")
        monkeypatch.setattr(worker_watch, "STALL_SECONDS", 0.5)

    hurried = threading.Thread(target=hurry)
    hurried.start()
    with pytest.raises(fk.FlockingError) as error:
        fk.sweep(waiting(tmp_path), grid={"speed": [1.0]}, seeds=range(3), workers=2, measures=[], progress=False)
    hurried.join()
    process = int((tmp_path / "waits").read_text())
    assert re.search(rf"\b{process} \(run 1\)", str(error.value)), error.value
    assert "run the same sweep again" in str(error.value)
    assert not Path("/proc", str(process)).exists(), "it was left"


def test_what_waits_for_no_process_at_all_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worker_watch, "LOOK_SECONDS", 0.01)
    monkeypatch.setattr(worker_watch, "STALL_SECONDS", 0.05)
    with pytest.raises(fk.FlockingError, match="No worker process is left"):
        LocalProcesses(2).first_ended([Future()])


def test_one_process_waits_for_nobody() -> None:
    assert fk.sweep(make, grid={"speed": [1.0]}, workers=1, measures=[], progress=False).complete


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The time, and the processor time of the workers."""
    now = [0.0, 0.0]
    monkeypatch.setattr(worker_watch.time, "monotonic", lambda: now[0])
    return now


def test_only_time_without_work_counts(clock: list[float]) -> None:
    watch = WorkerWatch(lambda: clock[1])
    watch.begin()
    for expected, work in ((5.0, 0.0), (10.0, 0.0), (0.0, 1.0), (5.0, 0.0), (10.0, 0.05), (0.0, 0.06)):
        clock[0] += 5.0
        clock[1] += work
        assert watch.idle() == expected


def test_time_in_which_all_were_stopped_does_not_count(clock: list[float]) -> None:
    watch = WorkerWatch(lambda: clock[1])
    watch.begin()
    clock[0] += 86400.0
    assert watch.idle() == 2 * LOOK_SECONDS


def test_where_nothing_is_known_workers_work(clock: list[float]) -> None:
    watch = WorkerWatch(lambda: None)
    watch.begin()
    clock[0] += 5.0
    assert watch.idle() == 0.0


BUSY = "import subprocess, sys; subprocess.run([sys.executable, '-c', 'while True: pass'])"


def test_processor_time_is_that_of_a_process_and_of_those_that_it_started() -> None:
    asleep = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(3600)"])
    busy = subprocess.Popen([sys.executable, "-c", BUSY], start_new_session=True)
    try:
        deadline = time.monotonic() + 600
        while (processor_time([busy.pid]) or 0.0) < 0.5:
            assert time.monotonic() < deadline
            time.sleep(0.05)
        assert processor_time([]) == 0.0
        assert (processor_time([asleep.pid]) or 0.0) < 0.5
    finally:
        os.killpg(busy.pid, 9)
        asleep.kill()
        busy.wait()
        asleep.wait()


@pytest.mark.parametrize("call", ["mkdir", "rmdir"])
def test_an_interrupt_while_the_scratch_folder_is_made_or_removed_leaves_nothing(
    call: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    original = getattr(os, call)

    def struck(*given: Any, **how: Any) -> None:
        original(*given, **how)
        signal.raise_signal(signal.SIGINT)

    def scratch() -> None:
        with _scratch_folder():
            assert len(list(tmp_path.iterdir())) == 1

    monkeypatch.setattr(os, call, struck)
    with pytest.raises(KeyboardInterrupt):
        scratch()
    assert list(tmp_path.iterdir()) == []
