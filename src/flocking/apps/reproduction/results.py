"""The results of a reproduction of papers."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from flocking.engine.runs.run import Run
from flocking.papers import paper_of
from flocking.papers.equation_table import RowData
from flocking.study.claims.claim import Verdict
from flocking.study.claims.judgement import Judgement


@dataclass(frozen=True)
class Reproduction:
    """Results of a reproduction.

    Parameters
    ----------
    judgements
        Per scenario name, one judgement per claim.
    errata
        Per paper, the statements that are not read as printed, with their faults and counter-examples.
    figures
        Files drawn.
    seconds
        Wall time.
    runs
        Of each scenario the run that is drawn: the first that meets the hypothesis of every claim, or the first.
    first_seed
        The first seed; the others followed one by one.
    seeds
        Seeds of a scenario that were asked for; more are tried where few meet a hypothesis.
    """

    judgements: dict[str, list[Judgement]]
    errata: dict[str, list[RowData]] = field(default_factory=dict)
    figures: list[Path] = field(default_factory=list)
    seconds: float = 0.0
    runs: dict[str, Run] = field(default_factory=dict)
    first_seed: int = 0
    seeds: int = 0

    @property
    def as_expected(self) -> bool:
        """Whether every claim with an expected verdict has it; observations have none."""
        return not self.unexpected

    @property
    def expected(self) -> int:
        """Number of claims with an expected verdict: all but observations."""
        return sum(j.has_expected for found in self.judgements.values() for j in found)

    @property
    def unexpected(self) -> int:
        """Number of those whose verdict is another."""
        return sum(not j.as_expected for found in self.judgements.values() for j in found)

    @property
    def observed(self) -> int:
        """Number of claims without an expected verdict: observations, whose rates are found."""
        return sum(not j.has_expected for found in self.judgements.values() for j in found)

    @property
    def untested(self) -> int:
        """Number of claims with an expected verdict whose hypothesis too few seeds met."""
        return sum(
            j.verdict == Verdict.UNTESTED and j.has_expected for found in self.judgements.values() for j in found
        )

    @property
    def without_rate(self) -> int:
        """Number of observations that too few seeds decided for a rate."""
        return sum(
            j.verdict == Verdict.UNTESTED and not j.has_expected for found in self.judgements.values() for j in found
        )

    @property
    def left_open(self) -> list[str]:
        """Sentences about the claims that were not decided."""
        parts = []
        if n := self.untested:
            parts.append(f"{n} {_are(n)} untested: fewer than five seeds met {_their(n)} hypothesis.")
        if n := self.without_rate:
            parts.append(f"{n} {_are(n)} without a rate: fewer than five seeds decided the observation.")
        if n := self.waiting:
            parts.append(
                f"{n} {_are(n)} not yet decided: for some seed the motion has not settled by the end of the run."
            )
        if n := self.unresolved:
            parts.append(f"{n} {_are(n)} not resolved: for some seed errors or missing records leave it open.")
        return parts

    @property
    def waiting(self) -> int:
        """Number of claims that are undecided because a motion has not settled."""
        return sum(j.verdict == Verdict.NOT_YET for found in self.judgements.values() for j in found)

    @property
    def unresolved(self) -> int:
        """Number of claims that errors or missing records leave open."""
        return sum(j.verdict == Verdict.NOT_RESOLVED for found in self.judgements.values() for j in found)

    def as_list(self) -> list[dict[str, object]]:
        """Rows of ``claims.json``."""
        return claim_rows(self.judgements)


def _are(count: int) -> str:
    return "is" if count == 1 else "are"


def _their(count: int) -> str:
    return "its" if count == 1 else "their"


def rate_of(judgement: Judgement) -> str:
    """Rate of an observation with its interval in per cent; a note where a counter-example decides.

    Parameters
    ----------
    judgement
        Judgement of a claim.
    """
    if judgement.counterexample is not None:
        return "counter-example"
    if judgement.verdict != Verdict.OBSERVED:
        return ""
    return judgement.rate_text


def claim_rows(judgements: dict[str, list[Judgement]]) -> list[dict[str, object]]:
    """Plain data of all judgements, by scenario name."""
    return [j.as_dict(paper_of(name), name) for name, found in judgements.items() for j in found]
