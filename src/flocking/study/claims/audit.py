"""Audits: verdicts on claims about a run."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from html import escape

from flocking.engine.driver.waits import counted
from flocking.engine.runs.run import Run
from flocking.errors import InvalidInput
from flocking.model.checks import listed
from flocking.study.claims.claim import Claim, Result, Verdict
from flocking.study.evidence import Evidence

DECIDED = (Verdict.HOLDS, Verdict.FAILS, Verdict.NOT_RESOLVED)
"""Verdicts that the expected one is compared with: not resolved is none that anybody expects, and hides no failure."""


@dataclass(frozen=True, repr=False)
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

    def __iter__(self) -> Iterator[Result]:
        return iter(self.results)

    def __len__(self) -> int:
        return len(self.results)

    def __contains__(self, key: object) -> bool:
        return any(key is r or key == r.claim.key for r in self.results)

    def __getitem__(self, key: str) -> Result:
        """Result of the claim with this key; a `KeyError` with the known ones where there is none."""
        found = next((r for r in self.results if r.claim.key == key), None)
        if found is None:
            known = ", ".join(r.claim.key for r in self.results) or "none"
            raise KeyError(f"no claim of this report has the key {key!r}; there are: {known}")
        return found

    @property
    def as_expected(self) -> bool:
        """Whether every claim with a verdict of `DECIDED` has the expected one; of others nothing is expected."""
        return all(r.as_expected for r in self.results if r.verdict in DECIDED)

    def __repr__(self) -> str:
        """In one line: how many claims have which verdict."""
        counts = Counter(str(r.verdict) for r in self.results)
        return f"<Report of {self.run!r}: {', '.join(f'{n} {verdict}' for verdict, n in counts.items())}>"

    def _repr_html_(self) -> str:
        """In a notebook: the counts, and folded a row for each claim."""
        from flocking.formula.markup.cells import folded, rows_table
        from flocking.formula.markup.text_formulas import set_text

        counts = Counter(str(r.verdict) for r in self.results)
        rows = [
            (escape(r.claim.key), escape(str(r.verdict)), set_text(r.claim.statement), _short(r.margin),
             _short(r.error), escape(r.words))
            for r in self.results
        ]  # fmt: skip
        head = ("claim", "verdict", "statement", "margin", "error", "measured")
        summary = f"Audit: {', '.join(f'{n} {verdict}' for verdict, n in counts.items())}"
        return folded(summary, rows_table(head, rows))

    def as_dict(self) -> dict[str, object]:
        """Plain data for JSON."""
        return {
            "scenario": self.run.scenario.name,
            "status": self.run.status,
            "as_expected": self.as_expected,
            "claims": [r.as_dict() for r in self.results],
        }

    def __str__(self) -> str:
        rows = [(r.claim.key, str(r.verdict), _short(r.margin), _short(r.error), r.words) for r in self.results]
        head = ("claim", "verdict", "margin", "error", "measured")
        widths = [max(len(row[k]) for row in [head, *rows]) for k in range(4)]
        lines = [
            "  ".join([*(cell.ljust(w) for cell, w in zip(row, widths, strict=False)), row[4]]) for row in [head, *rows]
        ]
        return "\n".join(line.rstrip() for line in lines)


def _short(value: float) -> str:
    return f"{value:.2e}" if math.isfinite(value) else "-"


def audit(run: Run, claims: Sequence[Claim] | None = None) -> Report:
    """Judge claims about a run.

    Parameters
    ----------
    run
        The run.
    claims
        The claims; the general ones when absent, each of which states why where it does not apply.

    Raises
    ------
    InvalidInput
        When it is no run, or these are no claims, each with a key of its own.
    """
    from flocking.study.claims.general_claims import GENERAL

    if not isinstance(run, Run):
        raise InvalidInput("audit", "run", "must be a Run", run, "Use fk.simulate(scenario).")
    checked = check_claims("audit", GENERAL if claims is None else claims)
    evidence = Evidence(run)
    return Report(run, tuple(claim.examine(evidence) for claim in counted(checked, "claims", lambda c: c.key)))


def check_claims(owner: str, claims: object, parameter: str = "claims") -> tuple[Claim, ...]:
    """Claims, each with a key of its own, as verdicts are kept by their keys.

    Parameters
    ----------
    owner, parameter
        Whose parameter they are, and its name, for messages.
    claims
        What was given.

    Raises
    ------
    InvalidInput
        When something else is among them, or two have one key.
    """
    checked = listed(owner, parameter, claims, "must be claims")
    for claim in checked:
        if not isinstance(claim, Claim):
            raise InvalidInput(owner, parameter, "must be claims", claim)
    keys = Counter(claim.key for claim in checked)
    for key, count in keys.items():
        if count > 1:
            raise InvalidInput(owner, parameter, "must have different keys, by which verdicts are kept", key)
    return tuple(checked)
