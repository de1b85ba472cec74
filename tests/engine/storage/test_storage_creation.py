"""A run that could not be created leaves nothing, and promises nothing."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import flocking as fk
from flocking.engine.storage import left_overs, run_writer
from flocking.engine.storage.atomic_files import complete_folder, write_file
from flocking.engine.storage.export_formats import export_run
from flocking.engine.storage.stored_runs import write_run
from flocking.errors import StorageError
from tests.engine.storage.stored_runs import assert_same, finished, scenario

YOUNG = -1e5
"""Age in seconds of what was just written: in the future, so that a slow machine does not let it become old."""


def left_by(process: int, name: str, place: Path, age: float) -> Path:
    """A partly written folder of a process, last written before so many seconds."""
    folder = place / f".{name}.{process}.partial"
    folder.mkdir()
    (folder / "scenario.json").write_text("{}")
    for path in (folder / "scenario.json", folder):
        os.utime(path, (time.time() - age,) * 2)
    return folder


@pytest.fixture
def alive() -> Iterator[int]:
    """A process that began a moment ago and goes on."""
    with subprocess.Popen(["sleep", "600"]) as process:
        yield process.pid
        process.kill()


def test_what_a_kill_left_of_a_creation_is_removed(tmp_path: Path) -> None:
    with subprocess.Popen(["true"]) as gone:
        pass
    young, old = left_by(gone.pid, "young", tmp_path, YOUNG), left_by(gone.pid, "old", tmp_path, 1e6)
    write_run(finished(), tmp_path / "run")
    assert young.exists(), "somebody on another machine may be at work there"
    assert not old.exists()


def test_a_leftover_with_the_number_of_this_process_is_in_nobodys_way(tmp_path: Path) -> None:
    """In a container a command that is begun again has the number that it had before."""
    young = left_by(os.getpid(), "run", tmp_path, YOUNG)
    assert_same(fk.simulate(scenario(), save=tmp_path / "run", progress=False), finished())
    assert young.exists(), "a process of another container with the same number may be at work there"
    for path in (young / "scenario.json", young):
        os.utime(path, (0, 0))
    write_run(finished(), tmp_path / "second")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run", "second"]


def test_a_folder_that_this_process_is_making_is_not_left_over(tmp_path: Path) -> None:
    with complete_folder(tmp_path / "slow") as under_way:
        os.utime(under_way, (0, 0))
        write_run(finished(), tmp_path / "run")
        assert under_way.exists()
    os.utime(tmp_path / "slow", (0, 0))
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run", "slow"]


def test_a_process_that_began_later_did_not_make_it(
    tmp_path: Path, alive: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = left_by(alive, "before", tmp_path, 600)
    write_run(finished(), tmp_path / "first")
    assert before.exists() == (not sys.platform.startswith("linux"))
    monkeypatch.setattr(left_overs, "MAKING", -1e6)
    since = left_by(alive, "since", tmp_path, 0)
    write_run(finished(), tmp_path / "second")
    assert since.exists()


def test_without_the_age_of_processes_one_that_lives_keeps_what_has_its_number(
    tmp_path: Path, alive: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(left_overs, "process_age", lambda process: None)
    kept = left_by(alive, "kept", tmp_path, 600)
    write_run(finished(), tmp_path / "run")
    assert kept.exists()


def test_the_age_of_a_process_is_the_time_since_it_began() -> None:
    before = time.monotonic()
    with subprocess.Popen(["sleep", "600"]) as process:
        begun = time.monotonic()
        time.sleep(0.3)
        least = time.monotonic() - begun
        age = left_overs.process_age(process.pid)
        most = time.monotonic() - before
        process.kill()
    if sys.platform.startswith("linux"):
        assert age is not None
        assert least - 0.02 <= age <= most + 0.02  # The system counts in hundredths of a second.
    else:
        assert age is None
    assert left_overs.process_age(process.pid) is None


@pytest.mark.parametrize("form", ["csv", "npz", "xyz", "parquet", "gsd"])
def test_what_a_kill_left_of_an_export_is_removed(form: str, tmp_path: Path) -> None:
    if form in ("parquet", "gsd"):
        pytest.importorskip({"parquet": "pyarrow", "gsd": "gsd"}[form])
    check_left_over_files(tmp_path, f"run.{form}", f"run.{form}.{{}}.partial", export_run)


def test_what_a_kill_left_of_a_single_file_is_removed(tmp_path: Path) -> None:
    check_left_over_files(tmp_path, "a.json", "a.json.{}.partial", lambda _, path: write_file(path, b"{}", "write it"))


def check_left_over_files(place: Path, name: str, left: str, write: Callable[[fk.Run, Path], object]) -> None:
    """Writing a file removes the abandoned partial files of this name, and nothing else."""
    with subprocess.Popen(["true"]) as gone:
        pass
    old = [place / left.format(gone.pid), place / f"{left.format(2**31)}{(place / name).suffix}"]
    others = [place / f"other.{gone.pid}.partial", place / left.format("draft"), place / left.format(f"2.{gone.pid}")]
    for path in (*old, *others):
        path.write_bytes(b"x")
        os.utime(path, (0, 0))
    write(finished(), place / name)
    assert sorted(place.iterdir()) == sorted([place / name, *others])
    old[0].write_bytes(b"x")
    os.utime(old[0], (time.time() - YOUNG,) * 2)
    write(finished(), place / name)
    assert old[0].exists(), "somebody on another machine may be writing it"


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
