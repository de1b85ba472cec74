"""Files that others made: regular ones of a bounded size are read alone. A pipe waits for ever, a device never ends."""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from flocking.formula.listed_files import files_below

LARGEST_RECORD = 2**26
"""Bytes of the record of a run or of a sweep that is read, a bound on memory: 64 MiB; those of this library take
kilobytes."""
LARGEST_SCENARIO = 2**31
"""Bytes of a stored scenario that is read, a bound on memory: 2 GiB, the starts of about 40 million agents."""

NO_FILE = "no file but a pipe, a socket or a device"
_NEVER_WAITING = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)


@contextmanager
def opened(path: str | Path) -> Iterator[BinaryIO]:
    """A regular file, open for reading; links are followed.

    Raises
    ------
    OSError
        If it cannot be opened, or is no regular file.
    """
    _check(os.stat(path), path)
    # What was looked at may have been replaced: a pipe that is opened without waiting has no effect.
    handle = os.open(path, _NEVER_WAITING)
    try:
        _check(os.fstat(handle), path)
    except OSError:
        os.close(handle)
        raise
    with os.fdopen(handle, "rb") as file:
        yield file


def bounded_content(path: str | Path, largest: int) -> bytes:
    """Content of a regular file of at most ``largest`` bytes.

    Raises
    ------
    OSError
        If it cannot be read, is larger, or is no regular file.
    """
    with opened(path) as file:
        size = os.fstat(file.fileno()).st_size
        if size > largest:
            raise OSError(errno.EINVAL, f"it has {size} bytes, more than the {largest} that are read", str(path))
        return file.read(largest)


def _check(found: os.stat_result, path: str | Path) -> None:
    if stat.S_ISDIR(found.st_mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not stat.S_ISREG(found.st_mode):
        raise OSError(errno.EINVAL, f"it is {NO_FILE}", str(path))


def first_foreign(folder: Path) -> tuple[Path, str] | None:
    """The first thing below ``folder`` through which nothing may be written, and what it is: a link or no file."""
    for entry in files_below(folder):
        if entry.is_symlink():
            return Path(entry.path), "a link to another place"
        if not entry.is_file(follow_symlinks=False):
            return Path(entry.path), NO_FILE
    return None
