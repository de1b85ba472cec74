"""A run that could not be created leaves nothing, and promises nothing."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
from pathlib import Path
from typing import Any

import pytest

import flocking as fk
from flocking.engine.storage import run_writer
from flocking.engine.storage.stored_runs import write_run
from flocking.errors import StorageError
from tests.engine.storage.stored_runs import assert_same, finished, scenario


def test_what_a_kill_left_of_a_creation_is_removed(tmp_path: Path) -> None:
    run = finished()
    with subprocess.Popen(["true"]) as gone:
        pass
    left, alive = tmp_path / f".run.{gone.pid}.partial", tmp_path / f".run.{os.getppid()}.partial"
    for folder in (left, alive):
        folder.mkdir()
        (folder / "scenario.json").write_text("{}")
    write_run(run, tmp_path / "first")
    assert left.exists(), "somebody on another machine may be at work there"
    for path in (left / "scenario.json", left, alive / "scenario.json", alive):
        os.utime(path, (0, 0))
    write_run(run, tmp_path / "second")
    assert not left.exists()
    assert alive.exists()


def test_a_disk_full_at_creation_promises_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(handle: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("flocking.engine.storage.atomic_files.os.fsync", full)
    with pytest.raises(StorageError, match="Nothing was written") as caught:
        write_run(finished(), tmp_path / "run")
    assert "resume" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_an_interrupt_waits_until_a_run_is_created(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    put = run_writer.put

    def interrupted(*given: Any, **options: Any) -> int:
        signal.raise_signal(signal.SIGINT)
        return put(*given, **options)

    with monkeypatch.context() as patched:
        patched.setattr(run_writer, "put", interrupted)
        with pytest.raises(KeyboardInterrupt):
            fk.simulate(scenario(), save=tmp_path / "run", progress=False)
    assert list(tmp_path.iterdir()) == [tmp_path / "run"]
    assert_same(fk.resume(tmp_path / "run", progress=False), finished())
