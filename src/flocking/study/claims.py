"""Claims: a hypothesis and a conclusion about a run, each measured, and the verdict that follows."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from flocking.study.evidence import Evidence


class Verdict(StrEnum):
    """What an audit says of a claim."""

    HOLDS = "holds"
    FAILS = "fails"
    HYPOTHESIS_NOT_MET = "hypothesis not met"
    NOT_APPLICABLE = "not applicable"
    NOT_RESOLVED = "not resolved"
    UNTESTED = "untested"


class Origin(StrEnum):
    """Who says what a claim says."""

    PAPER = "stated by the paper"
    ASSUMPTION = "assumed by the paper"
    OWN = "own question"


@dataclass(frozen=True)
class Measure:
    """A measured statement: it holds when its margin is positive.

    Parameters
    ----------
    margin
        How far the measured value is inside its bound; negative when outside. Its unit is the statement's.
    error
        Numerical error that bounds the margin: a margin smaller than it decides nothing.
    note
        The measured value in words.
    """

    margin: float
    error: float = 0.0
    note: str = ""

    @property
    def holds(self) -> bool | None:
        """True or false, or None when the margin is within the error or not a number."""
        if math.isnan(self.margin) or abs(self.margin) < self.error:
            return None
        return self.margin > 0


def below(value: float, bound: float, note: str, error: float = 0.0) -> Measure:
    """A measure that holds when ``value < bound``."""
    return Measure(bound - value, error, note)


def above(value: float, bound: float, note: str, error: float = 0.0) -> Measure:
    """A measure that holds when ``value > bound``."""
    return Measure(value - bound, error, note)


def granted(_: Evidence) -> Measure:
    """The empty hypothesis."""
    return Measure(math.inf, 0.0, "no hypothesis")


def _everywhere(_: Evidence) -> str:
    return ""


@dataclass(frozen=True)
class Claim:
    """A statement about every run of a law, taken from a theorem or true of any law.

    Parameters
    ----------
    key
        Short name, unique within its paper.
    source
        Where it is stated, for example ``"Theorem VI.2"``.
    statement
        What it says, in one sentence.
    conclusion
        Measures the conclusion on the evidence of a run.
    hypothesis
        Measures the hypothesis; none by default.
    obstacle
        Says why the claim cannot be asked of this run at all; empty when it can.
    expected
        The verdict fixed before any run, from the paper or the readings of it.
    reason
        Why the expected verdict is not ``holds``, where it is not.
    dynamic
        Whether the claim rests on the computed motion: then a ledger that does not close leaves it unresolved.
    origin
        Whether the paper states it, assumes it, or it is a question of our own that the paper does not answer: what
        fails of the last two speaks against no paper.
    """

    key: str
    source: str
    statement: str
    conclusion: Callable[[Evidence], Measure]
    hypothesis: Callable[[Evidence], Measure] = granted
    obstacle: Callable[[Evidence], str] = _everywhere
    expected: Verdict = Verdict.HOLDS
    reason: str = ""
    dynamic: bool = True
    origin: Origin = Origin.PAPER

    def examine(self, evidence: Evidence) -> Result:
        """Hold the claim against the evidence of one run."""
        from flocking.study.evidence import NotMeasurable

        try:
            return self._examined(evidence)
        except NotMeasurable as reason:
            return Result(self, Verdict.NOT_APPLICABLE, note=str(reason))

    def _examined(self, evidence: Evidence) -> Result:
        if reason := self.obstacle(evidence):
            return Result(self, Verdict.NOT_APPLICABLE, note=reason)
        hypothesis = self.hypothesis(evidence)
        if hypothesis.holds is not True:
            verdict = Verdict.NOT_RESOLVED if hypothesis.holds is None else Verdict.HYPOTHESIS_NOT_MET
            return Result(self, verdict, hypothesis.margin, hypothesis.error, hypothesis.note)
        measured = self.conclusion(evidence)
        if self.dynamic and not evidence.ledger_closes:
            return Result(self, Verdict.NOT_RESOLVED, measured.margin, math.inf, evidence.ledger_note)
        holds = measured.holds
        verdict = Verdict.NOT_RESOLVED if holds is None else Verdict.HOLDS if holds else Verdict.FAILS
        return Result(self, verdict, measured.margin, measured.error, measured.note)


@dataclass(frozen=True)
class Result:
    """Verdict on one claim for one run.

    Parameters
    ----------
    claim
        The claim.
    verdict
        What came out.
    margin, error
        Margin of the conclusion (or of a hypothesis that is not met) and the numerical error that bounds it.
    note
        The measured value in words, or why there is none.
    """

    claim: Claim
    verdict: Verdict
    margin: float = math.nan
    error: float = math.nan
    note: str = ""

    def as_dict(self) -> dict[str, Any]:
        """Plain data for JSON; numbers that are not finite become None."""
        return {
            "claim": self.claim.key,
            "source": self.claim.source,
            "origin": str(self.claim.origin),
            "statement": self.claim.statement,
            "expected": str(self.claim.expected),
            "verdict": str(self.verdict),
            "margin": finite(self.margin),
            "error": finite(self.error),
            "note": self.note,
        }


def finite(value: float) -> float | None:
    """The value, or None where JSON has no word for it."""
    return float(value) if math.isfinite(value) else None
