"""The folder of generated code: where it is, who may write it, and how its files are written, verified and removed.

The files are executed. So the folder and its files must belong to the user or to root, and nobody else may write them.
Every file holds a checksum; a file that does not match its checksum is generated again.
"""

from __future__ import annotations

import atexit
import errno
import hashlib
import io
import os
import shutil
import stat
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from flocking.errors import CacheError, said
from flocking.formula.listed_files import files_below

MOST_BYTES = 512 * 2**20
"""Largest size of the folder; the files used longest ago are removed first, down to `REMAINING_SHARE` of it."""
REMAINING_SHARE = 0.75
"""Share of the largest size that remains after files were removed, so that removal is rare."""

CHECK_INTERVAL = 64
"""Files that a process writes between two checks of the size of the folder: a few megabytes, far below what it may
hold, while a check reads the size of every file in it."""

ABANDONED_AFTER = 3600.0
"""Seconds after which a temporary file is taken for one of a process that was killed."""

MOST_OF_NAME = 80
"""Most characters that a temporary file takes from the name of its own: file systems allow 255 with what is added."""

CHECKSUM_PREFIX = "# sha256 "
"""First line of a text file: this and the SHA-256 of the rest."""
DIGEST_BYTES = 32
"""A file of machine code ends with the SHA-256 of the rest, which has 32 bytes."""

GENERATED = "flocking_generated_"
"""Names of generated modules are this and a digest of their source."""

MACHINE = "machine"
"""Subfolder of machine code."""

NOWHERE = Path(os.devnull)
"""In place of the folder where nothing can be written: every process compiles for itself and stores nothing."""

_written = 0
"""Files that this process has written."""


def cache_folder() -> Path:
    """Folder of generated code: ``$FLOCKING_CACHE``, or ``flocking`` in the user's cache folder.

    If neither can be written and none was chosen, it is a temporary folder of this process and its children, or
    `NOWHERE` if none can be made. ``FLOCKING_CACHE=/dev/null`` selects `NOWHERE`.

    Raises
    ------
    CacheError
        When the chosen folder cannot be created, or others may write it.
    """
    chosen = os.environ.get("FLOCKING_CACHE")
    if chosen:
        try:
            folder = Path(chosen).expanduser()
            if folder == NOWHERE:
                return NOWHERE
            _make(folder)
        except (OSError, RuntimeError) as error:  # The other is of a home that is not known, and of too many folders.
            raise CacheError(
                f"The cache folder {said(chosen)} cannot be used ({getattr(error, 'strerror', None) or error}). "
                "Set FLOCKING_CACHE to a folder you can write."
            ) from None
        _require_own(folder)
        return folder
    try:
        base = os.environ.get("XDG_CACHE_HOME")
        folder = (Path(base) if base else Path.home() / ".cache") / "flocking"
        _make(folder)
        if not os.access(folder, os.W_OK | os.X_OK):
            raise PermissionError(errno.EACCES, "it cannot be written", str(folder))
    except (OSError, RuntimeError) as error:
        return _temporary(str(getattr(error, "strerror", None) or error))
    _require_own(folder)
    return folder


def _make(folder: Path) -> None:
    folder.parent.mkdir(parents=True, exist_ok=True)
    folder.mkdir(mode=0o700, exist_ok=True)


def _temporary(reason: str) -> Path:
    """A private folder that is removed when the process ends; its child processes use it too."""
    try:
        folder = Path(tempfile.mkdtemp(prefix="flocking-"))
        place = f"are kept in {folder} until this process ends"
    except OSError:
        folder = NOWHERE
        place = "are not kept, as no temporary folder can be made either"
    owner = os.getpid()
    os.environ["FLOCKING_CACHE"] = str(folder)

    def remove() -> None:
        if os.getpid() == owner:
            shutil.rmtree(folder, ignore_errors=True)

    if folder != NOWHERE:
        atexit.register(remove)
    if sys.stderr is not None:
        print(
            f"flocking: your cache folder cannot be used ({reason}); compiled formulas {place}. "
            "Set FLOCKING_CACHE to a folder you can write.",
            file=sys.stderr,
        )  # fmt: skip
    return folder


def others_may_write(path: Path) -> str:
    """Who else may write the file or folder ``path``, in words; empty if nobody may."""
    if not hasattr(os, "getuid"):  # Windows: rights are not in the mode
        return ""
    found = path.lstat()
    if stat.S_ISLNK(found.st_mode):
        target = path.stat()
        if found.st_uid not in (0, os.getuid()):
            return f"user {found.st_uid}, who owns the link"
        found = target
    if found.st_uid not in (0, os.getuid()):
        return f"user {found.st_uid}, who owns it"
    if found.st_mode & stat.S_IWOTH:
        return "everybody"
    if found.st_mode & stat.S_IWGRP:
        return f"group {found.st_gid}"
    return ""


def _require_own(folder: Path) -> None:
    who = others_may_write(folder)
    if who:
        raise CacheError(
            f"The cache folder {folder} may be written by {who}: its files would be executed. "
            f"Set FLOCKING_CACHE to a folder of your own, or take the right away (chmod go-w {folder})."
        )
    for above in folder.absolute().parents:
        mode = above.stat().st_mode
        if hasattr(os, "getuid") and mode & stat.S_IWOTH and not mode & stat.S_ISVTX:
            raise CacheError(
                f"The cache folder {folder} lies in {above}, which every user may write and rename. "
                "Set FLOCKING_CACHE to a folder of your own."
            )


