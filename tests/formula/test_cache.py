"""The folder of generated code: what others may write is never executed, and no damage lasts."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from flocking.apps.cli import main
from flocking.errors import CacheError
from flocking.formula import cache, compiled
from tests.counting import count

NUMBERS = """from flocking.formula.native.functions import native


@native
def more(x):
    return x + {}
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache folder of its own."""
    monkeypatch.setenv("FLOCKING_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def module(text: str) -> Any:
    """The module of a source, as another process would find it."""
    compiled._modules.clear()
    for name in [n for n in sys.modules if n.startswith(cache.GENERATED)]:
        del sys.modules[name]
    return compiled.generated_module("cached", text, (), lambda: text, str)


@pytest.mark.parametrize("mode", [0o777, 0o775, 0o1777, 0o702, 0o720])
def test_a_folder_that_others_may_write_is_refused(folder: Path, mode: int) -> None:
    folder.mkdir()
    folder.chmod(mode)
    with pytest.raises(CacheError, match=f"{folder} may be written by .*chmod go-w"):
        module("value = 1\n")
    assert list(folder.iterdir()) == []


def test_a_folder_that_others_may_rename_is_refused(folder: Path) -> None:
    folder.parent.chmod(0o777)
    with pytest.raises(CacheError, match="every user may write and rename"):
        module("value = 1\n")


def test_a_folder_of_ours_is_made_for_us_alone(folder: Path) -> None:
    assert module("value = 1\n").value == 1
    assert folder.stat().st_mode & 0o077 == 0
    assert all(p.stat().st_mode & 0o077 == 0 for p in folder.rglob("*"))


def test_a_file_that_others_may_write_is_made_anew(folder: Path) -> None:
    name = module("value = 2\n").__name__
    path = folder / f"{name}.py"
    for mode in (0o666, 0o664, 0o602, 0o620):
        path.chmod(mode)
        assert module("value = 2\n").value == 2
        assert path.stat().st_mode & 0o077 == 0


def test_planted_files_are_not_executed(folder: Path) -> None:
    """A module that says something else, with or without a digest of its own, and Python's cache of compiled files."""
    name = module("value = 3\n").__name__
    path = folder / f"{name}.py"
    path.write_text("value = 4\n")
    assert module("value = 3\n").value == 3
    cache.write_text(path, "value = 4\n")
    assert module("value = 3\n").value == 3
    import py_compile

    evil = folder / "evil.py"
    evil.write_text("value = 4\n")
    pyc = folder / "__pycache__" / f"{name}.{sys.implementation.cache_tag}.pyc"
    py_compile.compile(str(evil), cfile=str(pyc), invalidation_mode=py_compile.PycInvalidationMode.UNCHECKED_HASH)
    assert module("value = 3\n").value == 3


