"""Atomic files: a file appears complete or not at all, also after a kill, and one process writes at a time."""

from __future__ import annotations

import asyncio
import errno
import io
import os
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO, Protocol, cast

from flocking.engine.interruption import interrupted
from flocking.engine.memory_shortage import starved
from flocking.engine.storage.bounded_chunks import Bound, bounded_store
from flocking.engine.storage.left_overs import (
    PARTIAL,
    partial_file,
    partial_folder,
    remove_files_left_over,
    remove_folders_left_over,
)
from flocking.engine.storage.regular_files import NO_FILE, opened
from flocking.errors import FlockingError, StorageError
from flocking.formula.listed_files import files_below

MOST_OF_REASON = 300
"""Most characters of another library's reason: some quote the data that they cannot read."""

RUN_STAYS = "What was committed before stays readable; free some space and continue with `flocking resume`."
"""Message for a run on a full disk."""
SWEEP_STAYS = "What was committed before stays readable; free some space and run the same sweep again to continue it."
NO_MEMORY = "the run needs more memory than is available."
NOTHING_WRITTEN = "Nothing was written; free some space or choose another folder."


def put(path: Path, data: bytes | Callable[[BinaryIO], None], *, lasting: bool = True) -> int:
    """Write a file so that a reader finds the old content or the new, never a part; returns its CRC-32.

    The data may be a function that writes them, so that they need not be in memory at once. A ``lasting`` file is
    synchronised to the disk before this returns, so that it survives a power failure.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = partial_file(path)
    try:
        with open(partial, "wb") as file:
            summed = _Summed(file)
            if callable(data):
                data(cast(BinaryIO, summed))
            else:
                summed.write(data)
            if lasting:
                file.flush()
                os.fsync(file.fileno())
        os.replace(partial, path)
        return summed.sum
    except BaseException:
        with suppress(OSError):
            partial.unlink(missing_ok=True)
        raise


def checksum(path: Path) -> int:
    """CRC-32 of a file."""
    found = 0
    with opened(path) as file:
        while part := file.read(2**24):
            found = zlib.crc32(part, found)
    return found


class _Summed(io.RawIOBase):
    """Writes through to a file, front to back, and computes the CRC-32 of the data."""

    def __init__(self, file: BinaryIO) -> None:
        self.sum = 0
        self._file = file

    def writable(self) -> bool:
        return True

    def write(self, data: Any) -> int:
        self.sum = zlib.crc32(data, self.sum)
        return self._file.write(data)


def settle(folders: set[Path]) -> None:
    """Synchronise ``folders`` to the disk, so that names of new files survive a power failure."""
    for folder in folders:
        with suppress(OSError):  # Windows cannot open a folder.
            handle = os.open(folder, os.O_RDONLY)
            try:
                os.fsync(handle)
            finally:
                os.close(handle)
    folders.clear()


def sweep(folder: Path) -> None:
    """Remove partial files of a killed process."""
    for entry in files_below(folder):
        if entry.name.endswith(PARTIAL):
            Path(entry.path).unlink(missing_ok=True)


class WritingStore(Protocol):
    """A Zarr store that collects the folders of the files it writes."""

    touched: set[Path]


def atomic_store(folder: Path, bounds: Mapping[str, Bound] | None = None) -> WritingStore:
    """A Zarr store in ``folder`` whose files are written by `put`; ``touched`` collects the folders of new ones.

    Chunks that are there already are read within ``bounds``, see `flocking.engine.storage.bounded_chunks`.
    """

    class AtomicStore(bounded_store(bounds or {})):  # type: ignore[misc]
        """A store whose files are replaced atomically."""

        touched: set[Path]

        async def set(self, key: str, value: Any) -> None:
            """Write one file."""
            self._check_writable()
            path = folder / key
            self.touched.add(path.parent)
            # The metadata of an array need not be durable: the record of the run contains them too.
            await asyncio.to_thread(put, path, value.to_bytes(), lasting=path.name != "zarr.json")

    store: WritingStore = AtomicStore(folder)
    store.touched = set()
    return store


def write_file(path: Path, data: bytes, doing: str) -> Path:
    """Write a single file atomically; missing parent folders are made, and partial files that a kill left are removed.

    Parameters
    ----------
    doing
        Purpose, as a phrase that follows "cannot".

    Raises
    ------
    StorageError
        If it cannot be written; the old file stays.
    """
    with storage_errors(path, doing, full=NOTHING_WRITTEN):
        remove_files_left_over(path)
        write_through(path, data)
    return path


def write_through(path: Path, data: bytes, *, parents: bool = True, lasting: bool = True) -> None:
    """Like `put`, but replaces the target of a link, and writes directly to a device or a pipe.

    Parameters
    ----------
    parents
        Whether missing parent folders are made.
    lasting
        Whether the file must survive a power failure.
    """
    if path.exists() and not path.is_file() and not path.is_dir():
        path.write_bytes(data)
    elif parents or path.resolve().parent.is_dir():
        put(path.resolve() if path.is_symlink() else path, data, lasting=lasting)
    else:
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(path))


@contextmanager
def storage_errors(folder: Path, doing: str, *, full: str = RUN_STAYS) -> Iterator[None]:
    """Convert failures of the file system to a `StorageError` with advice.

    Parameters
    ----------
    doing
        The attempted action, as a phrase that follows "cannot".
    full
        Advice if the disk is full.
    """
    try:
        yield
    except OSError as error:
        raise StorageError(f"{folder}: cannot {doing}: {_reason(error, full)}") from error


@contextmanager
def read_soundly(folder: Path) -> Iterator[None]:
    """Convert errors of reading a damaged or foreign ``folder`` to a `StorageError`."""
    try:
        yield
    except FlockingError:
        raise
    except (ValueError, KeyError, TypeError, IndexError, AttributeError, ArithmeticError, RuntimeError) as error:
        if interrupted(error):
            raise KeyboardInterrupt from None
        if starved(error):
            raise StorageError(f"{folder}: {NO_MEMORY}") from None
        reason = f"{type(error).__name__}: {error}"[:MOST_OF_REASON]
        raise StorageError(f"{folder}: the file was damaged or comes from elsewhere ({reason}).") from error
    except MemoryError:
        raise StorageError(f"{folder}: {NO_MEMORY}") from None


def _reason(error: OSError, full: str) -> str:
    if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
        return f"no space left ({error.strerror}). {full}"
    if error.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
        return f"no permission ({error.strerror}). Choose another folder or change its rights."
    return f"{error.strerror or error}."


@contextmanager
def complete_folder(folder: Path) -> Iterator[Path]:
    """A new folder to write into; it appears as ``folder``, missing or empty before, when the block ends without error.

    Raises
    ------
    OSError
        If it cannot be made, or ``folder`` is not empty.
    """
    remove_folders_left_over(folder.parent)
    with partial_folder(folder) as fresh:
        yield fresh
        with suppress(FileNotFoundError):
            folder.rmdir()
        os.rename(fresh, folder)


def _lock_of(folder: Path) -> BinaryIO:
    """The file of the folder's lock, made where it is missing: never what a link leads to, never a pipe."""
    path = folder / ".lock"
    handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC, 0o666)
    file = os.fdopen(handle, "ab")
    if not path.is_file():
        file.close()
        raise OSError(errno.EINVAL, f"it is {NO_FILE}", str(path))
    return file


@contextmanager
def only_writer(folder: Path) -> Iterator[None]:
    """Hold the folder's lock; the system releases it when the process ends.

    Raises
    ------
    StorageError
        If another process writes to the folder.
    """
    try:
        import fcntl
    except ImportError:  # Windows has no such locks.
        yield
        return
    with _lock_of(folder) as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise StorageError(
                f"{folder}: another process is writing this run; wait for it or choose another folder."
            ) from None
        yield
