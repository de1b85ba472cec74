"""Trajectories from elsewhere: judged against the declared law as far as samples reach."""

from __future__ import annotations

import pytest

import flocking as fk
from flocking.papers.tanner_2003_dynamic import scenario
from flocking.study.claims.claim import Verdict
from flocking.study.trajectory import run_from_samples


@pytest.fixture(scope="module")
def sampled():
    declared = scenario(seed=2).with_(t_end=20.0, frames=4001, name="")
    return declared, fk.simulate(declared, progress=False)


def test_a_true_trajectory_closes_its_ledger(sampled):
    declared, run = sampled
    report = fk.audit(run_from_samples(declared, run.t, run.q, run.p))
    assert report["ledger"].verdict == Verdict.HOLDS
    assert report["momentum"].verdict == Verdict.HOLDS
    assert report["switching-stops"].verdict == Verdict.NOT_RESOLVED
    assert "do not show" in report["switching-stops"].note


@pytest.mark.parametrize("what", ["gain", "potential", "velocity"])
def test_a_false_trajectory_does_not(sampled, what):
    declared, run = sampled
    law = declared.law
    gradient, consensus = law.terms
    if what == "gain":
        law = fk.Law(law.graph, [gradient, fk.Consensus(consensus.gain * 1.3)])
    elif what == "potential":
        law = fk.Law(law.graph, [fk.Gradient(fk.Potential("1/r**2 + log(r**2) + (r - 2)**2/10")), consensus])
    q, p = run.q, run.p * (1.05 if what == "velocity" else 1.0)
    report = fk.audit(run_from_samples(declared.with_(law=law), run.t, q, p))
    assert report["ledger"].verdict == Verdict.FAILS
    assert report["velocities-agree"].verdict == Verdict.NOT_RESOLVED


def test_short_samples_are_refused(sampled):
    declared, run = sampled
    with pytest.raises(fk.InvalidInput, match="three"):
        run_from_samples(declared, run.t[:2], run.q[:2], run.p[:2])


def test_samples_refute_a_connected_graph_but_do_not_show_one(sampled):
    declared, run = sampled
    found = fk.audit(run_from_samples(declared, run.t, run.q, run.p))["connected"]
    exact = fk.audit(run)["connected"]
    assert exact.verdict in (Verdict.HOLDS, Verdict.FAILS)
    assert found.verdict == (Verdict.FAILS if exact.verdict == Verdict.FAILS else Verdict.NOT_RESOLVED)


def test_samples_of_periodic_space_close_their_ledger():
    """Links, forces and approaches of samples are those of the nearest images."""
    law = fk.Law(fk.Proximity(1.5), [fk.Gradient(fk.Potential("(r - 1)**2")), fk.Consensus(0.3)])
    start = fk.start.box(12, side=4.0, speed=0.6, seed=2)
    scenario = fk.Scenario(law, start, t_end=4.0, frames=2001, space=fk.Periodic([4.0, 4.0]))
    run = fk.simulate(scenario, progress=False)
    found = run_from_samples(scenario, run.t, run.q, run.p)
    assert (found.links == run.links).all()
    assert fk.audit(found)["ledger"].verdict == "holds"
    assert found.closest_linked.distance == pytest.approx(run.closest_linked.distance, rel=1e-3)
    assert found.closest_unlinked.distance == pytest.approx(run.closest_unlinked.distance, rel=1e-3)
