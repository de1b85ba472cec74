"""Names of partly written files and folders, and what processes that were killed have left of them."""

from __future__ import annotations

import os
import re
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

PARTIAL = ".partial"
"""Suffix of a partly written file or folder; a kill may leave one behind, and it is never read."""

MAKING = 60.0
"""Time in seconds without writes after which something partly written may count as abandoned."""

ROUNDING = 2.0
"""Seconds by which the ages of a process and of a file may be off."""

_under_way: set[Path] = set()
"""Partly written folders of this process."""


def partial_file(path: Path, suffix: str = "") -> Path:
    """Temporary path of the file ``path``, which is renamed when complete.

    Parameters
    ----------
    path
        The file.
    suffix
        Last part of the temporary name, for writers that choose the format by it: that of ``path``, or none.
    """
    return path.with_name(f"{path.name}.{os.getpid()}{PARTIAL}{suffix}")


@contextmanager
def partial_folder(folder: Path) -> Iterator[Path]:
    """A new folder beside ``folder``, to be renamed when complete; what is still there when the block ends is removed.

    No other process has one of the same name, nor has one been left: in containers that share a disk several may have
    the same number.

    Raises
    ------
    OSError
        If it cannot be made.
    """
    fresh = folder.with_name(f".{folder.name}.{os.urandom(4).hex()}.{os.getpid()}{PARTIAL}")
    _under_way.add(fresh)
    try:
        fresh.mkdir(parents=True)
        yield fresh
    finally:
        shutil.rmtree(fresh, ignore_errors=True)
        _under_way.discard(fresh)


def remove_folders_left_over(place: Path) -> None:
    """Remove partly written folders of ended processes from ``place``, see `partial_folder`."""
    for path in place.glob(f".*{PARTIAL}"):
        owner = path.name.removesuffix(PARTIAL).rpartition(".")[2]
        if owner.isdecimal() and path.is_dir() and not path.is_symlink() and path not in _under_way:
            with suppress(OSError):
                written = max(x.stat().st_mtime for x in (path, *path.iterdir()))
                if _is_abandoned(int(owner), time.time() - written):
                    shutil.rmtree(path, ignore_errors=True)


def remove_files_left_over(path: Path) -> None:
    """Remove partial files of ``path`` that ended processes left, see `partial_file`."""
    pattern = re.compile(rf"{re.escape(path.name)}\.([0-9]+){re.escape(PARTIAL)}(?:{re.escape(path.suffix)})?")
    with suppress(OSError), os.scandir(path.parent) as entries:
        for entry in entries:
            named = pattern.fullmatch(entry.name)
            # One with the number of this process is replaced.
            if named and int(named[1]) != os.getpid() and entry.is_file(follow_symlinks=False):
                with suppress(OSError):
                    if _is_abandoned(int(named[1]), time.time() - entry.stat(follow_symlinks=False).st_mtime):
                        Path(entry.path).unlink()


def _is_abandoned(owner: int, age: float) -> bool:
    """Whether what a process wrote ``age`` seconds ago is abandoned; nothing that this process is making."""
    # A process on another machine, or in another container, that shares the disk may be writing it.
    return age > MAKING and (owner == os.getpid() or not _may_have_written(owner, age))


def _may_have_written(process: int, age: float) -> bool:
    """Whether a process exists and had begun ``age`` seconds ago; the numbers of processes are used again."""
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:
        pass  # It belongs to another user.
    lived = process_age(process)
    return lived is None or lived + ROUNDING > age


def process_age(process: int) -> float | None:
    """Seconds since a process began, with the time of suspension of the machine; None where this is not known."""
    try:
        fields = Path("/proc", str(process), "stat").read_text(errors="replace").rpartition(")")[2].split()
        # The third field is the first after the name of the program, the 22nd the beginning in ticks after the boot.
        return time.clock_gettime(time.CLOCK_BOOTTIME) - int(fields[19]) / os.sysconf("SC_CLK_TCK")
    except (OSError, ValueError, IndexError, AttributeError):
        return None
