"""Held control, messages, losses and noise on one, two and four ranks, against the tiled engine on one process."""

from __future__ import annotations

import json
import sys
from functools import cache

import numpy as np
import pytest

import flocking as fk
from flocking.engine.driver.simulate import open_session
from flocking.engine.lammps.engine import ENGINE
from flocking.engine.lammps.held.session import HeldDomainSession
from flocking.engine.lammps.options import LammpsOptions
from flocking.engine.protocol.session import Stored
from flocking.errors import InvalidInput, UnsupportedLaw
from tests.mpi.held.held_cases import BODIES, CASES, case
from tests.mpi.jobs import Cases, launch

pytestmark = pytest.mark.mpi
RANKS = (1, 2, 4)
HARDEST = "each sends by itself, noise with memory"
"""The case of points with most that travels: links by what agents know, samples, errors, forces that wait."""
HARDEST_BODIES = "a chain of bodies, all that travels"
"""The same with lagged forces, headings and gusts."""


def job(ranks, **words):
    return launch(ranks, sys.executable, "-m", "tests.mpi.held.held_job", json.dumps(words))


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """What came out of each case, by number of ranks."""
    module, cases = "tests.mpi.held.held_job", {name: {} for name in CASES}
    run = {ranks: Cases(ranks, tmp_path_factory.mktemp(f"ranks{ranks}")).run(module, cases) for ranks in RANKS}
    return cache(lambda ranks, name: run[ranks].of(name))


@pytest.mark.parametrize("name", CASES)
def test_motions_links_and_ledger_are_those_of_one_process(found, name):
    scenario, options = case(name)
    session = fk.start(scenario, "tiles", threads=1, **options)
    session.advance(scenario.t_end)
    rates, run = session.accelerations(), session.run()
    for ranks in RANKS:
        got = found(ranks, name)
        assert np.array_equal(got["t"], run.t)
        np.testing.assert_allclose(got["q"], run.q, rtol=0, atol=1e-9)
        np.testing.assert_allclose(got["p"], run.p, rtol=0, atol=1e-9)
        np.testing.assert_allclose(got["rates"], rates, rtol=0, atol=1e-8)
        assert np.array_equal(got["last"], got["q"][-1])
        assert {name for name in got if name.startswith("columns ")} == {f"columns {name}" for name in run.columns}
        for column, values in run.columns.items():
            np.testing.assert_allclose(got[f"columns {column}"], values, rtol=0, atol=1e-9)
            assert np.array_equal(got[f"column {column}"], got[f"columns {column}"][-1])
        assert np.array_equal(got["links"], run.links)
        assert got["closest"] == pytest.approx(run.closest_linked.distance, rel=1e-9)
        assert len(got["trace"]) == len(run.trace)
        for column in run.trace.dtype.names if len(run.trace) else ():
            size = np.abs(run.trace["energy"]).max() + np.abs(run.trace["dissipated"]).max() + 1.0
            np.testing.assert_allclose(got["trace"][column], run.trace[column], rtol=0, atol=1e-10 * size)
        assert got["owned"].sum() == scenario.start.n


def test_agents_cross_the_borders_of_ranks(found):
    for ranks in (2, 4):
        many = {name: int(found(ranks, name)["migrated"]) for name in CASES}
        assert sum(many.values()) > 500, many
        assert many[HARDEST] > 20, many
        assert many[HARDEST_BODIES] > 20, many
        assert sum(many[name] for name in BODIES) > 200, many
        assert many["messages lost with distance, noise, periodic"] > 50, many


def test_links_by_what_agents_know_are_not_those_of_the_truth():
    """Else links that are equal would say nothing about what agents know."""
    scenario, options = case(HARDEST)
    session = fk.start(scenario, "tiles", threads=1, **options)
    session.advance(scenario.t_end)
    particles = session._particles
    known, true = (np.sort(x.rows[x.rows > 2**31 - 1]) for x in (particles.known[0], particles.lists[0]))
    assert len(known) != len(true) or not np.array_equal(known, true)
    assert session._memory.waiting


