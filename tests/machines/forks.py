"""Starts commands on machines of all kinds: one line of JSON in, one line out.

The process has imported the library and compiled a law, and forks: a command begins within a moment, as one from a
terminal does after its imports. With ``enter`` a child in a mount namespace of its own goes on with the orders, and
whatever it mounts is gone when it leaves.
"""

from __future__ import annotations

import atexit
import contextlib
import ctypes
import fcntl
import gc
import importlib
import io
import json
import os
import pkgutil
import pty
import re
import resource
import shutil
import signal
import struct
import sys
import tempfile
import termios
import threading
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib.backends.backend_svg
import matplotlib.pyplot  # noqa: F401
import PIL.GifImagePlugin  # noqa: F401
import rich.table  # noqa: F401
import scipy.linalg  # noqa: F401
import sympy  # noqa: F401
import xarray  # noqa: F401
import zarr  # noqa: F401

import flocking
import flocking as fk
from flocking import __main__ as command
from flocking.apps import cli
from flocking.apps.reproduction import film
from flocking.apps.reproduction import reproduce as reproduction
from flocking.engine.driver import session_writer as saving
from tests.engine.storage.stored_runs import scenario

NEW_NAMESPACE, NEW_USER = 0x00020000, 0x10000000
READ_ONLY, REMOUNT, BIND, RECURSIVE, PRIVATE = 0x1, 0x20, 0x1000, 0x4000, 0x40000

libc = ctypes.CDLL(None, use_errno=True)


def _checked(code: int, what: str) -> None:
    if code != 0:
        number = ctypes.get_errno()
        raise OSError(number, f"{what}: {os.strerror(number)}")


def own_namespace() -> None:
    """Give this process a mount namespace of its own, as root or within a user namespace."""
    user, group = os.getuid(), os.getgid()
    if user == 0:
        _checked(libc.unshare(NEW_NAMESPACE), "unshare")
    else:
        _checked(libc.unshare(NEW_NAMESPACE | NEW_USER), "unshare")
        Path("/proc/self/setgroups").write_text("deny")
        Path("/proc/self/uid_map").write_text(f"0 {user} 1")
        Path("/proc/self/gid_map").write_text(f"0 {group} 1")
    mount("none", "/", None, RECURSIVE | PRIVATE)


def mount(source: str, target: str, kind: str | None, flags: int = 0, options: str = "") -> None:
    """The system call."""
    texts = [None if text is None else text.encode() for text in (source, target, kind)]
    _checked(libc.mount(*texts, ctypes.c_ulong(flags), options.encode()), f"mount {target}")


def disk(path: str, size: int) -> None:
    """An empty disk of so many bytes in place of any that is there."""
    libc.umount2(path.encode(), 0)
    Path(path).mkdir(parents=True, exist_ok=True)
    mount("none", path, "tmpfs", 0, f"size={size},mode=755")


def room(path: str, size: int) -> None:
    """Leave a disk so many free bytes."""
    about = os.statvfs(path)
    used = (about.f_blocks - about.f_bfree) * about.f_frsize
    mount("none", path, "tmpfs", REMOUNT, f"size={used + size},mode=755")


def copy(source: str, target: str) -> None:
    """Copy a folder."""
    shutil.copytree(source, target)


def tree(path: str) -> list[str]:
    """Everything below a folder."""
    return sorted(str(p.relative_to(path)) for p in Path(path).rglob("*"))


def begin(
    words: list[str],
    out: str,
    err: str,
    folder: str,
    environment: dict[str, str | None],
    commit: float | None = None,
    film_seconds: float = 0.0,
    file_size: int = 0,
    room: int = 0,
    user: int | None = None,
    encoding: str = "utf-8",
    closed: Sequence[int] = (),
    columns: int = 0,
    fresh: bool = False,
) -> int:
    """Start a command; its process id. What it says goes to two files.

    Parameters
    ----------
    commit
        Seconds between two commits, where others than usual.
    film_seconds
        Length of the film of a reproduction, where another than usual.
    file_size
        Size in bytes that a file may have; 0 for any.
    room
        Bytes of address space that it may take beyond what it begins with; 0 for any.
    user
        The user that it runs as.
    encoding
        That of what it says.
    closed
        Which of the three standard streams are closed.
    columns
        It speaks to a terminal of so many; 0 for files.
    fresh
        Whether it begins with Python itself.
    """
    master, slave = pty.openpty() if columns else (-1, -1)
    if columns:
        fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
    child = os.fork()
    if child:
        if columns:
            os.close(slave)
            readers[child] = _reader(master, out)
        return child
    code = 3
    try:
        os.setsid()
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        opened = [os.open(os.devnull, os.O_RDONLY)]
        opened += [os.open(path, os.O_CREAT | os.O_WRONLY | os.O_APPEND, 0o644) for path in (out, err)]
        for number, handle in enumerate([slave] * 3 if columns else opened):
            os.dup2(handle, number)
        os.closerange(3, 256)
        for name, value in environment.items():
            os.environ.pop(name, None) if value is None else os.environ.update({name: value})
        os.chdir(folder)
        if user is not None:
            os.setgroups([])
            os.setgid(user)
            os.setuid(user)
        if file_size:
            resource.setrlimit(resource.RLIMIT_FSIZE, (file_size, file_size))
        if room:
            pages = int(Path("/proc/self/statm").read_text().split()[0])
            size = pages * resource.getpagesize() + room
            resource.setrlimit(resource.RLIMIT_AS, (size, size))
        for number in closed:
            os.close(number)
        if fresh:
            os.execv(sys.executable, [sys.executable, "-m", "flocking", *words])
        _streams(closed, encoding)
        if commit is not None:
            saving.COMMIT_SECONDS = commit
        film.SECONDS = film_seconds or film.SECONDS
        tempfile.tempdir = None
        sys.argv = ["flocking", *words]
        code = command.main()
        sys.stdout.flush()
        threading._shutdown()  # type: ignore[attr-defined]
        atexit._run_exitfuncs()
    except SystemExit as end:
        code = int(end.code or 0)
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(code)


