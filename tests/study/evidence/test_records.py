"""Runs whose frames and records contradict each other show nothing that rests on both."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flocking as fk
from flocking.study.claims.claim import Verdict
from flocking.study.evidence import Evidence

LAW = fk.Law(fk.Proximity(2.0), [fk.Gradient(fk.Potential("(r - 1)**2/4")), fk.Consensus(0.2)])

WORLDS = {
    "ideal": {},
    "held": {"control": fk.Held(0.1)},
    "periodic": {"space": fk.Periodic([5.0, 5.0])},
}


@pytest.fixture(scope="module", params=WORLDS)
def run(request: pytest.FixtureRequest) -> fk.Run:
    """Five agents some of which lose their links."""
    start = fk.start.box(5, side=2.5, speed=1.5, seed=3)
    return fk.simulate(fk.Scenario(LAW, start, t_end=5.0, frames=51, **WORLDS[request.param]), progress=False)


def without(run: fk.Run, row: int) -> fk.Run:
    return replace(run, switches=np.delete(run.switches, row))


def test_runs_as_they_were_computed_contradict_nothing(run: fk.Run) -> None:
    assert len(run.switches) > 0
    assert Evidence(run).foreign_approach == Evidence(run).foreign_switches == ""


def test_a_switch_that_was_taken_out_moved_or_given_to_others_is_noticed(run: fk.Run) -> None:
    """Unless no frame lies in the time that it changes."""
    times = run.switches["time"]
    for row in range(len(times)):
        assert "to which the recorded switches do not lead" in Evidence(without(run, row)).foreign_switches
        other = run.switches.copy()
        other["i"][row], other["j"][row] = 0, 1
        if (run.switches["i"][row], run.switches["j"][row]) != (0, 1):
            assert Evidence(replace(run, switches=other)).foreign_switches
        late = run.switches.copy()
        late["time"][row] += 0.25
        late = late[np.argsort(late["time"], kind="stable")]
        assert Evidence(replace(run, switches=late)).foreign_switches


def test_agents_closer_at_a_frame_than_they_ever_were_are_noticed(run: fk.Run) -> None:
    q = run.q.copy()
    q[25, 0] = q[25, 1]
    assert "the closest approach of all" in Evidence(replace(run, q=q)).foreign_approach
    if not run.scenario.space.is_open:
        q[25, 0, 0] += run.scenario.space.lengths[0]
        assert "the closest approach of all" in Evidence(replace(run, q=q)).foreign_approach


def test_a_conclusion_that_would_hold_of_a_changed_run_is_open() -> None:
    start = fk.start.box(5, side=2.5, speed=1.5, seed=3)
    run = fk.simulate(fk.Scenario(LAW, start, t_end=5.0, frames=51), progress=False)
    assert fk.audit(run)["links-kept"].verdict is Verdict.FAILS
    kept = fk.audit(replace(run, switches=run.switches[:0]))["links-kept"]
    assert kept.verdict is Verdict.NOT_RESOLVED
    assert "to which the recorded switches do not lead" in kept.note
    q = run.q.copy()
    q[25, 0] = q[25, 1]
    assert fk.audit(run)["all-apart"].verdict is Verdict.HOLDS
    assert fk.audit(replace(run, q=q))["all-apart"].verdict is Verdict.NOT_RESOLVED


def test_links_of_a_law_that_was_replaced_are_open_and_nothing_else() -> None:
    """Its radius appears at once, without switches, so that the recorded ones do not say which links there were."""
    start = fk.start.box(5, side=2.5, speed=1.5, seed=3)
    session = fk.start(fk.Scenario(LAW, start, t_end=2.0, frames=21))
    session.advance(1.0)
    session.replace(law=fk.Law(fk.Proximity(3.0), LAW.terms))
    session.advance(2.0)
    e = Evidence(session.run())
    assert e.foreign_approach == ""
    assert "to which the recorded switches do not lead" in e.foreign_switches
