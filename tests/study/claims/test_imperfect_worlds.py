"""Verdicts on runs in which other forces act than those of the law on the present state."""

from dataclasses import replace

import numpy as np
import pytest

import flocking as fk
from flocking.papers import paper
from flocking.study.claims.general_claims import GENERAL
from flocking.study.margins.computed_runs import Conclusions

LAW = fk.Law(fk.Fixed.complete(4), [fk.Gradient(fk.Potential("(r - 1)**2/2")), fk.Consensus(0.5)])


def verdicts(name="", **world):
    start = fk.start.box(4, side=2, speed=1, seed=1)
    run = fk.simulate(fk.Scenario(LAW, start, t_end=3, frames=31, name=name, **world), progress=False)
    return {result.claim.key: result for result in fk.audit(run).results}


@pytest.mark.parametrize(
    ("world", "said"),
    [
        ({"control": fk.Held(0.1)}, "control held for 0.1"),
        ({"control": fk.Held(0.1), "information": fk.Messages(0.1, delay=0.05, loss=0.3)}, "control held for 0.1"),
        ({"information": fk.Messages(0.1, delay=0.05, loss=0.3)}, "messages every 0.1, 0.05 late"),
    ],
)
def test_the_law_is_neither_blamed_nor_praised_for_forces_that_are_not_its_own(world, said):
    """What departs from the law balances the ledger whatever acted, and may move the mean and raise the energy."""
    found = verdicts(**world)
    for key in ("ledger", "momentum", "energy-falls"):
        assert str(found[key].verdict) == "not applicable"
        assert said in found[key].note
    assert "not estimated in an imperfect world" in found["linked-apart"].note


def test_in_the_ideal_world_they_are_judged():
    found = verdicts()
    assert [str(found[key].verdict) for key in ("ledger", "momentum", "energy-falls")] == ["holds"] * 3


def test_theorems_of_papers_assume_the_ideal_world():
    stated = {claim.key for claim in paper("zhou-2015").claims("zhou-2015")}
    for world in ({"control": fk.Held(0.1)}, {"information": fk.Messages(0.1)}):
        found = verdicts("zhou-2015", **world)
        assert stated <= set(found)
        for key in stated:
            assert str(found[key].verdict) in ("hypothesis not met", "not applicable")


def test_errors_that_nobody_estimated_are_unknown_and_not_zero():
    """Where agents flock for certain, so that an error of zero would let the verdict be that velocities agree."""
    start = fk.start.box(4, side=2, speed=1, seed=1)
    run = fk.simulate(fk.Scenario(LAW, start, t_end=30, frames=61, control=fk.Held(0.1)), progress=False)
    # Too many steps to be repeated.
    run = replace(run, provenance={**run.provenance, "steps": 10**6})
    found = {result.claim.key: result for result in fk.audit(run).results}
    for key in ("velocities-agree", "distances-settle", "forces-vanish", "potential-minimal"):
        result = found[key]
        assert str(result.verdict) == "not resolved", key
        assert not result.error < np.inf
        assert result.as_dict()["error"] is None
        assert result.margin > 0
    assert "the error of the motion is not estimated" in found["velocities-agree"].note


@pytest.mark.parametrize(
    "world", [{"information": fk.Delayed(0.1)}, {"information": fk.Messages(0.1)}, {"control": fk.Held(0.1)}]
)
def test_errors_of_imperfect_motions_are_estimated_and_not_zero(world):
    """Agents that flock for certain, with delays far below the shortest time constant; repetitions show the error."""
    start = fk.start.box(4, side=2, speed=1, seed=1)
    run = fk.simulate(fk.Scenario(LAW, start, t_end=30, frames=61, **world), progress=False)
    keys = ("velocities-agree", "distances-settle")
    results = fk.audit(run, [claim for claim in GENERAL if claim.key in keys]).results
    assert len(results) == len(keys)
    for result in results:
        assert str(result.verdict) == "holds", result.note
        assert 0.0 < result.error < 1e-6
        assert "error estimated from 2 repetitions" in result.note


def test_margins_take_runs_as_computed():
    """A share over many computed runs says so; it is not left open for errors that nobody estimated."""
    start = fk.start.box(4, side=2, speed=1, seed=1)
    made = fk.Scenario(LAW, start, t_end=30, frames=61, control=fk.Held(0.1))
    run = fk.simulate(made, progress=False)
    claims = [claim for claim in GENERAL if claim.key == "velocities-agree"]
    assert str(Conclusions(tuple(claims))(run).results[0].verdict) == "holds"


@pytest.mark.parametrize("delay", [0.05, 1.0])
def test_a_motion_without_stated_errors_refutes_connection_and_does_not_show_it(delay):
    law = fk.Law(fk.Hysteresis(2.5, 0.5), [fk.Gradient(fk.Potential("(r - 1)**2/2")), fk.Consensus(1.0)])
    start = fk.start.box(6, side=1.5, speed=0.2, seed=3)
    late = fk.Delayed(delay, self_delayed=True)
    run = fk.simulate(fk.Scenario(law, start, t_end=6, frames=61, information=late), progress=False)
    found = fk.audit(run)["connected"]
    if delay == 1.0:
        assert str(found.verdict) == "fails"
        assert found.note.startswith("fell apart at t = ")
        assert "error estimated from 2 repetitions" in found.note
    else:
        assert str(found.verdict) == "not resolved"
        assert found.note.startswith("the motion as computed is connected after each of")
        assert "whether the exact one does is open: the errors of the run are unknown" in found.note


def test_no_error_is_stated_of_what_a_run_is_too_short_for():
    """Where engines state no errors of the motion none is estimated then either: zero would say that there is none."""
    law = fk.Law(fk.Fixed.complete(2), [fk.Consensus(0.1)])
    start = fk.State([[0.0, 0.0], [1.0, 0.0]], [[1.0, 0.0], [0.0, 1.0]])
    for world in ({"information": fk.Delayed(0.1, self_delayed=True)}, {"control": fk.Held(0.1)}):
        found = fk.audit(fk.simulate(fk.Scenario(law, start, 1.0, frames=201, **world), progress=False))
        agree = found["velocities-agree"]
        assert str(agree.verdict) == "not yet"
        assert np.isnan(agree.error)
    exact = fk.audit(fk.simulate(fk.Scenario(law, start, 1.0, frames=201), progress=False))["velocities-agree"]
    assert str(exact.verdict) == "not yet"
    assert 0.0 < exact.error < 1e-6
