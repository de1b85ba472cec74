"""Verdicts on a run whose scenario goes on: one that was interrupted, and one that is running."""

from dataclasses import replace

import pytest

import flocking as fk
from flocking.study.claims.claim import Claim, Measure, below
from flocking.study.claims.subjects import Subject, about
from flocking.study.evidence import Evidence

START = fk.State([[0.0, 0.0], [1.0, 0.0]], [[1.0, 0.0], [0.0, 0.0]])
SCENARIO = fk.Scenario(fk.Law(fk.Complete(), [fk.Consensus(1.0)]), START, 1.0, frames=9)


def claim(bound: float, *, lasting: bool = False, at_end: bool = False) -> Claim:
    """That the difference of two velocities is below a bound: e^{-2t} at t."""

    @about(Subject.VELOCITIES, lasting=lasting, at_end=at_end)
    def slow(e: Evidence) -> Measure:
        return replace(below(float(abs(e.p[-1, 0, 0] - e.p[-1, 1, 0])), bound, "difference"), everywhere=False)

    return Claim("slow", "own question", "Velocities differ by less.", slow)


def judged(status: str, until: float, statement: Claim) -> tuple[str, str]:
    run = replace(fk.simulate(SCENARIO, progress=False).until(until), status=status)
    (result,) = fk.audit(run, [statement]).results
    return str(result.verdict), result.note


@pytest.mark.parametrize(("status", "why"), [("interrupted at t = 0.5", "the run ended early"),
                                             ("running", "the scenario goes on until t = 1")])  # fmt: skip
def test_what_may_still_come_has_not_failed(status, why):
    assert judged(status, 0.5, claim(0.2)) == ("not yet", f"difference; {why}")
    assert judged(status, 0.5, claim(0.2, lasting=True))[0] == "fails"


def test_what_is_true_of_one_moment_of_a_running_run_is_not_decided_where_the_claim_is_about_the_end():
    assert judged("running", 0.5, claim(0.9, at_end=True))[0] == "not yet"
    assert judged("running", 0.5, claim(0.9))[0] == "holds"
    assert judged("running", 1.0, claim(0.9, at_end=True))[0] == "holds"
    assert judged("running", 1.0, claim(0.01))[0] == "fails"
    assert judged("finished", 1.0, claim(0.01))[0] == "fails"
