"""The folder to which a page is confined for opening and saving files."""

from __future__ import annotations

import os
from pathlib import Path, PurePosixPath, PureWindowsPath

from flocking.errors import InvalidInput


class Folder:
    """A folder; names given by a page that lead out of it are refused.

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
            When the name is absolute, has ``..``, or goes through a symbolic link out of the folder. The answer
            does not depend on what exists outside.
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
        """Whether a name has no part that leads out of the folder."""
        ways = (PurePosixPath(name), PureWindowsPath(name))
        return bool(name) and "\0" not in name and not any(x.anchor or x.drive or ".." in x.parts for x in ways)

    @staticmethod
    def _refusal(name: str) -> InvalidInput:
        return InvalidInput(
            "lab", "name", "must be that of something in the folder the lab was started with", name,
            "Start the lab in another folder, or with --folder.",
        )  # fmt: skip