@pytest.mark.parametrize("name", [HARDEST, HARDEST_BODIES])
def test_a_killed_rank_ends_the_job_and_another_number_of_ranks_goes_on(tmp_path, name):
    folder = tmp_path / "run"
    done = job(2, name=name, save=str(folder), die_at=0.3)
    assert done.returncode != 0
    left = fk.read_run(folder)
    assert left.status == "unfinished"
    scenario, options = case(name)
    assert 2 <= len(left.t) < len(scenario.frame_times)
    again = launch(3, sys.executable, "-m", "flocking", "resume", str(folder))
    assert again.returncode == 0, again.stderr[-3000:]
    run = fk.read_run(folder)
    expected = fk.simulate(scenario, engine="tiles", threads=1, progress=False, **options)
    assert run.finished
    np.testing.assert_allclose(run.q, expected.q, rtol=0, atol=1e-9)
    assert np.array_equal(run.links, expected.links)
    for column, values in expected.columns.items():
        np.testing.assert_allclose(run.columns[column], values, rtol=0, atol=1e-9)
    np.testing.assert_allclose(run.trace["energy"][-1], expected.trace["energy"][-1], rtol=1e-9)
    assert run.provenance["ranks"] == 3
    assert run.provenance["world"] == expected.provenance["world"]


@pytest.mark.parametrize("name", [HARDEST, HARDEST_BODIES])
def test_a_session_goes_on_in_the_middle_of_a_step_and_bad_checkpoints_are_refused(name):
    scenario, options = case(name)
    session = open_session(ENGINE, scenario, LammpsOptions(threads=1, **options))
    session.advance(0.333)
    numbers, arrays = session.pack()
    stored = Stored(scenario, None, session.records.counts, lambda: session.run())
    again = HeldDomainSession.unpack((numbers, arrays), stored, {"threads": 1})
    assert np.array_equal(again.state.q, session.state.q)
    assert np.array_equal(again.state.links, session.state.links)
    assert np.array_equal(again.accelerations(), session.accelerations())
    for column, values in session.state.columns.items():
        assert np.array_equal(again.state.columns[column], values)
    for each in (session, again):
        each.advance(0.45)
    np.testing.assert_allclose(again.state.q, session.state.q, rtol=0, atol=1e-11)
    names = numbers["session"]["dict"]
    rows, links = names["rows"]["array"], names["links"]["list"][1]["tuple"]
    off = names["samples"]["list"][0]["array"]
    partners = links[1]["array"]
    for name, array in (
        (rows, arrays[rows][:-1]),
        (rows, arrays[rows][:, :-1].copy()),
        (rows, np.where(np.arange(arrays[rows].shape[1]) == 1, np.nan, arrays[rows])),
        (rows, np.where(np.arange(arrays[rows].shape[1]) == 7, np.inf, arrays[rows])),
        (off, arrays[off][:-1]),
        (partners, np.full_like(arrays[partners], 10**6)),
        (partners, arrays[partners][:-1]),
    ):
        with pytest.raises(ValueError, match="session"):
            HeldDomainSession.unpack((numbers, {**arrays, name: array}), stored, {"threads": 1})
    again.close()
    session.close()


def test_the_automatic_step_is_that_of_the_tiled_engine():
    scenario, _ = case("held")
    one, other = fk.start(scenario, "lammps"), fk.start(scenario, "tiles")
    assert one.step == other.step
    one.close()


def test_what_is_not_run_is_refused_by_name():
    scenario, _ = case("held")
    with pytest.raises(UnsupportedLaw, match="control=Held"):
        fk.start(scenario, "lammps", forces="pair styles")
    with pytest.raises(UnsupportedLaw, match=r"plant under held control"):
        fk.start(scenario, "lammps", plant=scenario.law)
    lossy = scenario.with_(information=fk.Messages(0.05, loss=fk.Bernoulli(0.1)))
    with pytest.raises(InvalidInput, match="expires"):
        fk.start(lossy, "lammps")
    with pytest.raises(UnsupportedLaw, match="SafetyFilter"):
        fk.start(scenario.with_(control=fk.SafetyFilter(0.1, distance=1.0, acceleration=2.0)), "lammps")
    session = fk.start(scenario, "lammps")
    with pytest.raises(UnsupportedLaw, match="neither law nor state"):
        session.replace(law=scenario.law)
    session.close()
