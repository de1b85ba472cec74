"""Ranks that write chunks of the same arrays: the bytes of frames that the first rank writes, kills, full disks."""

from __future__ import annotations

import json
import shutil
import sys

import numpy as np
import pytest

import flocking as fk
from tests.engine.storage.test_frame_parts import files
from tests.mpi.frames.shared_frames_job import scenario_of, small
from tests.mpi.held.test_held import HARDEST_BODIES
from tests.mpi.jobs import Cases, launch

pytestmark = pytest.mark.mpi
IDEAL = "streams, a chain of bodies"
CASES = [(IDEAL, False, "float64"), (IDEAL, False, "float32"), (HARDEST_BODIES, True, "float64")]
MODULE = "tests.mpi.frames.shared_frames_job"


def words(folder, do, name=IDEAL, held=False, precision="float64", **more):
    return {"folder": str(folder), "do": do, "name": name, "held": held, "precision": precision, **more}


def job(ranks, folder, do, *case, **more):
    """Start a job whose ranks are ended, or one that goes on; the finished process."""
    return launch(ranks, sys.executable, "-m", MODULE, json.dumps(words(folder, do, *case, **more)))


def said(run, name):
    """Errors, parts in memory and whether frames were shared, of each rank."""
    return json.loads(str(run.of(name)["said"]))


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """Runs that four ranks have saved, and the folder that holds them: each case with frames shared and gathered."""
    folder = tmp_path_factory.mktemp("saved")
    made = {f"{do} {k}": words(folder / f"{do} {k}", do, *case) for k, case in enumerate(CASES) for do in DOINGS}
    return Cases(4, tmp_path_factory.mktemp("four")).run(MODULE, made), folder


DOINGS = ("share", "gather")


def expected(name, held):
    scenario, options = scenario_of(name, held)
    return fk.simulate(scenario, engine="tiles", threads=1, progress=False, **options)


@pytest.mark.parametrize("case", range(len(CASES)), ids=[" ".join(map(str, case)) for case in CASES])
def test_the_bytes_are_those_that_the_first_rank_writes(saved, case):
    run, folder = saved
    name, held, precision = CASES[case]
    assert said(run, f"share {case}") == [["", 0, True]] * 4
    assert said(run, f"gather {case}") == [["", 0, False]] * 4
    one, other = (files(folder / f"{do} {case}") for do in DOINGS)
    assert len([x for x in one if x.startswith("position")]) > 12
    assert one == other
    run = fk.read_run(folder / f"share {case}")
    assert run.finished
    if precision == "float64":
        found = expected(name, held)
        np.testing.assert_allclose(run.q, found.q, rtol=0, atol=1e-9)
        for column, values in found.columns.items():
            np.testing.assert_allclose(run.columns[column], values, rtol=0, atol=1e-9)


@pytest.mark.parametrize(("name", "held", "precision"), [CASES[0], CASES[2]])
def test_a_killed_job_goes_on_with_other_ranks(tmp_path, monkeypatch, name, held, precision):
    folder = tmp_path / "run"
    done = job(4, folder, "die", name, held, precision, at=0.5 * scenario_of(name, held)[0].t_end)
    assert done.returncode != 0
    left = fk.read_run(folder)
    found = expected(name, held)
    assert 2 <= len(left.t) < len(found.t)
    np.testing.assert_allclose(left.q, found.q[: len(left.t)], rtol=0, atol=1e-9)
    small(monkeypatch.setattr)
    for ranks in (1, 3):
        copy = shutil.copytree(folder, tmp_path / f"on {ranks}")
        if ranks == 1:
            fk.resume(copy, progress=False)
        else:
            again = job(ranks, copy, "resume")
            assert again.returncode == 0, again.stderr[-3000:]
        run = fk.read_run(copy)
        assert run.finished
        assert run.provenance["ranks"] == ranks
        np.testing.assert_allclose(run.q, found.q, rtol=0, atol=1e-9)
        for column, values in found.columns.items():
            np.testing.assert_allclose(run.columns[column], values, rtol=0, atol=1e-9)


def test_a_full_disk_of_one_rank_is_an_error_of_all(tmp_path):
    run = Cases(2, tmp_path).run(MODULE, {"full": words(tmp_path / "run", "full")})
    found = said(run, "full")
    assert len(found) == 2
    assert all("no space left" in text for text, _, _ in found)
    left = fk.read_run(tmp_path / "run")
    assert left.status == "unfinished"
    assert len(left.t) < 2