def test_modules_and_notes_cut_anywhere_are_made_anew(folder: Path) -> None:
    text = "".join(f"value_{k} = {k}\n" for k in range(60))
    module(text)
    for path in [p for p in folder.iterdir() if p.is_file()]:
        whole = path.read_bytes()
        for length in range(0, len(whole), 100):
            path.write_bytes(whole[:length])
            assert module(text).value_59 == 59
            assert path.read_bytes() == whole
            count("cache: files cut")


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What LLVM was asked to compile."""
    from flocking.formula.native import objects

    found: list[str] = []
    real = objects.object_code
    monkeypatch.setattr(objects, "object_code", lambda text: (found.append(text), real(text))[1])
    return found


@pytest.mark.parametrize("step", [400, pytest.param(20, marks=pytest.mark.repeated)])
def test_machine_code_cut_anywhere_is_made_anew(folder: Path, step: int, made: list[str]) -> None:
    text = NUMBERS.format(5)
    assert module(text).more(1) == 6
    (path,) = (folder / cache.MACHINE).rglob("*.o")
    whole = path.read_bytes()
    for length in range(0, len(whole), step):
        path.write_bytes(whole[:length])
        before = len(made)
        assert module(text).more(1) == 6
        assert len(made) == before + 1
        assert cache.read_code(path) is not None
        count("cache: files cut")
    before = len(made)
    assert module(text).more(1) == 6
    assert len(made) == before


def test_machine_code_that_others_may_write_is_not_loaded(folder: Path, made: list[str]) -> None:
    text = NUMBERS.format(6)
    assert module(text).more(1) == 7
    (path,) = (folder / cache.MACHINE).rglob("*.o")
    other = NUMBERS.format(600)
    assert module(other).more(1) == 601
    (planted,) = set((folder / cache.MACHINE).rglob("*.o")) - {path}
    path.write_bytes(planted.read_bytes())
    path.chmod(0o666)
    assert module(text).more(1) == 7
    assert len(made) == 3


def test_what_was_used_longest_ago_is_removed_first(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cache, "MOST_BYTES", 40_000)
    monkeypatch.setattr(cache, "_written", 0)
    monkeypatch.setattr(cache, "CHECK_INTERVAL", 2)
    for k in range(60):
        module(f"value = {k}\n" + "# filler\n" * 200)
        for path in folder.glob("*"):  # files of one moment have no order
            os.utime(path, (path.stat().st_mtime - 10,) * 2)
    assert cache.contents().size <= 45_000
    assert cache.contents().formulas > 5
    names = [p.name for p in folder.glob("*.py")]
    assert module("value = 59\n" + "# filler\n" * 200).__name__ + ".py" in names
    assert module("value = 0\n" + "# filler\n" * 200).__name__ + ".py" not in names


def test_a_tilde_is_the_home_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("FLOCKING_CACHE", "~/inner/cache")
    monkeypatch.chdir(tmp_path)
    assert cache.cache_folder() == tmp_path / "inner" / "cache"
    assert not (tmp_path / "~").exists()


def test_a_full_disk_is_named(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(handle: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(cache.os, "fsync", full)
    with pytest.raises(CacheError, match=rf"{folder} cannot be written \(No space left.*flocking cache --clear"):
        module("value = 7\n")
    assert list(folder.iterdir()) == []


def test_the_command_shows_and_clears(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    module("value = 8\n")
    assert main(["cache"]) == 0
    shown = capsys.readouterr().out
    assert str(folder) in shown
    assert "2 files" in shown
    assert main(["cache", "--clear", "--json"]) == 0
    assert '"cleared": true' in capsys.readouterr().out
    assert not any(p.is_file() for p in folder.rglob("*"))
    assert module("value = 8\n").value == 8


ASK = """
import subprocess, sys
import flocking as fk
from flocking.formula.cache import cache_folder
print(cache_folder(), fk.Potential("1/r")(2.0))
import flocking.engine.adaptive_steps.segment, flocking.engine.exact.crossings.guards
if len(sys.argv) > 1:
    print(subprocess.run([sys.executable, __file__], capture_output=True, text=True).stderr == "")
"""


def test_without_any_writable_place_a_private_folder_is_used_and_said_once(tmp_path: Path) -> None:
    (tmp_path / "home").write_text("no folder")
    script = tmp_path / "ask.py"
    script.write_text(ASK)
    unset = ("FLOCKING_CACHE", "XDG_CACHE_HOME", "NUMBA_CACHE_DIR")
    words = {k: v for k, v in os.environ.items() if k not in unset} | {"HOME": str(tmp_path / "home")}
    found = subprocess.run([sys.executable, str(script), "child"], env=words, capture_output=True, text=True)
    assert found.returncode == 0, found.stderr
    place, value, silent = found.stdout.split()
    assert value == "0.5"
    assert silent == "True", "processes that it starts use the same folder and say nothing"
    assert found.stderr.count("compiled formulas are kept in") == 1
    assert place in found.stderr
    assert not Path(place).exists(), "it goes with the process"


UNKEPT = """
import subprocess, sys
import flocking as fk
print(fk.Potential("1/r")(2.0))
if len(sys.argv) > 1:
    found = subprocess.run([sys.executable, "-c", "import flocking as fk; fk.Potential('1/r')"], capture_output=True)
    print(found.returncode, found.stderr)
