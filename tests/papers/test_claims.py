"""The papers' scenarios have the papers' numbers, and three seeds of each give no unexpected verdict."""

from __future__ import annotations

import json

import numpy as np
import pytest

import flocking as fk
from flocking.papers import ALL_KEYS, paper
from flocking.study.claims.audit import audit
from flocking.study.claims.claim import Basis, Verdict
from flocking.study.claims.judgement import judge
from flocking.study.claims.settled_run import settled_runs
from flocking.study.claims.subjects import Subject

NAMES = [
    (key, name) for key in ("tanner-2003-fixed", "tanner-2003-dynamic", "zhou-2015") for name in paper(key).scenarios()
]
OPEN = {Verdict.HYPOTHESIS_NOT_MET, Verdict.NOT_YET, Verdict.NOT_APPLICABLE}


@pytest.mark.parametrize(("key", "name"), NAMES, ids=[name for _, name in NAMES])
def test_three_seeds_agree_with_what_holds(key: str, name: str) -> None:
    found = paper(key)
    claims = found.claims(name)
    reports = [list(settled_runs(found.scenarios()[name](seed), claims))[-1][1] for seed in range(3)]
    for judgement in judge(claims, reports):
        assert judgement.verdict == Verdict.UNTESTED, "three seeds must not settle a claim"
        if judgement.claim.basis is Basis.PROOF:
            verdicts = {r.verdict for r in judgement.results} - OPEN
            assert verdicts <= {judgement.claim.expected}, (judgement.claim.key, verdicts)


@pytest.mark.parametrize("key", ALL_KEYS)
def test_every_expected_verdict_of_a_paper_rests_on_something(key: str) -> None:
    found = paper(key)
    claims = [claim for name in found.scenarios() for claim in found.claims(name)]
    assert all(claim.basis is not Basis.GENERAL for claim in claims)
    assert any(claim.basis is Basis.PROOF for claim in claims)


REFUTED = [
    (key, name, claim.key)
    for key, name in NAMES
    for claim in paper(key).claims(name)
    if claim.basis is Basis.COUNTEREXAMPLE
]


@pytest.mark.parametrize(("key", "name", "claim"), REFUTED, ids=[f"{name} {claim}" for _, name, claim in REFUTED])
def test_a_counter_example_refutes_its_claim(key: str, name: str, claim: str) -> None:
    (refuted,) = (c for c in paper(key).claims(name) if c.key == claim)
    run = fk.simulate(refuted.counterexample(), progress=False)
    assert run.scenario.name == name
    assert audit(run, [refuted])[claim].verdict == Verdict.FAILS


@pytest.mark.parametrize(("key", "name"), NAMES, ids=[name for _, name in NAMES])
def test_claims_are_well_formed(key: str, name: str) -> None:
    claims = paper(key).claims(name)
    assert len({c.key for c in claims}) == len(claims)
    for claim in claims:
        assert claim.source
        assert claim.statement.endswith(".")
        if claim.expected != Verdict.HOLDS:
            assert claim.reason, f"{claim.key} is expected to fail without a reason"


@pytest.mark.parametrize(
    ("key", "name", "claim"),
    [
        ("tanner-2003-fixed", "tanner-2003-fixed", "energy"),
        ("tanner-2003-dynamic", "tanner-2003-dynamic", "energy"),
        ("zhou-2015", "zhou-2015", "energy"),
        ("zhou-2015", "zhou-2015-leader", "energy"),
    ],
)
def test_a_wrong_gain_is_caught(key: str, name: str, claim: str) -> None:
    found = paper(key)
    scenario = found.scenarios()[name](0)
    wrong = tuple(fk.Consensus(1.02) if isinstance(t, fk.Consensus) else t for t in scenario.law.terms)
    run = fk.simulate(scenario, progress=False, plant=fk.Law(scenario.law.graph, wrong))
    report = audit(run, found.claims(name))
    assert report[claim].verdict == Verdict.FAILS
    assert report["velocities-agree"].verdict == Verdict.NOT_RESOLVED


def test_tanner_scenarios_have_the_papers_numbers() -> None:
    for seed in range(5):
        fixed, moving = paper("tanner-2003-fixed").scenario(seed=seed), paper("tanner-2003-dynamic").scenario(seed=seed)
        for scenario in (fixed, moving):
            assert scenario.start.n == 10
            assert scenario.start.dimension == 2
            assert np.linalg.norm(scenario.start.q, axis=1).max() < 2.5
            assert np.linalg.norm(scenario.start.p, axis=1).max() < 1.0
            assert scenario.t_end == 100.0
        assert moving.law.graph == fk.Proximity(2.0)
        assert not fixed.law.graph.moves
        assert set(paper("tanner-2003-fixed").system.PRINTED_TIMES) <= set(fixed.frame_times)
    assert paper("tanner-2003-fixed").system.PRINTED_TIMES == (2.22842, 5.21464, 22.8931, 55.0766)