def _is_private(path: Path) -> bool:
    """Whether a path is a regular file that nobody else may write."""
    return not path.is_symlink() and path.is_file() and not others_may_write(path)


@contextmanager
def _written_completely(path: Path) -> Iterator[BinaryIO]:
    """A file that appears under its name once all of it is on the disk, readable and writable by the user alone.

    Raises
    ------
    CacheError
        When it cannot be written.
    """
    if path.is_relative_to(NOWHERE):
        yield io.BytesIO()
        return
    temporary = None
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f"{path.name[:MOST_OF_NAME]}.", suffix=".tmp")
        with os.fdopen(handle, "wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except BaseException as error:
        if temporary is not None:
            with suppress(OSError):
                os.unlink(temporary)
        if isinstance(error, OSError):
            full = error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
            raise CacheError(
                f"The cache folder {path.parent} cannot be written ({error.strerror}). "
                + ("Free some space there (flocking cache --clear), or set" if full else "Set")
                + " FLOCKING_CACHE to a folder you can write."
            ) from None
        raise
    _limit_size(path.parent)


def write_text(path: Path, text: str) -> None:
    """Write ``text`` to the file ``path`` with its digest in the first line.

    Raises
    ------
    CacheError
        When it cannot be written.
    """
    data = text.encode()
    with _written_completely(path) as file:
        file.write(f"{CHECKSUM_PREFIX}{hashlib.sha256(data).hexdigest()}\n".encode() + data)


def read_text(path: Path) -> str | None:
    """The text that `write_text` wrote; None if the file is missing, incomplete, or writable by others."""
    try:
        if not _is_private(path):
            return None
        head, _, data = path.read_bytes().partition(b"\n")
        if head != f"{CHECKSUM_PREFIX}{hashlib.sha256(data).hexdigest()}".encode():
            return None
        with suppress(OSError):
            os.utime(path)
        return data.decode()
    except (OSError, UnicodeDecodeError, ValueError):
        return None


def write_code(path: Path, code: bytes) -> None:
    """Write machine code to the file ``path`` with its digest at the end.

    Raises
    ------
    CacheError
        When it cannot be written.
    """
    with _written_completely(path) as file:
        file.write(code + hashlib.sha256(code).digest())


def read_code(path: Path) -> bytes | None:
    """What `write_code` wrote; None if the file is missing, incomplete, or writable by others."""
    try:
        if not _is_private(path):
            return None
        data = path.read_bytes()
        if len(data) <= DIGEST_BYTES or hashlib.sha256(data[:-DIGEST_BYTES]).digest() != data[-DIGEST_BYTES:]:
            return None
        with suppress(OSError):
            os.utime(path)
        return data[:-DIGEST_BYTES]
    except OSError:
        return None


@dataclass(frozen=True)
class Contents:
    """Contents of the folder: number of files, their size in bytes, and the number of generated modules.

    Parameters
    ----------
    folder, files, size, formulas
        In this order.
    """

    folder: Path
    files: int
    size: int
    formulas: int


def contents(folder: Path | None = None) -> Contents:
    """What is in the folder of generated code.

    Raises
    ------
    CacheError
        When the folder cannot be used.
    """
    folder = cache_folder() if folder is None else folder
    found = _files(folder)
    return Contents(folder, len(found), sum(x[1] for x in found), sum(x[2].suffix == ".py" for x in found))


def clear() -> Contents:
    """Remove all generated code; returns what was there.

    Raises
    ------
    CacheError
        When the folder cannot be used or written.
    """
    before = contents()
    try:
        for _, _, path in _files(before.folder):
            path.unlink(missing_ok=True)
    except OSError as error:
        raise CacheError(f"The cache folder {before.folder} cannot be cleared ({error.strerror}).") from None
    return before


def _files(folder: Path) -> list[tuple[float, int, Path]]:
    """Time of the last use, size and path of every file that this library writes there."""
    found = []
    for entry in files_below(folder):
        if entry.name.endswith(_ENDINGS):
            with suppress(OSError):
                if entry.is_file(follow_symlinks=False):
                    about = entry.stat(follow_symlinks=False)
                    found.append((about.st_mtime, about.st_size, entry.path))
    return [(used, size, Path(path)) for used, size, path in found]


_ENDINGS = (".py", ".txt", ".tmp", ".nbi", ".nbc", ".pyc", ".o", ".lock")
"""Endings of the files that are listed; some are those of earlier versions."""


def _limit_size(folder: Path) -> None:
    """Every `CHECK_INTERVAL` files, remove those used longest ago if the folder has become too large."""
    global _written
    _written += 1
    if _written % CHECK_INTERVAL != 1:
        return
    root = next((p for p in (folder, *folder.parents) if (p / MACHINE).is_dir()), folder)
    found = sorted(_files(root))
    for used, _, path in found:
        if path.suffix in (".tmp", ".lock") and used < time.time() - ABANDONED_AFTER:
            with suppress(OSError):
                path.unlink()
    size = sum(x[1] for x in found)
    if size <= MOST_BYTES:
        return
    for _, length, path in found:
        if size <= REMAINING_SHARE * MOST_BYTES:
            return
        with suppress(OSError):
            path.unlink()
            size -= length
