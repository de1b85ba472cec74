"""One process at a time compiles a function; others wait for its code, which they then load."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

LONGEST_WAIT = 60.0
"""Seconds after which a process compiles by itself: the other one may have been stopped."""

BETWEEN_TRIES = 0.01
"""Seconds between two attempts to take the lock."""


@contextmanager
def one_compiler(path: Path) -> Iterator[None]:
    """Hold the lock of a file of machine code while it is made.

    The system releases the lock when the process ends. Without locks, as on Windows or where the folder cannot be
    written, processes compile side by side: each writes the file under a name of its own first.

    Parameters
    ----------
    path
        Where the code is stored.
    """
    handle = _lock(path.with_suffix(".lock"))
    try:
        yield
    finally:
        if handle is not None:
            with suppress(OSError):
                path.with_suffix(".lock").unlink()
            _unlock(handle)


def _lock(path: Path) -> int | None:
    """Descriptor of the locked file at ``path``; None where there is no lock to be had."""
    try:
        import fcntl
    except ImportError:
        return None
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
    except OSError:
        return None
    end = time.monotonic() + LONGEST_WAIT
    try:
        while True:
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                return handle
            except BlockingIOError:
                if time.monotonic() > end:
                    os.close(handle)
                    return None
                time.sleep(BETWEEN_TRIES)
            except OSError:
                os.close(handle)
                return None
    except BaseException:
        os.close(handle)
        raise


def _unlock(handle: int) -> None:
    """Release the lock, which a process that was forked meanwhile would hold on to, and close the file."""
    import fcntl

    with suppress(OSError):
        fcntl.flock(handle, fcntl.LOCK_UN)
    os.close(handle)
