"""Audits of groups too large for link matrices: what cannot be measured is not applicable, never a crash."""

from __future__ import annotations

import dataclasses

import numpy as np

import flocking as fk
from flocking.study.claims.claim import Verdict


def test_claims_about_links_are_not_applicable_without_link_matrices():
    law = fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0)])
    run = fk.simulate(fk.Scenario(law, fk.start.box(12, side=4.0, speed=1.0, seed=1), t_end=1.0, frames=5))
    with_links = {r.claim.key: r.verdict for r in fk.audit(run).results}
    bare = dataclasses.replace(run, links=np.zeros((len(run.t), 0, 0), dtype=bool))
    without = {r.claim.key: r for r in fk.audit(bare).results}
    assert with_links["links-kept"] != Verdict.NOT_APPLICABLE
    assert without["connected"].verdict == Verdict.NOT_APPLICABLE
    assert "no link matrices" in without["connected"].note
    assert without["ledger"].verdict == with_links["ledger"] == Verdict.HOLDS


def tiled(n: int, **options: object) -> fk.engine.runs.run.Run:
    """A short run of the tiled engine; the flock of the second kind falls apart."""
    law = fk.Law(fk.Proximity(1.2), [fk.Gradient(fk.Potential("(r - 1)**2")), fk.Consensus(1.0)])
    start = fk.start.hexagonal(n, spacing=0.9, noise=0.02, speed=0.2, seed=1)
    scenario = fk.Scenario(law, start, t_end=1.0, frames=5)
    return fk.simulate(scenario, engine="tiles", step=0.01, observe=True, progress=False, **options)  # type: ignore[arg-type]


def verdicts(run: fk.engine.runs.run.Run) -> dict[str, str]:
    return {r.claim.key: str(r.verdict) for r in fk.audit(run).results}


def test_a_large_run_is_judged_by_its_frames_and_the_rest_is_left_to_the_exact_engine():
    run = tiled(4100)
    assert run.links.size == 0
    found = {r.claim.key: r for r in fk.audit(run).results}
    for key in ("ledger", "momentum", "energy-falls", "linked-apart", "all-apart"):
        assert found[key].verdict == Verdict.HOLDS, key
    assert found["connected"].verdict == Verdict.NOT_RESOLVED
    for key in ("connected", "links-kept", "switching-stops", "crossings-transversal"):
        assert "engine='exact'" in found[key].note, key


def test_a_run_without_frames_is_judged_by_what_was_observed():
    whole, bare = tiled(4100), tiled(4100, keep_frames=False)
    assert len(bare.t) == 0
    seen, expected = verdicts(bare), verdicts(whole)
    for key in ("ledger", "energy-falls", "velocities-agree", "connected"):
        assert seen[key] == expected[key], key
    # Repetitions are compared at frames: without any the error of the motion is not known.
    for key in ("linked-apart", "all-apart"):
        assert (seen[key], expected[key]) == (Verdict.NOT_RESOLVED, Verdict.HOLDS), key
    assert {seen[key] for key in ("momentum", "distances-settle", "forces-vanish")} == {Verdict.NOT_APPLICABLE}


def test_flocks_that_were_observed_apart_are_named_and_refute_nothing_where_errors_are_not_known():
    run = tiled(4100, keep_frames=False)
    apart = run.observables.copy()
    apart["flocks"][3] = 2
    found = {r.claim.key: r for r in fk.audit(dataclasses.replace(run, observables=apart)).results}["connected"]
    assert found.verdict == Verdict.NOT_RESOLVED
    assert f"the motion as computed falls apart at t = {apart['time'][3]:.3g}" in found.note
    apart["flocks"][0] = 2
    assert verdicts(dataclasses.replace(run, observables=apart))["connected"] == Verdict.HYPOTHESIS_NOT_MET


def test_the_ledger_of_a_fixed_step_is_held_to_a_share_of_the_energy_moved():
    run = tiled(4100)
    trace = run.trace.copy()
    trace["energy"][60:] += 0.2 * run.turnover
    assert verdicts(dataclasses.replace(run, trace=trace))["ledger"] == Verdict.FAILS
    assert verdicts(dataclasses.replace(run, trace=trace))["velocities-agree"] == Verdict.NOT_RESOLVED


def test_a_law_that_feeds_the_motion_raises_its_energy_under_a_fixed_step_too():
    """What is 'dissipated' turns negative for one step: the books still balance, the energy rises."""
    run = tiled(4100)
    trace = run.trace.copy()
    gain = 3 * float(np.abs(np.diff(run.residual)).max()) + 3 * float(np.abs(np.diff(trace["energy"])).max())
    trace["energy"][60:] += gain
    trace["dissipated"][60:] -= gain
    changed = dataclasses.replace(run, trace=trace)
    assert np.abs(changed.residual - run.residual).max() < 1e-9 * gain
    assert verdicts(run)["energy-falls"] == Verdict.HOLDS
    assert verdicts(changed)["energy-falls"] == Verdict.FAILS


def test_a_run_without_a_ledger_has_nothing_that_vouches_for_its_motion():
    run = tiled(4100, ledger=False)
    assert len(run.trace) == 0
    found = {r.claim.key: r for r in fk.audit(run).results}
    assert {r.verdict for r in found.values()} == {Verdict.NOT_APPLICABLE}
    assert "no ledger" in found["velocities-agree"].note
