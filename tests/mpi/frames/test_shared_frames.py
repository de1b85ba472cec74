"""Ranks that write chunks of the same arrays: the bytes of frames that the first rank writes, kills, full disks."""

from __future__ import annotations

import json
import sys

import numpy as np
import pytest

import flocking as fk
from tests.engine.storage.test_frame_parts import files
from tests.mpi import domain_cases
from tests.mpi.held import held_cases
from tests.mpi.held.test_held import HARDEST_BODIES
from tests.mpi.jobs import launch

pytestmark = pytest.mark.mpi
IDEAL = "streams, a chain of bodies"
CASES = [(IDEAL, False, "float64"), (IDEAL, False, "float32"), (HARDEST_BODIES, True, "float64")]


def job(ranks, folder, do, name=IDEAL, held=False, precision="float64", **more):
    words = {"folder": str(folder), "do": do, "name": name, "held": held, "precision": precision, **more}
    return launch(ranks, sys.executable, "-m", "tests.mpi.frames.shared_frames_job", json.dumps(words))


def said(done):
    """Errors, parts in memory and whether frames were shared, of each rank."""
    assert done.returncode == 0, done.stderr[-3000:]
    return json.loads(done.stdout.strip().splitlines()[-1])


def expected(name, held):
    scenario, options = (held_cases if held else domain_cases).case(name)
    return fk.simulate(scenario, engine="tiles", threads=1, progress=False, **options)


@pytest.mark.parametrize(("name", "held", "precision"), CASES)
def test_the_bytes_are_those_that_the_first_rank_writes(tmp_path, name, held, precision):
    shared, whole = (job(4, tmp_path / do, do, name, held, precision) for do in ("share", "gather"))
    assert said(shared) == [["", 0, True]] * 4
    assert said(whole) == [["", 0, False]] * 4
    one, other = files(tmp_path / "share"), files(tmp_path / "gather")
    assert len([x for x in one if x.startswith("position")]) > 12
    assert one == other
    run = fk.read_run(tmp_path / "share")
    assert run.finished
    if precision == "float64":
        found = expected(name, held)
        np.testing.assert_allclose(run.q, found.q, rtol=0, atol=1e-9)
        for column, values in found.columns.items():
            np.testing.assert_allclose(run.columns[column], values, rtol=0, atol=1e-9)


@pytest.mark.parametrize(("name", "held", "precision"), [CASES[0], CASES[2]])
@pytest.mark.parametrize("ranks", [1, 3])
def test_a_killed_job_goes_on_with_other_ranks(tmp_path, name, held, precision, ranks):
    folder = tmp_path / "run"
    done = job(4, folder, "die", name, held, precision, at=0.5)
    assert done.returncode != 0
    left = fk.read_run(folder)
    found = expected(name, held)
    assert 2 <= len(left.t) < len(found.t)
    np.testing.assert_allclose(left.q, found.q[: len(left.t)], rtol=0, atol=1e-9)
    again = job(ranks, folder, "resume")
    assert again.returncode == 0, again.stderr[-3000:]
    run = fk.read_run(folder)
    assert run.finished
    np.testing.assert_allclose(run.q, found.q, rtol=0, atol=1e-9)
    for column, values in found.columns.items():
        np.testing.assert_allclose(run.columns[column], values, rtol=0, atol=1e-9)


def test_a_full_disk_of_one_rank_is_an_error_of_all(tmp_path):
    found = said(job(2, tmp_path / "run", "full"))
    assert all("no space left" in text for text, _, _ in found)
    left = fk.read_run(tmp_path / "run")
    assert left.status == "unfinished"
    assert len(left.t) < 2
