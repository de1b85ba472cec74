"""Certificates beside claims, in the lab's verdicts and as lines beside margins."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flocking as fk
from flocking.apps.lab.panels.measures import ShownVerdict, guarantees_of, verdicts_on
from flocking.study.certificates.beside.guaranteed_claims import PROVEN_BY, guarantee_of
from flocking.study.certificates.beside.margin_lines import margin_lines
from flocking.study.claims.general_claims import GENERAL

PULL = fk.Gradient(fk.Potential("1/r + r**2"))
START = fk.State([[0.0, 0], [1, 0], [0, 1]], [[0.0, 0], [0, 0], [0, 0.5]])


def proven(scenario: fk.Scenario) -> dict[str, str]:
    found = fk.certify(scenario)
    pairs = {claim.key: guarantee_of(claim, found, scenario) for claim in GENERAL}
    return {key: c.key for key, c in pairs.items() if c is not None}


def test_claims_that_a_certificate_proves():
    complete = fk.Scenario(fk.Law(fk.Proximity(9.0), [PULL, fk.Consensus(1.0)]), START, t_end=1.0)
    assert proven(complete) == {"linked-apart": "closest_approach", "all-apart": "closest_approach"}
    fixed = complete.with_(law=fk.Law(fk.Fixed(3, ((0, 1), (1, 2))), [PULL, fk.Consensus(1.0)]))
    # Agents without a link may meet.
    assert proven(fixed) == {
        "linked-apart": "closest_approach",
        "links-kept": "links_kept",
        "connected": "group_diameter",
    }
    aligned = complete.with_(law=fk.Law(fk.Complete(), [fk.CuckerSmale(1.0, 0.3)]))
    assert {"velocities-agree", "distances-settle"} <= set(proven(aligned))
    only = complete.with_(law=fk.Law(fk.Fixed.complete(3), [fk.Consensus(1.0)]))
    assert "velocities-agree" in proven(only)
    assert proven(only.with_(control=fk.Held(0.1))).get("velocities-agree") is None
    filtered = complete.with_(control=fk.SafetyFilter(0.1, distance=0.2, acceleration=5.0, form="stopping"))
    assert proven(filtered)["safe-distance"] == "safe_distance"
    assert {claim.conclusion for claim in GENERAL} >= set(PROVEN_BY)


def test_verdicts_of_a_running_motion_say_what_is_guaranteed():
    scenario = fk.Scenario(fk.Law(fk.Proximity(9.0), [PULL, fk.Consensus(1.0)]), START, t_end=2.0, frames=21)
    run = fk.simulate(scenario, progress=False)
    shown = {v.claim.key: v for v in verdicts_on(run, GENERAL, guarantees_of(run))}
    assert shown["all-apart"].lamp == "guaranteed"
    assert shown["all-apart"].guarantee.key == "closest_approach"
    free = {v.claim.key: v for v in verdicts_on(run, GENERAL)}
    assert free["all-apart"].lamp == "holds"
    claim = shown["all-apart"].claim
    assert ShownVerdict(claim, "holds", "", running=True).lamp == "not guaranteed, holds so far"
    assert ShownVerdict(claim, "fails", "", running=True).lamp == "fails"
    assert ShownVerdict(claim, "fails", "", None, shown["all-apart"].guarantee, running=True).lamp == "fails"
    # The forces that are held between two ticks are no part of a state.
    held = scenario.with_(control=fk.SafetyFilter(0.3, distance=0.2, acceleration=5.0, form="stopping"))
    behind = fk.simulate(held, progress=False)
    assert guarantees_of(behind)["safe_distance"].granted
    assert (
        guarantees_of(replace(behind, **{name: getattr(behind, name)[4:] for name in ("t", "q", "p", "links")})) is None
    )
    assert (
        guarantees_of(replace(run, **{name: getattr(run, name)[4:] for name in ("t", "q", "p", "links")})) is not None
    )
    many = fk.start.box(100, side=30.0, speed=1.0, seed=0)
    large = fk.Scenario(fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0)]), many, t_end=0.01, frames=2)
    assert guarantees_of(fk.simulate(large, progress=False)) is None


def test_lines_of_periods_and_limits():
    law = fk.Law(fk.Fixed.complete(4), [fk.Gradient(fk.Potential("r**2/2"))])
    start = fk.State(np.random.default_rng(0).normal(size=(4, 2)))
    scenario = fk.Scenario(law, start, t_end=1.0, bodies=fk.SingleIntegrator())
    lines = {line.key: line for line in margin_lines(scenario, "period")}
    assert lines["control_period"].value == pytest.approx(0.5)
    assert lines["period_of_any_graph"].value == pytest.approx(0.5)
    late = scenario.with_(control=fk.Held(0.1), information=fk.Messages(0.1, delay=0.1))
    (line,) = margin_lines(late, "period")
    # With the own state known now the mean m(k + 1) = (1 - 3 T) m(k) + 3 T m(k - 1) swings for T > 1/3.
    assert (line.key, line.value) == ("period_in_world", pytest.approx(1 / 3, rel=1e-6))
    assert margin_lines(late, "loss") == ()
    (limit,) = margin_lines(fk.Scenario(fk.Law(fk.Proximity(9.0), [PULL]), START, t_end=1.0), "limit")
    assert limit.beyond
    assert (
        limit.value
        == fk.certify(fk.Scenario(fk.Law(fk.Proximity(9.0), [PULL]), START, t_end=1.0))["largest_force"].bound.hi
    )
    with pytest.raises(fk.InvalidInput, match="must be a Scenario"):
        margin_lines(law, "period")