readers: dict[int, int] = {}
"""Processes that read a terminal, by the command that speaks to it."""


def _streams(closed: Sequence[int], encoding: str) -> None:
    """The standard streams as Python makes them when it begins."""
    for number, name, errors in (
        (0, "stdin", "strict"),
        (1, "stdout", "surrogateescape"),
        (2, "stderr", "backslashreplace"),
    ):
        mode, buffering = ("r", -1) if number == 0 else ("w", 1 if number == 2 else -1)
        made = None if number in closed else os.fdopen(number, mode, buffering, encoding=encoding, errors=errors)
        setattr(sys, name, made)
        setattr(sys, f"__{name}__", made)


def _reader(terminal: int, out: str) -> int:
    child = os.fork()
    if child:
        os.close(terminal)
        return child
    with open(out, "wb") as file:
        while True:
            try:
                said = os.read(terminal, 4096)
            except OSError:
                break
            if not said:
                break
            file.write(said)
    os._exit(0)


def end(process: int) -> tuple[int, float]:
    """Wait for a command: its exit code, negative for a signal, and the processor time it took, in seconds."""
    _, status, used = os.wait4(process, 0)
    if process in readers:
        os.waitpid(readers.pop(process), 0)
    return os.waitstatus_to_exitcode(status), used.ru_utime + used.ru_stime


def only_writable(path: str) -> None:
    """Let nobody write anywhere but below a folder, root included."""
    mount(path, path, None, BIND)
    for line in Path("/proc/self/mountinfo").read_text().splitlines():
        place = line.split()[4]
        if place != path and not place.startswith(("/proc", "/sys", "/dev")):
            mount("none", place, None, BIND | REMOUNT | READ_ONLY)
    mount("none", "/dev/shm", "tmpfs", READ_ONLY)


def open_to_all() -> None:
    """Let every user reach Python and the library, also where they lie in somebody's home."""
    places = [str(Path(place).resolve()) for place in (sys.base_prefix, sys.prefix, Path(__file__).parents[2])]
    held = tempfile.mkdtemp()
    mount("none", held, "tmpfs", 0, "mode=755")
    hidden: dict[str, list[int]] = {}
    for k, place in enumerate(places):
        closed = [str(p) for p in Path(place).parents if p.stat().st_mode & 0o005 != 0o005]
        if closed:
            hidden.setdefault(closed[-1], []).append(k)
            Path(held, str(k)).mkdir()
            mount(place, f"{held}/{k}", None, BIND)
    for home, numbers in hidden.items():
        mount("none", home, "tmpfs", 0, "mode=755")
        for k in numbers:
            Path(places[k]).mkdir(parents=True)
            mount(f"{held}/{k}", places[k], None, BIND)


def load(name: str) -> None:
    """Import a module, so that commands begin with it."""
    importlib.import_module(name)


def remember(words: list[str]) -> int:
    """Run a reproduction and keep what its runs came to: those that are started later compute nothing."""
    known: dict[Any, Any] = {}
    examine = reproduction.examine
    reproduction.examine = lambda task: known[task] if task in known else known.setdefault(task, examine(task))
    with contextlib.redirect_stdout(io.StringIO()):
        return cli.main(words)


ORDERS = {f.__name__: f for f in (disk, room, only_writable, open_to_all, copy, tree, begin, end, load, remember)}


def obey() -> None:
    """Do what is asked for until the input ends or says ``leave``."""
    for line in iter(sys.stdin.readline, ""):
        order, arguments = json.loads(line)
        answer: dict[str, Any] = {"error": None, "value": None}
        if order == "leave":
            return
        if order == "enter":
            child = os.fork()
            if child == 0:
                try:
                    own_namespace()
                except OSError as error:
                    print(json.dumps({"error": str(error)}), flush=True)
                    os._exit(0)
                print(json.dumps(answer), flush=True)
                obey()
                os._exit(0)
            os.waitpid(child, 0)
            answer["value"] = "left"
        else:
            try:
                answer["value"] = ORDERS[order](**arguments)
            except Exception as error:
                answer["error"] = f"{type(error).__name__}: {error}"
        print(json.dumps(answer), flush=True)


def main() -> None:
    """Get ready, say so, obey."""
    for found in pkgutil.walk_packages(flocking.__path__, "flocking."):
        if not re.search(r"\.(lab|lammps|olfati|shi_|zhou|tanner_2003_d|tiles)", found.name):
            importlib.import_module(found.name)
    with tempfile.TemporaryDirectory() as folder:
        short = Path(folder, "short.toml")
        fk.write_scenario(scenario(t_end=0.1), short)
        fk.simulate(fk.read_scenario(short), progress=False)
    gc.freeze()
    print(json.dumps({"error": None, "value": "ready"}), flush=True)
    obey()


if __name__ == "__main__":
    main()
