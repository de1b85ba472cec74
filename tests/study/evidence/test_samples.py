"""Samples decide what they show: a record that was never made is not a record of nothing."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import flocking as fk
from flocking.papers import zhou_2015
from flocking.study.claims.claim import Claim, Measure, Verdict, happens
from flocking.study.claims.conclusions.links import stays_connected
from flocking.study.evidence import Evidence
from flocking.study.trajectory import run_from_samples

FREE = fk.Consensus(1e-9)


@pytest.fixture(scope="module")
def zhou() -> tuple[fk.Run, dict[str, Verdict], fk.Run]:
    """A good run, its verdicts, and its samples as a run."""
    scenario = zhou_2015.scenario(seed=0).with_(t_end=20.0, frames=801)
    run = fk.simulate(scenario, progress=False)
    claims = zhou_2015.claims()
    return run, {r.claim.key: r.verdict for r in fk.audit(run, claims).results}, sampled(run)


def sampled(run: fk.Run, every: int = 1) -> fk.Run:
    return run_from_samples(run.scenario, run.t[::every], run.q[::every], run.p[::every])


def test_samples_of_a_good_run_accuse_no_one_and_show_nothing_between(zhou) -> None:
    _, exact, seen = zhou
    found = {r.claim.key: r for r in fk.audit(seen, zhou_2015.claims()).results}
    for key in (
        "energy-per-link",
        "new-links",
        "connected",
        "links-kept",
        "switching-stops",
        "all-apart",
        "linked-apart",
        "unlinked-apart",
        "energy-falls",
        "energy-bound",
        "speed-bound",
        "distance-bound",
    ):
        assert exact[key] in (Verdict.HOLDS, Verdict.NOT_YET), key
        assert found[key].verdict == Verdict.NOT_RESOLVED, (key, found[key])
    assert found["energy"].verdict == found["momentum"].verdict == Verdict.HOLDS
    assert "samples do not show the switches" in found["energy-per-link"].note


@pytest.mark.parametrize("every", [2, 5, 20, 100, 250])
def test_no_verdict_on_samples_contradicts_that_on_the_run(zhou, every: int) -> None:
    run, exact, _ = zhou
    for r in fk.audit(sampled(run, every), zhou_2015.claims()).results:
        assert {str(r.verdict), str(exact[r.claim.key])} != {"holds", "fails"}, r


def drifting(q, p, graph, t_end=4.0, frames=41):
    scenario = fk.Scenario(fk.Law(graph, [FREE]), fk.State(q, p), t_end=t_end, frames=frames)
    run = fk.simulate(scenario, progress=False)
    return run, sampled(run)


def test_samples_refute_what_they_see() -> None:
    run, seen = drifting([[0.0, 0.0], [1.0, 0.0]], [[0.0, 0.0], [1.0, 0.0]], fk.Proximity(2.0))
    for r in (fk.audit(run), fk.audit(seen)):
        assert r["links-kept"].verdict == r["connected"].verdict == Verdict.FAILS
    assert "at least 1 lost" in fk.audit(seen)["links-kept"].note


def test_a_link_between_two_samples_is_not_read_as_none() -> None:
    """Two agents pass each other between the samples: a link comes and goes."""
    q, p = [[0.0, 0.5], [4.0, 0.0]], [[1.0, 0.0], [-1.0, 0.0]]
    run, seen = drifting(q, p, fk.Proximity(1.0), frames=[0.0, 1.0, 3.0, 4.0])
    assert fk.audit(run)["links-kept"].verdict == Verdict.FAILS
    assert Evidence(run).links_created == 1
    assert not seen.links.any()
    assert fk.audit(seen)["links-kept"].verdict == fk.audit(seen)["switching-stops"].verdict == Verdict.NOT_RESOLVED


def test_the_memory_of_a_link_is_unsure_between_the_two_radii() -> None:
    graph = fk.Hysteresis(2.0, 0.5)
    # Both pairs are 1.7 apart at 0.4 and 1.6; the first came nearer than 1.5 between.
    q = [[0.0, 0.0], [2.1, 0.0], [0.0, 50.0], [1.7, 50.0]]
    p = [[0.0, 0.0], [-1.0, 0.0], [0.0, 0.0], [0.0, 0.0]]
    scenario = fk.Scenario(fk.Law(graph, [FREE]), fk.State(q, p), t_end=4.0)
    t = np.array([0.0, 0.4, 3.7, 3.8])
    path = np.array(q) + t[:, None, None] * np.array(p)
    path[2:, 1, 0] = [1.6, 1.7]  # it turned round unseen
    run = run_from_samples(scenario, t, path, np.broadcast_to(np.array(p), path.shape).copy())
    evidence = Evidence(run)
    assert not run.links[2, 0, 1]
    assert evidence.uncertain_links[2, 0, 1]
    assert evidence.uncertain_links[3, 1, 0]
    assert not evidence.uncertain_links[:, 2, 3].any()
    assert not evidence.uncertain_links[:2].any()


def test_far_apart_samples_leave_the_ledger_open(zhou) -> None:
    run, _, _ = zhou
    coarse = fk.audit(sampled(run, 200))
    assert "too far apart" in coarse["energy"].note
    assert {r.verdict for r in coarse.results} == {Verdict.NOT_RESOLVED}


def test_a_new_claim_cannot_read_absence_as_knowledge(zhou) -> None:
    """Whatever a claim asks for that samples do not tell, it is not resolved without a word about samples in it."""
    run, _, seen = zhou
    asked = {
        "created": lambda e: Measure(0.5 - e.links_created),
        "lost": lambda e: Measure(0.5 - e.links_lost),
        "last": lambda e: Measure(e.last_switch),
        "history": lambda e: Measure(float(len(e.link_history))),
        "switches": lambda e: Measure(float(len(e.link_switches))),
        "connected": lambda e: Measure(e.first_disconnected),
        "energy": lambda e: Measure(1e9 - float(e.trace["energy"].max())),
    }
    claims = [Claim(key, "new", "New.", conclusion) for key, conclusion in asked.items()]
    for r in fk.audit(seen, claims).results:
        assert r.verdict == Verdict.NOT_RESOLVED, r.claim.key
    for r in fk.audit(run, claims).results:
        assert r.verdict in (Verdict.HOLDS, Verdict.FAILS), r.claim.key


def test_a_diverging_trajectory_is_audited() -> None:
    scenario = zhou_2015.scenario(seed=0)
    t = np.linspace(0.0, 40.0, 41)
    q = scenario.start.q * np.exp(2 * t)[:, None, None]
    p = 2 * q
    for claims in (None, zhou_2015.claims()):
        report = fk.audit(run_from_samples(scenario, t, q, p), claims)
        assert not [r for r in report.results if r.verdict == Verdict.HOLDS]
        assert not [r for r in report.results if r.note.startswith("could not be computed")]


def test_two_agents_at_one_point_are_not_apart() -> None:
    law = fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0)])
    start = fk.State([[0.0, 0.0], [0.0, 0.0], [1.0, 0.0]], [[0.0, 0.0], [0.0, 0.0], [0.1, 0.0]])
    for engine in ("exact", "tiles"):
        options = {"step": 0.01} if engine == "tiles" else {}
        report = fk.audit(fk.simulate(fk.Scenario(law, start, t_end=1.0), engine=engine, progress=False, **options))
        for key in ("all-apart", "linked-apart"):
            assert report[key].verdict == Verdict.FAILS, (engine, key)
            assert "agents 0 and 1" in report[key].note


def test_agents_that_come_together_are_not_said_to_have_met() -> None:
    """Frames of a computed motion carry its error: equal floats there are no collision."""
    law = fk.Law(fk.Proximity(2.0), [fk.Gradient(fk.Potential("r**2")), fk.Consensus(2.0)])
    run = fk.simulate(fk.Scenario(law, fk.State([[0.0, 0.0], [1.0, 0.0]]), t_end=60.0), progress=False)
    together = dataclasses.replace(run, q=np.where(run.t[:, None, None] > 50.0, 0.5, run.q))
    assert fk.audit(together)["all-apart"].verdict == Verdict.NOT_RESOLVED


def test_a_run_that_ended_early_holds_nothing_for_good(zhou) -> None:
    run, exact, _ = zhou
    cut = dataclasses.replace(run, status="interrupted at t = 20")
    for r in fk.audit(cut, zhou_2015.claims()).results:
        if exact[r.claim.key] == Verdict.HOLDS and r.claim.dynamic:
            assert r.verdict == Verdict.NOT_YET, r.claim.key


def test_the_contrary_of_a_statement_is_decided_by_samples_where_the_statement_is() -> None:
    """One time refutes what holds at all times, and shows its contrary; no sample shows that something never is so."""
    _, seen = drifting([[0.0, 0.0], [1.0, 0.0]], [[0.0, 0.0], [1.0, 0.0]], fk.Proximity(2.0))
    asked = {
        "apart": lambda e: stays_connected(e).opposite,
        "seen": lambda e: happens(Measure(1.0)).opposite,
        "unseen": lambda e: happens(Measure(-1.0)).opposite,
    }
    found = fk.audit(seen, [Claim(key, "new", "New.", conclusion) for key, conclusion in asked.items()])
    assert [str(r.verdict) for r in found.results] == ["holds", "fails", "not resolved"]


def test_samples_do_not_show_a_hypothesis_about_all_times() -> None:
    _, seen = drifting([[0.0, 0.0], [1.0, 0.0]], [[0.0, 0.0], [0.0, 0.0]], fk.Proximity(2.0))
    claim = Claim("asked", "new", "New.", lambda e: Measure(1.0, everywhere=False), hypothesis=lambda e: Measure(1.0))
    (found,) = fk.audit(seen, [claim]).results
    assert found.verdict is Verdict.NOT_RESOLVED
    assert "nothing is known between" in found.note
    once = dataclasses.replace(claim, hypothesis=lambda e: Measure(1.0, everywhere=False))
    assert fk.audit(seen, [once])["asked"].verdict is Verdict.HOLDS
