"""Audits: every claim held against a run, or against runs from many seeds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from flocking.engine.run import Run
from flocking.errors import InvalidInput
from flocking.model.checks import listed
from flocking.study.claims import Claim, Result, Verdict, finite
from flocking.study.evidence import Evidence

FEWEST_SEEDS = 5
"""Fewer seeds that meet a claim's hypothesis leave it untested."""


@dataclass(frozen=True)
class Report:
    """Verdicts of one run.

    Parameters
    ----------
    run
        The run.
    results
        One result per claim.
    """

    run: Run
    results: tuple[Result, ...]

    def __getitem__(self, key: str) -> Result:
        """Result of the claim with this key."""
        return next(r for r in self.results if r.claim.key == key)

    @property
    def as_expected(self) -> bool:
        """Whether no claim that could be decided came out other than expected. One that is ``not yet`` was not."""
        decided = (Verdict.HOLDS, Verdict.FAILS, Verdict.NOT_RESOLVED)
        return all(r.verdict == r.claim.expected for r in self.results if r.verdict in decided)

    def as_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {
            "scenario": self.run.scenario.name,
            "status": self.run.status,
            "as_expected": self.as_expected,
            "claims": [r.as_dict() for r in self.results],
        }

    def __str__(self) -> str:
        rows = [(r.claim.key, str(r.verdict), _short(r.margin), _short(r.error), r.note) for r in self.results]
        head = ("claim", "verdict", "margin", "error", "measured")
        widths = [max(len(row[k]) for row in [head, *rows]) for k in range(4)]
        lines = [
            "  ".join([*(cell.ljust(w) for cell, w in zip(row, widths, strict=False)), row[4]]) for row in [head, *rows]
        ]
        return "\n".join(line.rstrip() for line in lines)


def _short(value: float) -> str:
    return f"{value:.2e}" if math.isfinite(value) else "-"


def audit(run: Run, claims: Sequence[Claim] | None = None) -> Report:
    """Hold claims against a run.

    Parameters
    ----------
    run
        The run.
    claims
        The claims; those that make sense for any law when absent, each of which says why it does not apply
        where it does not.
    """
    from flocking.study.general_claims import GENERAL

    if not isinstance(run, Run):
        raise InvalidInput("audit", "run", "must be a Run", run, "Use fk.simulate(scenario).")
    held = listed("audit", "claims", GENERAL if claims is None else claims, "must be claims")
    for claim in held:
        if not isinstance(claim, Claim):
            raise InvalidInput("audit", "claims", "must be claims", claim)
    evidence = Evidence(run)
    return Report(run, tuple(claim.examine(evidence) for claim in held))


@dataclass(frozen=True)
class Judgement:
    """One claim over runs from many seeds.

    Parameters
    ----------
    claim
        The claim.
    results
        Its results, one per seed.
    """

    claim: Claim
    results: tuple[Result, ...]

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
    def verdict(self) -> Verdict:
        """Holds for all seeds that meet the hypothesis, fails for one; untested when they are fewer than five.

        A seed whose run has not settled leaves a claim that no other refutes at ``not yet``.
        """
        if self.results and all(r.verdict == Verdict.NOT_APPLICABLE for r in self.results):
            return Verdict.NOT_APPLICABLE
        if self.met < FEWEST_SEEDS:
            return Verdict.UNTESTED
        if any(r.verdict == Verdict.FAILS for r in self.results):
            return Verdict.FAILS
        if any(r.verdict == Verdict.NOT_RESOLVED for r in self.results):
            return Verdict.NOT_RESOLVED
        return Verdict.NOT_YET if self.waiting else Verdict.HOLDS

    @property
    def worst(self) -> Result:
        """The result with the smallest margin among those that meet the hypothesis; the first when none does."""
        met = [r for r in self.results if math.isfinite(r.margin) and r.verdict in (Verdict.HOLDS, Verdict.FAILS)]
        return min(met, key=lambda r: r.margin) if met else self.results[0]

    @property
    def as_expected(self) -> bool:
        """Whether the verdict is the one fixed before the runs."""
        return self.verdict == self.claim.expected

    def as_dict(self, paper: str, scenario: str) -> dict[str, Any]:
        """Plain data for ``claims.json``.

        Parameters
        ----------
        paper, scenario
            Key of the paper and name of its scenario.
        """
        worst = self.worst
        return {
            "paper": paper,
            "scenario": scenario,
            "claim": self.claim.key,
            "statement": self.claim.statement,
            "source": self.claim.source,
            "expected": str(self.claim.expected),
            "verdict": str(self.verdict),
            "margin": finite(worst.margin),
            "error": finite(worst.error),
            "note": worst.note,
            "reason": self.claim.reason,
            "seeds": {"tried": self.tried, "met": self.met, "held": self.held, "not_yet": self.waiting},
        }


def judge(claims: Sequence[Claim], reports: Sequence[Report]) -> list[Judgement]:
    """Collect the results of several audits, their ``reports``, by claim."""
    return [Judgement(c, tuple(report[c.key] for report in reports)) for c in claims]
