"""A stopped run of LAMMPS that an earlier version of the library wrote goes on."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.engine.storage.test_formats import check_going_on, unpacked

pytestmark = pytest.mark.mpi


def test_a_stopped_run_opens_and_goes_on(tmp_path: Path) -> None:
    check_going_on("lammps", unpacked("lammps", tmp_path / "run"))
