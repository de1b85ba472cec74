"""Files below folders, listed fast."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import suppress


def files_below(*folders: str | os.PathLike[str]) -> Iterator[os.DirEntry[str]]:
    """Everything below folders that is no folder, without an object for each path; links are not followed to folders.

    Folders that cannot be read have no files.

    Parameters
    ----------
    folders
        The folders.
    """
    waiting = [os.fspath(folder) for folder in folders]
    while waiting:
        with suppress(OSError), os.scandir(waiting.pop()) as entries:
            for entry in entries:
                if entry.is_dir(follow_symlinks=False):
                    waiting.append(entry.path)
                else:
                    yield entry
