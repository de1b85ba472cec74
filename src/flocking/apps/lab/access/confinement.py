"""The folder a page may open files from and save files to, and nothing else."""

from __future__ import annotations

import os
from pathlib import Path, PurePosixPath, PureWindowsPath

from flocking.errors import InvalidInput


class Folder:
    """A folder that names given by a page do not lead out of.

    Parameters
    ----------
    path
        The folder.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(os.path.realpath(path))

    def inside(self, name: str) -> Path:
        """The file or folder with a name given by a page.

        Raises
        ------
        InvalidInput
            When the name is absolute, has ``..``, or goes through a symbolic link out of the folder. Nothing outside is
            looked at to find that out, so that the answer is the same whether or not there is something.
        """
        if not self._stays(name):
            raise self._refusal(name)
        found = Path(os.path.realpath(self.path / name))
        if not found.is_relative_to(self.path):
            raise self._refusal(name)
        return found

    def path_of(self, name: str) -> Path:
        """The folder with a name given by a page, with all that is in it.

        Raises
        ------
        InvalidInput
            As `inside`, also where a symbolic link within it leads out.
        """
        found = self.inside(name)
        for place, folders, files in os.walk(found):
            for each in (Path(place, x) for x in (*folders, *files)):
                if each.is_symlink() and not Path(os.path.realpath(each)).is_relative_to(self.path):
                    raise self._refusal(name)
        return found

    def holds(self, name: str) -> bool:
        """Whether a page may open what has this name."""
        try:
            self.inside(name)
        except InvalidInput:
            return False
        return True

    @staticmethod
    def _stays(name: str) -> bool:
        """Whether a name is one of something below, whatever there is."""
        ways = (PurePosixPath(name), PureWindowsPath(name))
        return bool(name) and "\0" not in name and not any(x.anchor or x.drive or ".." in x.parts for x in ways)

    @staticmethod
    def _refusal(name: str) -> InvalidInput:
        return InvalidInput(
            "lab", "name", "must be that of something in the folder the lab was started with", name,
            "Start the lab in another folder, or with --folder.",
        )  # fmt: skip
