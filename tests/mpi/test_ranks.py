"""One, two and four ranks give the same run; a rank that dies ends the job; a killed run goes on."""

from __future__ import annotations

import json
import sys

import numpy as np
import pytest

import flocking as fk
from flocking.engine.driver.simulate import run_session
from flocking.engine.lammps.session import LammpsOptions, LammpsSession
from flocking.engine.storage.run_writer import RunWriter
from flocking.errors import InvalidInput, StorageError
from tests.mpi.job import computed, scenario
from tests.mpi.jobs import Cases, launch
from tests.mpi.laws import PAIR_STYLES

pytestmark = pytest.mark.mpi
RUN = (sys.executable, "-m", "flocking", "run", "--engine", "lammps", "--step", "0.01")
FIGURES = {"law": "olfati-saber (58)", "dimension": 2, "step": 0.01}


SPLIT = {"law": "split", "scenario": {"t_end": 1.0, "speed": 6.0, "n": 200}, "options": {"ledger": 10}}


@pytest.fixture(scope="module")
def split(tmp_path_factory):
    """What came out of the groups that fly apart, in the plane and in space, by number of ranks."""
    cases = {f"split {m}": {**SPLIT, "dimension": m} for m in (2, 3)}
    return {k: Cases(k, tmp_path_factory.mktemp(f"ranks{k}")).run("tests.mpi.job", cases) for k in (2, 4)}


@pytest.mark.parametrize("dimension", [2, 3])
def test_ranks_agree_while_agents_cross_their_borders(split, dimension):
    several = [split[ranks].of(f"split {dimension}") for ranks in (2, 4)]
    found = [computed(**SPLIT, dimension=dimension), *several]
    assert [int(f["ranks"]) for f in found] == [1, 2, 4]
    assert min(found[1]["owned"]) > 0
    assert sum(found[2]["crossed"]) > 20
    for other in found[1:]:
        np.testing.assert_allclose(other["q"], found[0]["q"], rtol=0, atol=1e-9)
        np.testing.assert_allclose(other["p"], found[0]["p"], rtol=0, atol=1e-9)
        assert np.abs(other["trace"]["energy"] / found[0]["trace"]["energy"] - 1).max() < 1e-10


SAVED = {**FIGURES, "scenario": {"t_end": 1.0, "frames": 11, "n": 150}, "every": 0.0, "options": {"ledger": 5}}


@pytest.fixture(scope="module")
def expected(tmp_path_factory):
    """The run that no rank's death stops, on one rank."""
    folder = tmp_path_factory.mktemp("whole") / "run"
    computed(**SAVED, save=folder)
    return fk.read_run(folder)


def test_a_case_that_ends_its_job_is_named_and_the_others_are_run(tmp_path):
    """What other tests get from jobs of many cases rests on this."""
    quick = {"law": "olfati-saber (35)", "dimension": 2, "scenario": {"n": 20, "t_end": 0.05, "frames": 2}}
    cases = {"first": quick, "dies": {**quick, "die_at": 0.0, "how": "signal"}, "last": quick}
    run = Cases(2, tmp_path).run("tests.mpi.job", cases)
    for name in ("first", "last"):
        assert run.of(name)["ranks"] == 2
    with pytest.raises(AssertionError, match=r"'dies' on 2 ranks: (.|\n)*BAD TERMINATION"):
        run.of("dies")
    with pytest.raises(AssertionError, match="'none' on 2 ranks left nothing"):
        run.of("none")


@pytest.mark.parametrize("how", ["signal", "error"])
def test_a_rank_that_dies_ends_the_job_and_the_run_goes_on_from_its_last_commit(tmp_path, expected, how):
    folder = tmp_path / "killed"
    dying = {**SAVED, "save": str(folder), "die_at": 0.55, "how": how}
    died = launch(2, sys.executable, "-m", "tests.mpi.job", json.dumps(dying))
    assert died.returncode != 0
    assert ("BAD TERMINATION" if how == "signal" else "this rank has had enough") in died.stdout + died.stderr
    left = fk.read_run(folder)
    assert left.status == "unfinished"
    assert 5 <= len(left.t) <= 6
    with pytest.raises(InvalidInput, match="threads is not an option"):
        fk.resume(folder, progress=False, threads=2)
    gone_on = fk.resume(folder, progress=False)  # on one rank
    assert gone_on.finished
    assert gone_on.trace["time"].tolist() == pytest.approx(expected.trace["time"].tolist(), abs=1e-12)
    np.testing.assert_allclose(gone_on.q, expected.q, rtol=0, atol=1e-9)
    np.testing.assert_allclose(gone_on.p, expected.p, rtol=0, atol=1e-9)
    np.testing.assert_allclose(gone_on.trace["supplied"], expected.trace["supplied"], rtol=1e-9)
    assert fk.read_run(folder).finished