def test_zhou_scenarios_have_the_papers_numbers() -> None:
    zhou = paper("zhou-2015")
    for seed in range(5):
        plain, led = zhou.scenario(figure=2, seed=seed), zhou.scenario(figure=9, seed=seed)
        assert plain.start.n == led.start.n == 10
        assert (plain.start.q == led.start.q).all()
        assert plain.start.q.min() >= 0
        assert plain.start.q.max() <= 8
        assert plain.start.p.min() >= 0
        assert plain.start.p.max() <= 4
        assert plain.law.graph == fk.Hysteresis(4.0, 0.1)
        assert not plain.law.leaders
        (leader,) = led.law.leaders
        place, velocity, _ = leader.at(0.0)
        assert place.tolist() == [10, 10]
        assert velocity.tolist() == [3, 3]
        assert led.energy.leader is leader


@pytest.mark.parametrize("number", [0, 99, -1])
def test_a_scenario_refuses_a_figure_that_is_not_there(number: int) -> None:
    for key in ("tanner-2003-fixed", "tanner-2003-dynamic", "zhou-2015"):
        with pytest.raises(fk.InvalidInput, match="figure"):
            paper(key).scenario(figure=number)


def test_a_figure_refuses_the_run_of_another_scenario() -> None:
    zhou = paper("zhou-2015")
    run = fk.simulate(zhou.scenario(seed=0, duration=0.1), progress=False)
    with pytest.raises(fk.InvalidInput, match="zhou-2015-leader"):
        zhou.figure(9, run)
    with pytest.raises(fk.InvalidInput, match="must be one of"):
        zhou.figure(99, run)


@pytest.mark.parametrize("key", ["tanner-2003-fixed", "tanner-2003-dynamic", "zhou-2015"])
def test_every_erratum_is_refuted_by_its_example(key: str) -> None:
    for erratum in paper(key).errata():
        assert erratum.reading, erratum.statement
        if erratum.demonstration is not None:
            assert erratum.demonstration().refutes, erratum.statement


def test_a_decay_is_not_resolved_where_the_run_states_no_error() -> None:
    cucker = paper("cucker-smale-2007")
    scenario = cucker.scenario(name="cucker-smale-2007-sharp").with_(t_end=4.0, frames=41)
    claims = [c for c in cucker.claims(scenario.name) if c.key == "exponential"]
    exact, tiled = (
        fk.simulate(scenario, progress=False),
        fk.simulate(scenario, engine="tiles", step=0.01, progress=False),
    )
    assert audit(exact, claims)["exponential"].verdict == Verdict.HOLDS
    assert tiled.accuracy is None
    assert audit(tiled, claims)["exponential"].verdict == Verdict.NOT_RESOLVED


ZHOU = paper("zhou-2015").scenario().with_(t_end=1.0, frames=11)
WORLDS = {
    "messages": (
        {"information": fk.Messages(0.05, loss=0.3), "control": fk.Held(0.05)},
        "the theorem assumes an ideal world: messages every 0.05, 0.3 of them lost; control held for 0.05",
    ),
    "space": ({"space": fk.Periodic([60.0, 60.0])}, "space is Periodic, not open"),
    "bodies": ({"agents": fk.Lagged(fk.PointMass(), 0.02)}, "the theorem assumes an ideal world: "),
}


@pytest.mark.parametrize("name", WORLDS)
def test_the_conclusion_is_measured_beside_a_hypothesis_that_is_not_met(name: str) -> None:
    changes, reason = WORLDS[name]
    run = fk.simulate(ZHOU.with_(**changes), progress=False)
    report = fk.audit(run)
    for found in report.results:
        assert found.verdict is Verdict.HYPOTHESIS_NOT_MET
        assert found.note.startswith(reason)
        assert (found.conclusion is None) == (found.claim.about.subject is Subject.LEDGER)
    mean = run.p.sum(axis=1) / run.n
    moved = np.abs(mean - mean[0]).max()
    alone = report["momentum"].conclusion
    assert alone is not None
    said = float(alone.note.split("mean velocity moved by ")[1].split(";")[0])
    assert said == pytest.approx(moved, rel=0.06, abs=1e-13)
    assert (moved > 1e-3) == (name == "messages")
    assert alone.verdict is (Verdict.FAILS if moved > 1e-3 else Verdict.HOLDS)
    assert f"{reason}" in str(report)
    assert f"the conclusion by itself: {alone.verdict} ({alone.note})" in str(report)
    rows = {row["claim"]: row for row in json.loads(json.dumps(report.as_dict()))["claims"]}
    assert rows["momentum"]["conclusion"]["verdict"] == str(alone.verdict)
    assert rows["momentum"]["conclusion"]["margin"] == pytest.approx(alone.margin)
    assert "conclusion" not in rows["energy"]


def test_in_the_world_of_the_theorems_nothing_stands_beside() -> None:
    report = fk.audit(fk.simulate(ZHOU, progress=False))
    assert report["momentum"].verdict is Verdict.HOLDS
    assert all(found.conclusion is None for found in report.results)
    assert "by itself" not in str(report)
