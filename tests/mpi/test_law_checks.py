"""LAMMPS's forces held against the declared law, and starts it cannot have."""

import numpy as np
import pytest

import flocking as fk
from flocking.engine.driver.checkpoint import pack
from flocking.errors import LawNotObeyed, StepTooLarge, UnsupportedLaw
from flocking.study.claims.claim import Verdict
from tests.engine.storage.stored_runs import unpack
from tests.mpi.job import scenario
from tests.mpi.laws import PAIR_STYLES

pytestmark = pytest.mark.mpi


@pytest.mark.parametrize(("name", "dimension"), [("olfati-saber (36)", 2), ("shi (4)", 3), ("two graphs", 2)])
def test_forces_are_those_of_the_law(name, dimension):
    run = fk.simulate(scenario(name, dimension, t_end=0.5, frames=2), **PAIR_STYLES, progress=False)
    assert run.provenance["law_checks"] > 3
    assert run.provenance["law_gap"] < 0.1 * run.provenance["law_gap_allowed"]
    assert fk.audit(run)["ledger"].verdict == Verdict.HOLDS


def test_a_plant_with_a_gain_one_per_cent_off_fails_the_ledger():
    made = scenario("olfati-saber (34)", 2, t_end=0.5, frames=2)
    gradient, consensus = made.law.terms
    stronger = fk.Gradient(gradient.potential.with_parameters(a=1.01, b=5.05))
    for terms in ([stronger, consensus], [gradient, fk.Consensus(1.01)]):
        run = fk.simulate(made, **PAIR_STYLES, plant=fk.Law(made.law.graph, terms), progress=False)
        found = fk.audit(run)["ledger"]
        assert found.verdict == Verdict.FAILS
        assert "differs from the declared law" in found.note


def test_what_a_run_states_of_its_forces_and_its_rounding_outlives_a_stop(tmp_path):
    session = fk.start(scenario("olfati-saber (34)", 2, t_end=0.5, frames=2), **PAIR_STYLES)
    session.advance(0.25)
    session.records.energy_rounding = 0.25
    again = unpack(pack(session), session.run("unfinished"), None, tmp_path, name="lammps")
    assert session.fidelity.law.checks > 1
    assert again.fidelity == session.fidelity
    for each in (session, again):
        each.close()


def test_a_wrong_translation_stops_the_run(monkeypatch):
    from flocking.engine.lammps import pairs

    original = pairs.lepton
    monkeypatch.setattr(pairs, "lepton", lambda e: original(1.01 * e))
    with pytest.raises(LawNotObeyed, match="translation"):
        fk.simulate(scenario("olfati-saber (34)", 2, t_end=0.5, frames=2), **PAIR_STYLES, progress=False)


def test_agents_at_one_point_are_refused_by_name():
    law = fk.Law(fk.Smooth(1.0, 0.2), [fk.Consensus(1.0)])
    start = fk.State([[0.0, 0.0], [0.5, 0.5], [0.5, 0.5]], np.zeros((3, 2)))
    with pytest.raises(UnsupportedLaw, match=r"agents 1 and 2 at the same point \(t = 0\)"):
        fk.simulate(fk.Scenario(law, start, 1.0), **PAIR_STYLES, progress=False)


def test_a_pair_that_would_pass_through_a_whole_radius_in_one_step_is_told():
    law = fk.Law(fk.Proximity(1.0), [fk.Gradient(fk.Potential("1/r + r")), fk.Consensus(1e-6)])
    start = fk.State([[0.0, 0.0], [3.0, 0.5]], [[30.0, 0.0], [-30.0, 0.0]])
    with pytest.raises(StepTooLarge, match="a pair at distance") as caught:
        fk.simulate(fk.Scenario(law, start, 0.5, frames=2), **PAIR_STYLES, step=0.1, progress=False)
    assert caught.value.agents == (0, 1)
