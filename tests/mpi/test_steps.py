"""The step that is chosen when none is given, and what is said of one that is too large."""

from __future__ import annotations

import json
import re
import sys

import numpy as np
import pytest

import flocking as fk
from flocking.engine.lammps.session import LammpsOptions, LammpsSession
from flocking.engine.tiles.session import TilesOptions, TilesSession
from flocking.errors import NotFinite, StepTooLarge, UnsupportedLaw
from tests.mpi.job import scenario
from tests.mpi.jobs import launch
from tests.mpi.laws import PAIR_STYLES

pytestmark = pytest.mark.mpi


def springs(t_end=3.0, frames=7, strength=200.0):
    law = fk.Law(fk.Proximity(5.0), [fk.Gradient(fk.Potential("k*(r - 1)**2", k=strength)), fk.Consensus(0.5)])
    return fk.Scenario(law, fk.State([[0.0, 0.0], [1.3, 0.0], [0.5, 0.9]]), t_end=t_end, frames=frames)


@pytest.mark.parametrize(
    ("name", "dimension"), [("olfati-saber (34)", 2), ("olfati-saber (58)", 3), ("olfati-saber (66)", 2)]
)
def test_the_step_is_that_of_the_tiled_engine(name, dimension):
    made = scenario(name, dimension)
    session = LammpsSession(made, LammpsOptions(ledger=0))
    session.close()
    assert session.step == pytest.approx(TilesSession(made, TilesOptions(ledger=False)).step, rel=1e-12)
    assert 1e-4 < session.step < made.t_end / 30


@pytest.mark.parametrize(
    ("name", "dimension"), [("olfati-saber (34)", 2), ("tanner II (5)", 3), ("shi (4)", 2), ("two graphs", 2)]
)
def test_books_close_with_the_chosen_step_though_links_switch(name, dimension):
    run = fk.simulate(scenario(name, dimension, t_end=4.0, frames=3), **PAIR_STYLES, progress=False)
    assert run.finished
    assert np.abs(run.trace["jumped"]).max() > 0.05 * run.turnover
    assert np.abs(run.residual).max() < 0.03 * run.turnover


def test_rows_of_the_ledger_get_rare_in_large_groups():
    assert [LammpsOptions().rows(n) for n in (1, 5000, 100_000, 10**7)] == [1, 1, 25, 100]
    assert LammpsOptions(ledger=3, forces="pair styles").rows(100_000) == 3


def test_a_step_too_large_for_the_ledger_says_which_would_do():
    with pytest.raises(StepTooLarge, match=r"A step of .* would do\.") as caught:
        fk.simulate(springs(), **PAIR_STYLES, step=0.1, progress=False)
    assert len(caught.value.run.t) >= 1
    assert fk.simulate(springs(), **PAIR_STYLES, step=caught.value.would_do, progress=False).finished
    assert fk.simulate(springs(), **PAIR_STYLES, progress=False).finished


def parting(potential, radius):
    law = fk.Law(fk.Proximity(radius), [fk.Gradient(fk.Potential(potential)), fk.Consensus(0.1)])
    start = fk.State([[0.0, 0.0], [3.5, 0.0]], [[0.0, 0.0], [1.5, 0.3]])
    return fk.Scenario(law, start, t_end=2.0, frames=5)


def test_links_that_break_where_a_piece_begins_have_the_energy_of_below():
    """(r - 2)^2/4 stores 1 at the radius, 4, whatever the formula says from there on."""
    runs = [
        fk.simulate(parting(potential, 4.0), **PAIR_STYLES, step=0.002, progress=False)
        for potential in ("(r - 2)**2/4", "where(r < 4, (r - 2)**2/4, 0)", "where(r < 4, (r - 2)**2/4, 9)")
    ]
    for run in runs:
        assert run.trace["jumped"][-1] == pytest.approx(-1.0, abs=1e-9)
        assert np.abs(run.residual).max() < 1e-3
        np.testing.assert_allclose(run.q, runs[0].q, atol=1e-9)


@pytest.mark.parametrize("forces", ["kernels", "pair styles"])
def test_no_step_is_recommended_for_a_potential_that_jumps_where_pairs_are_linked(forces):
    made = parting("where(r < 4, (r - 2)**2/4, (r - 2)**2/4 + 3)", 7.0)
    with pytest.raises(UnsupportedLaw, match=r"jumps at a distance of 4, .* or ledger=False"):
        fk.simulate(made, engine="lammps", forces=forces, step=0.01, progress=False)
    for ledger in (False, 0):
        run = fk.simulate(made, engine="lammps", forces=forces, step=0.01, ledger=ledger, progress=False)
        assert run.finished
        assert len(run.trace) == 0 or len(run.trace["time"]) <= 1


