"""Runs whose law or state was replaced while they went on: no theorem is about them, nor do they show limits."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import flocking as fk
from flocking.papers import paper
from flocking.study.claims.audit import Report
from flocking.study.claims.claim import Basis, Verdict

NAME = "tanner-2003-fixed"
LIMITS = ("velocities-agree", "distances-settle", "forces-vanish", "potential-minimal")


@cache
def own() -> fk.Scenario:
    """The paper's scenario, for a short time."""
    return paper(NAME).scenarios()[NAME](0).with_(t_end=2.0, frames=41)


@cache
def audited(what: str, name: str) -> Report:
    """The report of a run to which something was done at half its time."""
    scenario = own().with_(name=name)
    session = fk.start(scenario)
    session.advance(1.0)
    state = session.state
    if what == "pushed":
        session.replace(state=fk.State(state.q, state.p + [5.0, 0.0], state.t, state.links))
    elif what == "pulled":
        session.replace(law=fk.Law(scenario.law.graph, [*scenario.law.terms, fk.Track([3.0, 0.0], velocity_gain=2.0)]))
        session.advance(1.5)
        session.replace(law=scenario.law)
    session.advance(2.0)
    return fk.audit(session.run("finished"))


@pytest.mark.parametrize("what", ["pushed", "pulled"])
def test_theorems_are_not_about_a_run_that_somebody_pushed_on_its_way(what: str) -> None:
    """Their momentum is that of closed groups, and their bounds of speeds are of the energy at the start."""
    untouched, changed = audited("nothing", NAME), audited(what, NAME)
    assert untouched["momentum"].verdict is Verdict.HOLDS
    assert untouched["speed-bound"].verdict is Verdict.HOLDS
    for result in changed.results:
        assert result.verdict is Verdict.HYPOTHESIS_NOT_MET, result
        assert "replaced at t = 1" in result.note
    assert changed.as_expected
    proved = {r.claim.key: r.conclusion for r in changed.results if r.claim.basis is Basis.PROOF}
    assert proved["momentum"] is not None
    assert proved["momentum"].verdict is Verdict.FAILS


@pytest.mark.parametrize("what", ["pushed", "pulled"])
def test_general_claims_about_what_lasts_leave_open_what_two_motions_cannot_show(what: str) -> None:
    untouched, changed = audited("nothing", ""), audited(what, "")
    assert untouched["momentum"].verdict is Verdict.HOLDS
    assert changed["momentum"].verdict is Verdict.NOT_APPLICABLE
    for key in LIMITS:
        assert "replaced" not in untouched[key].note
        assert changed[key].verdict is Verdict.NOT_RESOLVED
        assert "replaced at t = 1" in changed[key].note
    # What was seen all the way is as before.
    for key in ("ledger", "linked-apart"):
        assert changed[key].verdict is Verdict.HOLDS


def test_agents_that_were_pushed_apart_do_not_agree_because_they_differed_more_for_a_moment() -> None:
    """Nothing acts: velocities differ all the time, and for a moment by a thousand times as much."""
    law = fk.Law(fk.Complete(), [fk.Consensus(0.0)])
    p = np.array([[0.5, 0.0], [-0.5, 0.0]])
    start = fk.State([[0.0, 0.0], [0.0, 1.0]], p)
    session = fk.start(fk.Scenario(law, start, t_end=4.0, frames=101))
    session.advance(0.5)
    q = session.state.q
    session.replace(state=fk.State(q, 1e4 * p, 0.5))
    session.advance(0.6)
    session.replace(state=fk.State(session.state.q, p, 0.6))
    session.advance(4.0)
    found = fk.audit(session.run("finished"))
    assert found["velocities-agree"].verdict is Verdict.NOT_RESOLVED
    assert found["distances-settle"].verdict is Verdict.NOT_RESOLVED
