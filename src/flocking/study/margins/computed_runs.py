"""Conclusions of claims, read from a run as it was computed, whether or not the hypotheses are met."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from flocking.arrays import Array
from flocking.engine.runs.run import DOUBT_FIELDS, Accuracy, Run
from flocking.study.claims.audit import Report
from flocking.study.claims.claim import Basis, Claim, Verdict
from flocking.study.claims.subjects import Subject
from flocking.study.evidence import Evidence

HYPOTHESIS = " hypothesis"
"""Ends the key under which the hypothesis of a claim is judged."""


def as_computed(run: Run) -> Run:
    """The run with its motion, switches and approaches taken as they were computed, without their numerical errors.

    Verdicts on a single run are left open where an error could change them, and the engine for held control estimates
    none; a share over many runs is one of computed runs.
    """
    if not run.fidelity.switches_located:
        return run
    switches = run.switches.copy()
    for name in ("time_error", "speed_error"):
        errors: Array = switches[name]
        switches[name] = np.nan_to_num(errors)
    largest = {} if run.accuracy is None else run.accuracy.largest
    accuracy = Accuracy(np.zeros((len(run.t), 2)), np.zeros(0, DOUBT_FIELDS), largest)
    return replace(run, switches=switches, accuracy=accuracy)


def bare(claim: Claim) -> tuple[Claim, Claim]:
    """The conclusion of a claim without its hypothesis, and its hypothesis where the claim applies, as claims."""
    plain = replace(claim.unconditional, basis=Basis.GENERAL, ground="", counterexample=None, expected=Verdict.HOLDS)
    hypothesis = replace(plain, key=claim.key + HYPOTHESIS, conclusion=claim.hypothesis, dynamic=False)
    return replace(plain, obstacle=_nothing), hypothesis


def _nothing(_: Evidence) -> str:
    return ""


def about_motion(claims: Sequence[Claim]) -> tuple[Claim, ...]:
    """Claims that are not about the energy, which has another meaning where other forces act than those of the law."""
    return tuple(claim for claim in claims if claim.about.subject is not Subject.LEDGER)


@dataclass(frozen=True)
class Conclusions:
    """Judges the conclusions, and apart from them the hypotheses, of claims.

    Parameters
    ----------
    claims
        The claims.
    """

    claims: tuple[Claim, ...]

    def __call__(self, run: Run) -> Report:
        """Verdicts on a run."""
        evidence = Evidence(as_computed(run))
        return Report(run, tuple(part.examine(evidence) for claim in self.claims for part in bare(claim)))
