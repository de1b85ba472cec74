"""Witnesses of a verdict: the agents and the time at which a claim fails."""

from __future__ import annotations

from flocking.study.claims.claim import Result, Verdict
from flocking.study.claims.subjects import Witness as Witness
from flocking.study.claims.subjects import about_of
from flocking.study.evidence import Evidence, NotMeasurable, NotResolvable


def witness_of(result: Result, evidence: Evidence) -> Witness | None:
    """Time and agents at which a claim fails; None where it holds or none in particular are concerned.

    Parameters
    ----------
    result
        Verdict on the claim.
    evidence
        The evidence for it.
    """
    found = None
    if result.verdict is Verdict.FAILS:
        found = result.claim.about.witness
    elif result.verdict is Verdict.HYPOTHESIS_NOT_MET:
        found = about_of(result.claim.hypothesis).witness
    if found is None:
        return None
    try:
        return found(evidence)
    except (NotMeasurable, NotResolvable, ArithmeticError, LookupError, ValueError):
        # A refutation may exist without data on the pair and the time.
        return None
