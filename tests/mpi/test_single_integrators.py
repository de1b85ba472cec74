"""Agents of order 1 under LAMMPS: the steps of the Euler method, of the tiled engine and of the exact one's limit."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest

import flocking as fk
from flocking.engine.driver.lammps_export import export_deck
from flocking.engine.lammps import library
from flocking.engine.lammps.deck import make_deck
from flocking.engine.lammps.session import LammpsOptions, LammpsSession
from flocking.errors import EngineMissing, LawNotObeyed, StepTooLarge
from flocking.study.claims.claim import Verdict
from tests.mpi.job import computed, scenario
from tests.mpi.jobs import Cases, launch
from tests.mpi.laws import NAMES, PAIR_STYLES, law, start
from tests.mpi.test_export import LMP, frames

pytestmark = pytest.mark.mpi


def first_order(name, dimension, **changes):
    made = scenario(name, dimension, **changes)
    return made.with_(agents=fk.SingleIntegrator(made.agents.masses))


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("name", NAMES)
def test_velocities_are_those_of_the_law(name, dimension):
    state = start(dimension, t=0.7)
    found, agents = law(name, dimension, state.n)
    agents = fk.SingleIntegrator(agents.masses)
    made = fk.Scenario(found, state, t_end=state.t + 1.0, agents=agents, frames=2)
    session = LammpsSession(made, LammpsOptions(step=0.01, ledger=0))
    expected = fk.evaluate(found, state, agents=agents)
    bound = max(part.table_error for part in session.deck.parts)
    error = np.linalg.norm(session.accelerations() - expected.u, axis=1)
    size = expected.pair_force_sum + np.linalg.norm(expected.u, axis=1)
    assert (error <= 1e-12 * size + 40 * bound).all()
    assert (session.state.p == 0).all()
    session.close()


@pytest.mark.parametrize(
    ("name", "dimension"),
    [("olfati-saber (34)", 2), ("olfati-saber (58)", 3), ("shi (4)", 2), ("olfati-saber (66)", 2)],
)
def test_steps_are_those_of_the_tiled_engine(name, dimension):
    made = first_order(name, dimension, frames=[0.0, 0.103, 0.25, 0.5])
    one = fk.simulate(made, **PAIR_STYLES, step=0.005, progress=False)
    other = fk.simulate(made, engine="tiles", scheme="euler", step=0.005, ledger=False, progress=False)
    assert np.array_equal(one.t, other.t)
    assert np.abs(one.q[-1] - made.start.q).max() > 0.1
    np.testing.assert_allclose(one.q, other.q, rtol=0, atol=1e-9)
    assert (one.p == 0).all()
    assert one.provenance["scheme"] == "euler"


def test_errors_and_what_the_ledger_leaves_halve_with_the_step():
    made = first_order("olfati-saber (35)", 2, n=60, t_end=0.4, frames=2)
    exact = fk.simulate(made, engine="exact", progress=False)
    errors, left = [], []
    for step in (0.02, 0.01, 0.005):
        run = fk.simulate(made, **PAIR_STYLES, step=step, progress=False)
        errors.append(np.abs(run.q[-1] - exact.q[-1]).max())
        left.append(np.abs(run.residual).max())
    for found in (errors, left):
        assert 1.6 < found[0] / found[1] < 2.6
        assert 1.6 < found[1] / found[2] < 2.6
    assert left[0] < 0.05 * run.turnover
    for key in ("energy", "dissipated"):
        assert run.trace[-1][key] == pytest.approx(exact.trace[-1][key], abs=0.02 * exact.turnover)


def test_agreement_follows_its_closed_form():
    """dq/dt = -L q on the complete net: distances from the mean shrink as exp(-n t)."""
    n, t_end = 20, 0.1
    begin = fk.start.box(n, side=3.0, seed=2)
    law = fk.Law(fk.Proximity(50.0), [fk.Gradient(fk.Potential("0.5*r**2"))])
    run = fk.simulate(
        fk.Scenario(law, begin, t_end, agents=fk.SingleIntegrator()), **PAIR_STYLES, step=1e-4, progress=False
    )  # fmt: skip
    mean = begin.q.mean(axis=0)
    expected = mean + np.exp(-n * t_end) * (begin.q - mean)
    assert np.abs(run.q[-1] - expected).max() < 1e-3
    assert run.q[-1].mean(axis=0) == pytest.approx(mean, abs=1e-12)


def test_forces_are_held_against_the_law_and_a_gain_one_per_cent_off_fails_the_ledger(monkeypatch):
    made = first_order("olfati-saber (58)", 2, t_end=0.3, frames=2)
    run = fk.simulate(made, **PAIR_STYLES, progress=False)
    assert run.provenance["law_checks"] > 3
    assert run.provenance["law_gap"] < 0.1 * run.provenance["law_gap_allowed"]
    assert fk.audit(run)["ledger"].verdict == Verdict.HOLDS
    gradient, *others = made.law.terms
    stronger = fk.Gradient(gradient.potential.with_parameters(a=1.01, b=5.05))
    plant = fk.Law(made.law.graph, [stronger, *others])
    found = fk.audit(fk.simulate(made, **PAIR_STYLES, plant=plant, progress=False))["ledger"]
    assert found.verdict == Verdict.FAILS
    assert "differs from the declared law" in found.note
    from flocking.engine.lammps import pairs

    original = pairs.lepton
    monkeypatch.setattr(pairs, "lepton", lambda e: original(1.01 * e))
    with pytest.raises(LawNotObeyed, match="translation"):
        fk.simulate(made, **PAIR_STYLES, progress=False)


def test_a_session_goes_on_with_the_same_motion():
    made = first_order("olfati-saber (34)", 2, n=100)
    options = LammpsOptions(step=0.01)
    whole = LammpsSession(made, options)
    whole.advance(0.2)
    again = LammpsSession(made, options, restart=whole.restart())
    for session in (whole, again):
        session.advance(0.5)
    assert np.abs(whole.state.q - again.state.q).max() < 1e-12
    whole.close()
    again.close()


def test_ranks_agree_while_agents_cross_their_borders(tmp_path):
    asked = {
        "law": "olfati-saber (58)", "dimension": 2, "step": 0.002, "scenario": {"t_end": 0.5, "n": 200}, "order": 1,
        "options": {"ledger": 10},
    }  # fmt: skip
    found = [computed(**asked), Cases(2, tmp_path).run("tests.mpi.job", {"flock": asked}).of("flock")]
    assert sum(found[1]["crossed"]) > 3
    np.testing.assert_allclose(found[1]["q"], found[0]["q"], rtol=0, atol=1e-9)
    assert np.abs(found[1]["trace"]["energy"] / found[0]["trace"]["energy"] - 1).max() < 1e-10
    assert (found[1]["p"] == 0).all()


def test_a_rank_that_dies_ends_the_job_and_the_run_goes_on(tmp_path):
    made = {"t_end": 0.6, "frames": 7, "n": 150}
    asked = {
        "law": "olfati-saber (58)", "dimension": 2, "step": 0.005, "scenario": made, "order": 1, "every": 0.0,
        "options": {"ledger": 5},
    }  # fmt: skip
    folder, whole = tmp_path / "killed", tmp_path / "whole"
    dying = {**asked, "save": str(folder), "die_at": 0.35, "how": "signal"}
    assert launch(2, sys.executable, "-m", "tests.mpi.job", json.dumps(dying)).returncode != 0
    computed(**asked, save=whole)
    expected, gone_on = fk.read_run(whole), fk.resume(folder, progress=False)
    assert gone_on.finished
    np.testing.assert_allclose(gone_on.q, expected.q, rtol=0, atol=1e-9)
    np.testing.assert_allclose(gone_on.trace["dissipated"], expected.trace["dissipated"], rtol=1e-9)


def test_lammps_alone_runs_the_deck(tmp_path):
    made = first_order("olfati-saber (58)", 2, n=100, t_end=0.3, frames=4)
    deck = export_deck(made, tmp_path / "deck", step=0.005)
    assert "BROWNIAN" in deck.read_text()
    done = subprocess.run([LMP, "-in", deck.name], cwd=deck.parent, capture_output=True, text=True, timeout=200)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    q, rest = frames(deck.parent / "frames.lammpstrj", 100, 2)
    assert rest.shape[2] == 0
    run = fk.simulate(made, **PAIR_STYLES, step=0.005, ledger=0, progress=False)
    np.testing.assert_allclose(q, run.q, rtol=0, atol=1e-10)


def test_pairs_that_move_too_far_for_their_distance_are_told():
    law = fk.Law(fk.Proximity(1.0), [fk.Gradient(fk.Potential("1/r + r"))])
    begin = fk.State([[0.0, 0.0], [0.1, 0.0]])
    made = fk.Scenario(law, begin, 0.5, frames=2, agents=fk.SingleIntegrator())
    with pytest.raises(StepTooLarge, match="a pair at distance") as caught:
        fk.simulate(made, **PAIR_STYLES, step=0.1, progress=False)
    assert caught.value.agents == (0, 1)
    session = LammpsSession(made, LammpsOptions())
    assert session.step < 1e-3
    session.close()


def test_a_lammps_without_the_fix_is_told(monkeypatch):
    made = first_order("olfati-saber (34)", 2, n=20)
    assert any("brownian" in line for line in make_deck(made).law())
    monkeypatch.setattr(library, "FIRST_ORDER", "flying/carpet")
    with pytest.raises(EngineMissing, match="flying/carpet"):
        LammpsSession(made, LammpsOptions(step=0.01))
    LammpsSession(made.with_(agents=fk.PointMass()), LammpsOptions(step=0.01)).close()