"""


def test_where_nothing_can_be_written_nothing_is_kept(tmp_path: Path) -> None:
    """As on a disk that can only be read, temporary folders included."""
    (tmp_path / "home").write_text("no folder")
    (tmp_path / "ask.py").write_text(UNKEPT)
    unset = ("FLOCKING_CACHE", "XDG_CACHE_HOME", "NUMBA_CACHE_DIR")
    words = {k: v for k, v in os.environ.items() if k not in unset} | {"HOME": str(tmp_path / "home")}
    nowhere = "import tempfile; tempfile._candidate_tempdir_list = lambda: ['/proc']; "
    code = f"{nowhere} exec(compile(open({str(tmp_path / 'ask.py')!r}).read(), 'ask', 'exec'))"
    found = subprocess.run([sys.executable, "-c", code, "child"], env=words, capture_output=True, text=True)
    assert found.stdout == "0.5\n0 b''\n", found.stderr
    assert found.stderr.count("compiled formulas are not kept") == 1
    assert found.stderr.count("\n") == 1


def test_a_cache_that_keeps_nothing_shows_nothing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("FLOCKING_CACHE", os.devnull)
    assert module(NUMBERS.format(9)).more(1) == 10
    assert main(["cache"]) == main(["cache", "--clear"]) == 0
    assert "0 files" in capsys.readouterr().out


WRITER = """
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from flocking.formula import cache
for k in range(10**6):
    cache.write_text(Path(sys.argv[1]) / f"flocking_structure_{k % 5}.txt", f"{k} " * 20000)
    if k == 5:
        print("begun", flush=True)
"""


@pytest.mark.parametrize("kills", [4, pytest.param(50, marks=pytest.mark.repeated)])
def test_a_kill_leaves_whole_files(folder: Path, kills: int) -> None:
    folder.mkdir(mode=0o700)
    for k in range(kills):
        with subprocess.Popen([sys.executable, "-c", WRITER, str(folder)], stdout=subprocess.PIPE) as writer:
            assert writer.stdout is not None
            writer.stdout.readline()
            time.sleep(0.003 * (k % 17))
            writer.send_signal(signal.SIGKILL)
        for path in folder.glob("*.txt"):
            text = cache.read_text(path)
            assert text is not None
            assert len(set(text.split())) == 1
        count("cache: writers killed")


@pytest.mark.repeated
def test_8_processes_meet_in_an_empty_cache(folder: Path) -> None:
    ask = "import flocking as fk; print(fk.Potential('1/r + 17*r')(2.0))"
    for _ in range(3):
        several = [subprocess.Popen([sys.executable, "-c", ask], stdout=subprocess.PIPE, text=True) for _ in range(8)]
        assert [p.communicate()[0] for p in several] == ["34.5\n"] * 8
        count("cache: races of 8 processes")
        cache.clear()


def test_a_thread_never_gets_a_module_that_another_one_is_still_running(folder: Path) -> None:
    """The first thread is held up amid the module's code until the second one has its own."""
    begun, had = threading.Event(), threading.Event()

    def pause() -> None:
        if not begun.is_set():
            begun.set()
            assert had.wait(600)

    source = "from tests.formula import test_cache\n\ntest_cache.PAUSES[-1]()\nvalue = 7\n"
    PAUSES.append(pause)
    found: list[Any] = []
    first = threading.Thread(target=lambda: found.append(module(source)), daemon=True)
    first.start()
    try:
        assert begun.wait(600)
        second = compiled._of_source(source)
        assert second.value == 7
    finally:
        had.set()
        first.join()
        PAUSES.pop()
    assert found[0] is second, "functions of both are compiled once"


PAUSES: list[Callable[[], None]] = []
"""What a generated module calls in the test of two threads."""


@pytest.mark.parametrize("place", ["~nobody-of-this-name/cache", "deep"])
def test_a_cache_folder_without_a_home_or_too_deep_is_refused(monkeypatch, tmp_path, place):
    monkeypatch.setenv("FLOCKING_CACHE", place if place != "deep" else f"{tmp_path}/{'y/' * 1900}")
    with pytest.raises(CacheError, match="cannot be used") as error:
        cache.cache_folder()
    assert len(str(error.value)) < 600
