"""Processes that need the same code: one compiles it, the others wait, and none waits for ever."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import pytest

from flocking.formula import cache
from flocking.formula.native import objects, one_compiler
from flocking.formula.native.one_compiler import one_compiler as held_by_one

fcntl = pytest.importorskip("fcntl", reason="this system has no file locks")

COMPILING = """
import sys, time
from pathlib import Path
from flocking.formula.native import objects

made = Path(sys.argv[1])

def make():
    (made / f"{len(list(made.iterdir()))}").touch()
    time.sleep(0.5)  # the others begin meanwhile
    return "", (), ()

objects.object_code = lambda text: b"code"
objects._loaded = lambda name, code: (1, 2)
print("begun", flush=True)
sys.stdin.readline()
print(objects.addresses_of("f", "key", make, None))
"""


def test_of_several_processes_one_compiles(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("FLOCKING_CACHE", str(tmp_path / "cache"))
    (made := tmp_path / "made").mkdir()
    several = [
        subprocess.Popen(
            [sys.executable, "-c", COMPILING, str(made)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        for _ in range(3)
    ]
    for process in several:  # all are there before one begins
        assert process.stdout is not None
        assert process.stdout.readline() == "begun\n"
    for process in several:
        assert process.stdin is not None
        process.stdin.write("\n")
        process.stdin.flush()
    assert [process.communicate()[0] for process in several] == ["(1, 2, ())\n"] * 3
    assert len(list(made.iterdir())) == 1
    assert [path.suffix for path in (tmp_path / "cache").rglob("*") if path.is_file()] == [".o"]


def test_a_stopped_process_is_waited_for_a_while(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(one_compiler, "LONGEST_WAIT", 0.2)
    holder = "import sys; from pathlib import Path; from flocking.formula.native.one_compiler import one_compiler\n"
    holder += "with one_compiler(Path(sys.argv[1])): print('held', flush=True); sys.stdin.readline()"
    path = tmp_path / "code.o"
    with subprocess.Popen(
        [sys.executable, "-c", holder, str(path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        begun = time.monotonic()
        with held_by_one(path):
            assert time.monotonic() - begun >= 0.2
        process.kill()
        process.wait()
        handle = one_compiler._lock(path.with_suffix(".lock"))
        assert handle is not None, "the lock of a killed process is free"
        one_compiler._unlock(handle)
    path.with_suffix(".lock").unlink()
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("reason", ["no locks", "a folder that is none"])
def test_without_a_lock_code_is_compiled_all_the_same(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, reason: str
) -> None:
    path = tmp_path / "file" / "code.o"
    if reason == "no locks":

        def refuse(handle: int, how: int) -> None:
            raise OSError(37, "No locks available")

        monkeypatch.setattr(fcntl, "flock", refuse)
    else:
        (tmp_path / "file").touch()
    with held_by_one(path):
        pass


def test_an_abandoned_lock_counts_as_part_of_the_cache(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    folder = tmp_path / "cache"
    monkeypatch.setenv("FLOCKING_CACHE", str(folder))
    path = objects._path("f", "key").with_suffix(".lock")
    path.parent.mkdir(parents=True, mode=0o700)
    folder.chmod(0o700)
    path.touch()
    assert cache.contents().files == 1
    cache.clear()
    assert not path.exists()
