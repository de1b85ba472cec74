"""Agents that broke a claim, and when: the witnesses of a verdict."""

from __future__ import annotations

from flocking.study.claims.claim import Result, Verdict
from flocking.study.claims.subjects import Witness as Witness
from flocking.study.claims.subjects import about_of
from flocking.study.evidence import Evidence, NotMeasurable, NotResolvable


def witness_of(result: Result, evidence: Evidence) -> Witness | None:
    """The moment and the agents that broke a claim; None where it holds or nothing points at anyone.

    Parameters
    ----------
    result
        Verdict on the claim.
    evidence
        Evidence it rests on.
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
        # What refutes a claim need not be told to the pair and the moment.
        return None