def test_a_step_too_large_for_a_collision_says_which_would_do():
    law = fk.Law(fk.Proximity(4.0), [fk.Gradient(fk.Potential("1/r + r/16")), fk.Consensus(1.0)])
    made = fk.Scenario(law, fk.State([[0.0, 0.0], [2.0, 0.0]], [[3.0, 0.0], [-3.0, 0.0]]), t_end=1.0, frames=[1.0])
    step, tries = 0.1, 0
    while True:
        try:
            run = fk.simulate(made, **PAIR_STYLES, step=step, progress=False)
            break
        except StepTooLarge as error:
            # Closer up another, smaller step is needed: what is said holds for what was met until then.
            step, tries, declared = error.would_do, tries + 1, error
    assert 1 <= tries <= 4
    assert "a pair at distance" in str(declared)
    assert declared.agents == (0, 1)
    assert run.closest_linked.distance < 0.4


def test_a_run_that_flies_apart_says_which_step_would_do():
    made = springs(t_end=100.0, frames=3, strength=1e6)
    with pytest.raises(StepTooLarge, match=r"would do") as caught:
        fk.simulate(made, **PAIR_STYLES, step=0.05, ledger=5, progress=False)
    assert 0 < caught.value.would_do < 0.001
    short = made.with_(t_end=200 * caught.value.would_do)
    assert fk.simulate(short, **PAIR_STYLES, step=caught.value.would_do, progress=False).finished


def test_a_start_of_infinite_energy_is_told():
    law = fk.Law(fk.Proximity(4.0), [fk.Gradient(fk.Potential("1/(r - 1)**2"))])
    made = fk.Scenario(law, fk.State([[0.0, 0.0], [1.0, 0.0]]), 1.0)
    with pytest.raises(NotFinite, match="potential is infinite"):
        fk.simulate(made, **PAIR_STYLES, step=0.01, progress=False)


def test_on_two_ranks_it_is_told_once_and_what_was_computed_stays(tmp_path):
    file, folder = tmp_path / "springs.toml", tmp_path / "run"
    fk.write_scenario(springs(), file)
    words = (sys.executable, "-m", "flocking", "run", str(file), "--engine", "lammps", "--out", str(folder))
    done = launch(2, *words, "--step", "0.1")
    assert done.returncode != 0
    assert "Traceback" not in done.stderr
    assert done.stderr.count("is too large") == 1
    would_do = re.search(r"A step of (\S+) would do", done.stderr)[1]
    left = fk.read_run(folder)
    assert "too large" in left.status
    assert len(left.t) >= 1
    again = launch(2, *words[:-1], str(tmp_path / "again"), "--step", would_do)
    assert again.returncode == 0, again.stderr
    assert fk.read_run(tmp_path / "again").finished


def test_what_lammps_says_on_one_rank_alone_ends_the_job_without_a_traceback(tmp_path):
    asked = {"law": "olfati-saber (35)", "dimension": 2, "step": 0.01, "scenario": {"n": 60}, "break": True}
    done = launch(2, sys.executable, "-m", "tests.mpi.job", json.dumps(asked))
    assert done.returncode != 0
    assert "rank 1 of 2" in done.stderr
    assert "would do" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("forces", ["kernels", "pair styles"])
@pytest.mark.parametrize("body", [fk.PointMass(), fk.SingleIntegrator()], ids=["order 2", "order 1"])
def test_agents_at_rest_at_their_distances_stay(body, forces):
    """Their energies are what rounding makes of zero: no step is too large for them."""
    law = fk.Law(fk.Proximity(1.0), [fk.Gradient(fk.Potential("(r - 0.7)**2/2"))])
    q = np.stack([0.7 * np.arange(40.0), np.zeros(40)], axis=1)
    scenario = fk.Scenario(law, fk.State(q), t_end=1.0, frames=3, agents=body)
    run = fk.simulate(scenario, engine="lammps", step=0.01, forces=forces, progress=False)
    assert run.finished
    assert np.abs(run.q - q).max() < 1e-14
    assert str(fk.audit(run)["ledger"].verdict) in ("holds", "not resolved")