def test_a_run_killed_before_its_first_commit_begins_anew(tmp_path):
    made = scenario("olfati-saber (35)", 2, n=30, t_end=0.2, frames=3)
    options = {"step": 0.01, "observe": True}
    how = {"engine": "lammps", "options": {**options, "forces": "pair styles"}}
    RunWriter.create(tmp_path / "run", made, with_links=True, observed=True, session=how).close()
    with pytest.raises(InvalidInput, match="threads is not an option"):
        fk.resume(tmp_path / "run", progress=False, threads=2)
    run = fk.resume(tmp_path / "run", progress=False)
    assert run.finished
    other = fk.simulate(made, **PAIR_STYLES, progress=False, **options)
    np.testing.assert_array_equal(run.q, other.q)
    np.testing.assert_array_equal(fk.read_run(tmp_path / "run").observables["order"], other.observables["order"])


@pytest.mark.parametrize("name", ["olfati-saber (35)", "shi (4)"])
def test_a_flock_that_grows_goes_on_as_if_never_stopped(tmp_path, name):
    """Some of its agents are outside LAMMPS's box when it is stopped between two searches for neighbours."""
    made = scenario(name, 2, n=100, t_end=0.5, frames=3)
    made = made.with_(start=fk.State(made.start.q, 0.6 * made.start.q + made.start.p, 3.0), t_end=3.5)
    whole = fk.simulate(made, **PAIR_STYLES, step=0.01, progress=False)
    for stop in (1, 7, 23, 40):
        session = LammpsSession(made, LammpsOptions(step=0.01))
        take, calls = session._take_steps, iter(range(10**6))

        def taking(to, take=take, calls=calls, stop=stop):
            if next(calls) == stop:
                raise KeyboardInterrupt
            take(to)

        session._take_steps = taking
        left = run_session(session, save=tmp_path / str(stop), progress=False, every=0.0)
        assert left.status.startswith("interrupted")
        run = fk.resume(tmp_path / str(stop), progress=False)
        assert run.finished
        np.testing.assert_allclose(run.q, whole.q, rtol=0, atol=1e-10)
        np.testing.assert_allclose(run.p, whole.p, rtol=0, atol=1e-10)


def test_a_damaged_checkpoint_is_told(tmp_path):
    folder = tmp_path / "run"
    made = scenario("olfati-saber (35)", 2, n=30, t_end=0.2, frames=3)
    session = LammpsSession(made, LammpsOptions(step=0.01))
    take, calls = session._take_steps, iter(range(10**6))

    def taking(to):
        if next(calls) == 5:
            raise KeyboardInterrupt
        take(to)

    session._take_steps = taking
    run_session(session, save=folder, progress=False, every=0.0)
    file = next(folder.glob("checkpoint-*"))
    data = bytearray(file.read_bytes())
    data[len(data) // 2] ^= 1
    file.write_bytes(data)
    with pytest.raises(StorageError, match="checksum"):
        fk.resume(folder, progress=False)


def test_the_command_line_runs_under_mpiexec_and_resumes(tmp_path):
    file, folder = tmp_path / "flock.toml", tmp_path / "run"
    made = scenario("olfati-saber (35)", 2, n=60, t_end=0.2, frames=3)
    fk.write_scenario(made, file)
    done = launch(2, *RUN, str(file), "--out", str(folder))
    assert done.returncode == 0, done.stderr[-3000:]
    assert done.stdout.count("status") == 1
    run = fk.read_run(folder)
    assert (run.finished, len(run.t), run.provenance["ranks"]) == (True, 3, 2)
    assert fk.audit(run).results
    again = launch(2, sys.executable, "-m", "flocking", "resume", str(folder))
    assert again.returncode == 0, again.stderr[-3000:]


def test_a_bad_folder_is_told_once_and_ends_all_ranks(tmp_path):
    file, folder = tmp_path / "flock.toml", tmp_path / "taken"
    folder.mkdir()
    (folder / "something").write_text("here")
    fk.write_scenario(scenario("olfati-saber (35)", 2, n=10, t_end=0.2, frames=3), file)
    done = launch(2, *RUN, str(file), "--out", str(folder))
    assert done.returncode != 0
    assert "not an empty folder" in done.stderr
    assert "Traceback" not in done.stderr
