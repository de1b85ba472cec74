"""Runs of the kernels on many ranks: same bits, leaps, stops, kills, other numbers of ranks, errors, refusals."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import flocking as fk
from flocking.engine.driver.registry import engine_named
from flocking.engine.lammps.domains.session import DomainSession
from flocking.engine.protocol.session import Stored
from flocking.errors import InvalidInput, StepTooLarge, UnsupportedLaw
from flocking.papers import ALL_KEYS, paper
from tests.mpi.domain_cases import case
from tests.mpi.domain_run_job import whole
from tests.mpi.jobs import MPIEXEC, ROOT, WAITING, Cases, launch
from tests.mpi.laws import start

pytestmark = pytest.mark.mpi


MODULE = "tests.mpi.domain_run_job"


def job(ranks, what, **asked):
    """Start a job whose ranks end each other, or which is ended; the finished process."""
    return launch(ranks, sys.executable, "-m", MODULE, json.dumps({"what": what, **asked}))


@pytest.fixture(scope="module")
def on_two(tmp_path_factory):
    """What came out of cases on two ranks, which one job has run."""
    names = ("threads", "single", "lost", "too large", "nan on one rank")
    return Cases(2, tmp_path_factory.mktemp("two")).run(MODULE, {name: {} for name in names}).of


@pytest.fixture(scope="module")
def on_four(tmp_path_factory):
    """The same on four ranks."""
    names = ("twice", "leaps", "few")
    return Cases(4, tmp_path_factory.mktemp("four")).run(MODULE, {name: {} for name in names}).of


@pytest.fixture(scope="module")
def streams():
    """The run of the streams on one rank."""
    return whole()


def test_the_same_number_of_ranks_gives_the_same_bits(on_four):
    found = on_four("twice")
    assert found["migrated"] > 20
    assert np.array_equal(found["q"], found["again"])
    assert np.array_equal(found["energy"], found["energy_again"])


def test_bits_do_not_depend_on_the_threads_of_a_rank(on_two):
    found = on_two("threads")
    assert np.array_equal(found["q"], found["again"])
    assert np.array_equal(found["energy"], found["energy_again"])


def test_single_precision(on_two):
    found = on_two("single")
    made, options = case("streams with hysteresis")
    made = made.with_(t_end=0.1)
    reference = fk.evaluate(made.law, made.start)
    scale = reference.pair_force_sum + np.linalg.norm(reference.u, axis=1) + 1.0
    error = np.linalg.norm(found["begin"] - reference.u, axis=1) / scale
    assert 1e-9 < error.max() < 1e-5
    run = fk.simulate(made, engine="tiles", precision="float32", threads=1, progress=False, **options)
    np.testing.assert_allclose(found["q"], run.q, rtol=0, atol=1e-3)


def test_a_checkpoint_that_was_tampered_with_is_refused():
    made, options = case("streams with hysteresis")
    session = fk.start(made, "lammps", threads=1, **options)
    session.advance(0.05)
    numbers, arrays = session.pack()
    stored = Stored(made, None, session.records.counts, lambda: session.run())
    again = DomainSession.unpack((numbers, arrays), stored, {"threads": 1})
    assert np.array_equal(again.state.q, session.state.q)
    assert np.array_equal(again.state.links, session.state.links)
    again.close()
    names = numbers["session"]["dict"]["crowd"]["of"]["fields"]["dict"]
    links = names["links"]["list"][0]["tuple"]
    place, offsets, partners = names["q"]["array"], links[0]["array"], links[1]["array"]
    broken = [
        (place, arrays[place][:-1]),
        (place, np.where(arrays[place] > 0, np.nan, 1.0)),
        (offsets, arrays[offsets][::-1].copy()),
        (offsets, arrays[offsets] + 1),
        (partners, np.full_like(arrays[partners], 10**6)),
        (partners, arrays[partners][:-1]),
    ]
    for name, array in broken:
        with pytest.raises(ValueError, match=r"crowd"):
            DomainSession.unpack((numbers, {**arrays, name: array}), stored, {"threads": 1})
    session.close()


def test_agents_that_leap_over_domains_are_found(on_four):
    found = on_four("leaps")
    assert found["migrated"] > 20
    np.testing.assert_allclose(found["q"], found["expected"], rtol=0, atol=1e-9)


def test_agents_that_lammps_lost_are_placed_again_with_their_links(on_two, streams):
    found = on_two("lost")
    assert found["lost"] > 3
    np.testing.assert_allclose(found["q"], streams["q"], rtol=0, atol=1e-9)
    assert np.array_equal(found["links"], streams["links"])


def test_a_killed_rank_ends_the_job_and_other_numbers_of_ranks_and_threads_go_on(tmp_path, streams):
    folder = tmp_path / "run"
    done = job(4, "killed", save=str(folder))
    assert done.returncode != 0
    assert "BAD TERMINATION" in done.stdout + done.stderr
    left = fk.read_run(folder)
    assert left.status == "unfinished"
    assert 2 <= len(left.t) < 6
    for ranks, threads in ((1, 2), (2, 3), (3, None)):
        copy = shutil.copytree(folder, tmp_path / f"on {ranks}")
        words = [] if threads is None else ["--threads", str(threads)]
        if ranks == 1:
            fk.resume(copy, progress=False, threads=threads)
        else:
            again = launch(ranks, sys.executable, "-m", "flocking", "resume", str(copy), *words)
            assert again.returncode == 0, again.stderr[-3000:]
        run = fk.read_run(copy)
        assert run.finished
        np.testing.assert_allclose(run.q, streams["q"], rtol=0, atol=1e-9)
        assert np.array_equal(run.links, streams["links"])
        np.testing.assert_allclose(run.trace["energy"][-1], streams["energy"][-1], rtol=1e-9)
        assert run.provenance["ranks"] == ranks
        assert threads in (None, run.provenance["threads"])
        assert run.provenance["forces"] == "kernels"


def test_bodies_go_on_after_a_killed_rank_on_another_number_of_ranks(tmp_path):
    folder, asked = tmp_path / "run", {"name": "streams, a chain of bodies", "t_end": 0.3}
    done = job(3, "killed", save=str(folder), **asked)
    assert done.returncode != 0
    left = fk.read_run(folder)
    assert left.status == "unfinished"
    assert set(left.columns) == {"applied", "heading"}
    again = launch(2, sys.executable, "-m", "flocking", "resume", str(folder))
    assert again.returncode == 0, again.stderr[-3000:]
    expected, run = whole(**asked), fk.read_run(folder)
    assert run.finished
    np.testing.assert_allclose(run.q, expected["q"], rtol=0, atol=1e-9)
    for name, values in run.columns.items():
        np.testing.assert_allclose(values, expected[f"column {name}"], rtol=0, atol=1e-9, err_msg=name)
    np.testing.assert_allclose(run.trace["energy"][-1], expected["energy"][-1], rtol=1e-9)


def test_ctrl_c_on_two_ranks_saves_the_run(tmp_path):
    folder = tmp_path / "run"
    words = json.dumps(
        {"what": "whole", "save": str(folder), "t_end": 1e6, "frames": 2, "out": str(tmp_path / "out.npz")}
    )
    process = subprocess.Popen(
        [MPIEXEC, "-n", "2", sys.executable, "-m", MODULE, words], cwd=ROOT, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, env={**os.environ, "OMP_NUM_THREADS": "1", **WAITING},
    )  # fmt: skip
    # The job writes its first rank's process identity when it has made its first steps.
    while not (tmp_path / "out.npz.pid").exists():
        assert process.poll() is None, process.communicate()[1][-3000:]
        time.sleep(0.05)
    os.kill(int((tmp_path / "out.npz.pid").read_text()), signal.SIGINT)
    _, errors = process.communicate(timeout=120)
    left = fk.read_run(folder)
    assert left.status.startswith("interrupted"), errors[-3000:]
    assert left.trace["time"][-1] > 0


def test_an_error_of_one_rank_is_raised_on_all(on_two):
    found = on_two("too large")
    assert set(found["raised"]) == {"StepTooLarge"}
    assert len(found["raised"]) == 2


def test_a_failure_of_one_rank_ends_all():
    done = job(2, "fails")
    assert done.returncode != 0
    assert "this rank has had enough" in done.stderr


def test_an_error_of_the_library_on_one_rank_alone_ends_all():
    done = job(2, "refuses")
    assert done.returncode != 0
    assert "not all ranks did" in done.stderr
    assert "patience" in done.stderr


def test_what_is_not_a_number_on_one_rank_is_told_on_all(on_two):
    found = on_two("nan on one rank")
    assert set(found["raised"]) == {"NotFinite"}


def test_fewer_agents_than_ranks(on_four):
    found = on_four("few")
    assert len(found) == 6
    for name, gaps in found.items():
        assert max(gaps) <= 1e-12, name


def scenario(graph, *terms, agents=None):
    return fk.Scenario(fk.Law(graph, terms), start(2, 20), 0.1, agents or fk.Agents())


def test_what_is_not_run_is_refused_by_name():
    pull = fk.Gradient(fk.Potential("(r - 7)**2"))
    with pytest.raises(UnsupportedLaw, match=r"tiled engine.*functional.*engine='exact'"):
        fk.start(scenario(fk.Proximity(8.4), fk.Consensus(1.0, functional=True)), "lammps")
    with pytest.raises(UnsupportedLaw, match=r"Hysteresis with a gap.*engine='tiles'"):
        fk.start(scenario(fk.Hysteresis(8.4, 1.0), pull), "lammps", forces="pair styles")


def test_every_scenario_of_a_paper_that_tiles_run_runs_here():
    ran = set()
    for key in ALL_KEYS:
        for name, make in paper(key).scenarios().items():
            made = make(0)
            refused = {engine: bool(engine_named(engine).why_not(made)) for engine in ("tiles", "lammps")}
            assert refused["tiles"] == refused["lammps"], name
            ran |= set() if refused["lammps"] else {key}
    # The other three move in discrete time, which neither engine knows.
    assert len(ran) == 7


def test_options_that_would_be_ignored_are_refused():
    made = scenario(fk.Proximity(8.4), fk.Gradient(fk.Potential("(r - 7)**2")))
    with pytest.raises(InvalidInput, match=r"ledger.*0 or 1.*kernels"):
        fk.start(made, "lammps", ledger=5)
    with pytest.raises(InvalidInput, match=r"scheme.*only for forces='kernels'"):
        fk.start(made, "lammps", forces="pair styles", scheme="rk4")
    with pytest.raises(InvalidInput, match="forces must be one of"):
        fk.start(made, "lammps", forces="mine")


def test_the_automatic_step_is_that_of_the_tiled_engine():
    made = scenario(fk.Proximity(8.4), fk.Gradient(fk.Potential("(r - 7)**2")), fk.Consensus(3.0))
    one, other = fk.start(made, "lammps"), fk.start(made, "tiles")
    assert one.step == other.step
    one.close()
    with pytest.raises(StepTooLarge):
        fk.simulate(made.with_(t_end=10.0), engine="lammps", step=2.0, progress=False)


def test_a_law_that_is_not_obeyed_is_noticed():
    """Agents that follow a plant: the ledger of the declared law does not close."""
    made = scenario(fk.Proximity(8.4), fk.Gradient(fk.Potential("(r - 7)**2")), fk.Consensus(1.0)).with_(t_end=1.0)
    plant = fk.Law(made.law.graph, [fk.Gradient(fk.Potential("(r - 7)**2")), fk.Consensus(1.1)])
    run = fk.simulate(made, engine="lammps", step=0.005, plant=plant, progress=False)
    honest = fk.simulate(made, engine="lammps", step=0.005, progress=False)
    assert np.abs(run.residual[-1]) > 10.0 * np.abs(honest.residual[-1])
    assert str(fk.audit(run)["ledger"].verdict) == "fails"
