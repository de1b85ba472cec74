"""What the repository holds: sources, pages, stored results and their pictures, and nothing that a tool left behind."""

from __future__ import annotations

import subprocess
from pathlib import Path

ROOT = Path(__file__).parents[2]
WRITTEN = ".bib .c .cff .css .h .html .js .json .md .npz .png .py .rst .svg .toml .txt .typed .woff .zip"
KINDS = {"", *WRITTEN.split()}
"""Endings of tracked files; files without one are listed in `BARE`."""
BARE = {"LICENSE", "Makefile", ".gitignore", ".ci/run", ".ci/pythons"}
LARGEST = 500_000
"""Bytes of the largest tracked file: a picture of the README, or a stored result of a showcase."""


def tracked() -> list[str]:
    """Tracked files, or, in a copy without a repository, none."""
    found = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert found.stdout or not (ROOT / ".git").exists()
    return [name for name in found.stdout.split("\0") if name and (ROOT / name).exists()]


def test_only_kinds_of_files_that_the_project_writes_are_tracked() -> None:
    strange = [
        name for name in tracked() if Path(name).suffix not in KINDS or (not Path(name).suffix and name not in BARE)
    ]
    assert not strange


def test_no_tracked_file_is_large() -> None:
    assert not [name for name in tracked() if (ROOT / name).stat().st_size > LARGEST]
