"""Judgements: one claim over runs from many seeds, and over a counter-example where one is known."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from flocking.errors import InvalidInput
from flocking.formula.safe_digits import percent_text
from flocking.study.claims.audit import Report
from flocking.study.claims.claim import Basis, Claim, Result, Verdict, finite
from flocking.study.confidence_intervals import share_interval

LEVEL = 0.95
"""Level of the intervals of rates, by convention; the default of `flocking.study.confidence_intervals`."""

FEWEST_SEEDS = 5
"""Fewer seeds that meet a claim's hypothesis leave it untested."""

DECIDED = (Verdict.HOLDS, Verdict.FAILS)


@dataclass(frozen=True)
class Judgement:
    """One claim over runs from many seeds.

    Parameters
    ----------
    claim
        The claim.
    results
        Its results, one per seed.
    counterexample
        Its result for the claim's counter-example, where it names one.
    """

    claim: Claim
    results: tuple[Result, ...]
    counterexample: Result | None = None

    @property
    def tried(self) -> int:
        """Number of seeds."""
        return len(self.results)

    @property
    def met(self) -> int:
        """Seeds whose run meets the hypothesis."""
        unmet = (Verdict.HYPOTHESIS_NOT_MET, Verdict.NOT_APPLICABLE)
        return sum(r.verdict not in unmet for r in self.results)

    @property
    def held(self) -> int:
        """Seeds for which the claim holds."""
        return sum(r.verdict == Verdict.HOLDS for r in self.results)

    @property
    def waiting(self) -> int:
        """Seeds whose run is too short: they neither show the claim nor refute it."""
        return sum(r.verdict == Verdict.NOT_YET for r in self.results)

    @property
    def unresolved(self) -> int:
        """Seeds for which the numerical error, or missing records, leave the claim open."""
        return sum(r.verdict == Verdict.NOT_RESOLVED for r in self.results)

    @property
    def decided(self) -> int:
        """Seeds for which it holds or fails."""
        return sum(r.verdict in DECIDED for r in self.results)

    @property
    def undecided(self) -> int:
        """Seeds that neither miss the hypothesis nor decide the claim."""
        return self.met - self.decided

    @property
    def rate(self) -> tuple[float, float, float]:
        """Share of the seeds that meet the hypothesis for which it holds, and its exact 95 % interval.

        Where some of them are undecided the share is nan, and the interval counts them as either: runs that are too
        short or too inexact for a verdict are no random choice. All are nan where none is decided.
        """
        if not self.decided:
            return math.nan, math.nan, math.nan
        interval = share_interval(self.held, self.met, LEVEL, unknown=self.undecided)
        return math.nan if self.undecided else self.held / self.met, interval.low, interval.high

    @property
    def rate_text(self) -> str:
        """`rate` in per cent, from the share were all undecided seeds failures to that were all successes."""
        share, low, high = self.rate
        if not self.undecided:
            return percent_text(share, low, high)
        least, most = (percent_text(count / self.met, low, high) for count in (self.held, self.held + self.undecided))
        return f"{least.split()[0]} to {most}"

    @property
    def verdict(self) -> Verdict:
        """The verdict over all runs.

        A claim fails when the counter-example or one seed refutes it, and is untested when fewer than five seeds meet
        its hypothesis. It holds when all seeds that meet the hypothesis decide it; a proved claim when five do. An
        observation has a `rate` instead.
        """
        if self.counterexample is not None and self.counterexample.verdict == Verdict.FAILS:
            return Verdict.FAILS
        if self.results and all(r.verdict == Verdict.NOT_APPLICABLE for r in self.results):
            return Verdict.NOT_APPLICABLE
        found = {r.verdict for r in self.results}
        if self.claim.basis is Basis.OBSERVATION:
            return Verdict.OBSERVED if self.decided >= FEWEST_SEEDS else Verdict.UNTESTED
        if self.met < FEWEST_SEEDS:
            return Verdict.UNTESTED
        if Verdict.FAILS in found:
            return Verdict.FAILS
        if self.decided == self.met or (self.decided >= FEWEST_SEEDS and self.claim.basis is Basis.PROOF):
            return Verdict.HOLDS
        return Verdict.NOT_RESOLVED if Verdict.NOT_RESOLVED in found else Verdict.NOT_YET

    @property
    def worst(self) -> Result:
        """The counter-example; else the result with the smallest margin of those decided; else the first."""
        if self.counterexample is not None:
            return self.counterexample
        met = [r for r in self.results if math.isfinite(r.margin) and r.verdict in DECIDED]
        return min(met, key=lambda r: r.margin) if met else self.results[0]

    @property
    def has_expected(self) -> bool:
        """Whether there is an expected verdict: not for observations, whose `rate` is found instead."""
        return self.claim.basis is not Basis.OBSERVATION

    @property
    def as_expected(self) -> bool:
        """Whether the verdict is not another than the expected; true where none is (`has_expected`)."""
        return not self.has_expected or self.verdict == self.claim.expected

    @property
    def is_contrary(self) -> bool:
        """Whether what was found contradicts the expected verdict; what is left open does not."""
        if self.as_expected:
            return False
        refuted = self.claim.expected == Verdict.HOLDS and any(r.verdict == Verdict.FAILS for r in self.results)
        return refuted or self.verdict in DECIDED

    def as_dict(self, paper: str, scenario: str) -> dict[str, object]:
        """Plain data for ``claims.json``.

        Parameters
        ----------
        paper, scenario
            Key of the paper and name of its scenario.
        """
        worst = self.worst
        share, low, high = self.rate
        return {
            "paper": paper,
            "scenario": scenario,
            "claim": self.claim.key,
            "statement": self.claim.statement,
            "source": self.claim.source,
            "origin": str(self.claim.origin),
            "basis": str(self.claim.basis),
            "ground": self.claim.ground,
            "expected": self.claim.expectation,
            "verdict": str(self.verdict),
            "margin": finite(worst.margin),
            "error": finite(worst.error),
            "note": worst.note,
            "reason": self.claim.reason,
            "counterexample": None if self.counterexample is None else self.counterexample.note,
            "seeds": {
                "tried": self.tried,
                "met": self.met,
                "decided": self.decided,
                "held": self.held,
                "not_resolved": self.unresolved,
                "not_yet": self.waiting,
            },
            "rate": {"held": finite(share), "low": finite(low), "high": finite(high), "level": LEVEL},
        }


def judge(claims: Sequence[Claim], reports: Sequence[Report]) -> list[Judgement]:
    """Collect the results of several audits, their ``reports``, by claim.

    Raises
    ------
    InvalidInput
        When there is no report.
    KeyError
        When a report has no result of a claim.
    """
    if not reports:
        raise InvalidInput("judge", "reports", "must hold at least one report", "none", "Audit a run with fk.audit.")
    return [Judgement(c, tuple(report[c.key] for report in reports)) for c in claims]
