"""Claims in reports, each beside the picture of its subject."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from html import escape
from pathlib import Path

from flocking.apps.reproduction.claim_pictures import CAPTIONS, picture_of, picture_stem
from flocking.apps.reproduction.report_page import card, embedded
from flocking.apps.reproduction.results import rate_of
from flocking.apps.tables import short
from flocking.formula.markup.text_formulas import set_text
from flocking.study.claims.claim import Claim, Origin, Result, Verdict
from flocking.study.claims.judgement import DECIDED, Judgement

SHAPES: dict[str, str] = {
    Verdict.HOLDS: "✓",
    Verdict.FAILS: "✕",
    Verdict.OBSERVED: "◆",
    Verdict.NOT_YET: "…",
    Verdict.NOT_RESOLVED: "?",
    Verdict.UNTESTED: "○",
    Verdict.HYPOTHESIS_NOT_MET: "△",
    Verdict.NOT_APPLICABLE: "–",
}
"""Sign of each verdict, so that they differ in more than colour."""

Judged = Judgement | Result
"""A claim judged over many seeds, or about one run."""


def kind_of(verdict: Verdict) -> str:
    """Class of the style sheet for a verdict."""
    return str(verdict) if verdict in (Verdict.HOLDS, Verdict.FAILS) else "other"


def verdict_words(verdict: Verdict) -> str:
    """A verdict in words with its sign."""
    shape = f'<span aria-hidden="true">{SHAPES[verdict]}</span>'
    return f'<span class="verdict {kind_of(verdict)}">{shape} {escape(str(verdict))}</span>'


def claims_beside_pictures(
    name: str,
    judgements: Iterable[Judged],
    pictures: Path | None,
    figures: Mapping[str, tuple[Path, str]],
    seed: str = "",
) -> str:
    """Groups of claims of a scenario, each group beside the picture that shows it.

    Parameters
    ----------
    name
        Name of the scenario.
    judgements
        Judgements of its claims.
    pictures
        Folder of the pictures that were drawn for the claims; None where none were.
    figures
        The paper's figures drawn from this scenario: file and caption, by number.
    seed
        Sentence for the captions of the others: whose run they show.
    """
    groups: dict[str, list[Judged]] = {}
    for judgement in judgements:
        groups.setdefault(picture_of(judgement.claim, figures), []).append(judgement)
    parts = []
    for picture, group in groups.items():
        shown = _picture(name, picture, pictures, figures, seed)
        cards = "".join(_judgement(name, j) if isinstance(j, Judgement) else _result(name, j) for j in group)
        parts.append(f'<div class="beside">{shown}<div>{cards}</div></div>\n')
    return f'<div class="groups">\n{"".join(parts)}</div>\n'


def cited(judgements: Iterable[Judgement], numbers: Iterable[str]) -> set[str]:
    """Numbers of the figures that claims name.

    Parameters
    ----------
    judgements
        Judgements of the claims of a scenario.
    numbers
        Numbers of the figures that are drawn from its run.
    """
    known = list(numbers)
    return {name.removeprefix("figure-") for j in judgements if (name := picture_of(j.claim, known))[:7] == "figure-"}


def place_of(name: str, judged: Judged) -> str:
    """Anchor of a claim of a scenario.

    Parameters
    ----------
    judged
        The claim with its verdict.
    """
    return f"{name}-claim-{judged.claim.key}"


def _picture(name: str, picture: str, pictures: Path | None, figures: Mapping[str, tuple[Path, str]], seed: str) -> str:
    if picture.startswith("figure-"):
        number = picture.removeprefix("figure-")
        file, caption = figures[number]
        return card(embedded(file, "image/svg+xml"), f"Fig. {number}. {caption}")
    if pictures is None:
        return "<div></div>"
    file = pictures / f"{picture_stem(name, picture)}.svg"
    return card(embedded(file, "image/svg+xml"), f"{CAPTIONS[picture]}{seed}") if file.exists() else "<div></div>"


def _judgement(name: str, j: Judgement) -> str:
    either = ", undecided ones counted as either" if j.undecided else ""
    rate = (
        f"; held in {rate_of(j)} of the seeds that meet the hypothesis{either}, with the 95 % interval"
        if j.verdict == Verdict.OBSERVED
        else ""
    )
    decisive = "counter-example:" if j.counterexample is not None else "worst margin"
    waiting = f", not yet {j.waiting}" if j.waiting else ""
    waiting += f", not resolved {j.unresolved}" if j.unresolved else ""
    counts = f"held {j.held}{waiting}, met {j.met}, tried {j.tried}{escape(rate)}; {decisive} "
    # Not resolved is framed too, though it contradicts nothing: it hides no failure.
    fine = not (j.is_contrary or (j.verdict == Verdict.NOT_RESOLVED and not j.as_expected))
    return _card(j.claim, place_of(name, j), j.verdict, fine, counts + _measured(j.worst))


def _result(name: str, result: Result) -> str:
    # A run that is too short for a claim contradicts nothing; not resolved is framed, as it hides no failure.
    fine = result.as_expected or result.verdict not in (*DECIDED, Verdict.NOT_RESOLVED)
    return _card(result.claim, place_of(name, result), result.verdict, fine, f"margin {_measured(result)}")


def _measured(result: Result) -> str:
    error = f" (error {short(result.error)})" if result.error > 0 else ""
    return set_text(f"{short(result.margin)}{error}{f'; {result.words}' if result.words else ''}")


def _card(claim: Claim, place: str, verdict: Verdict, as_expected: bool, measured: str) -> str:
    origin = "" if claim.origin is Origin.PAPER else f"{claim.origin}; "
    unexpected = "" if as_expected else " unexpected"
    expected = "" if as_expected else f' <span class="dim">expected: {escape(claim.expectation)}</span>'
    reason = f'<p class="dim">{set_text(claim.reason)}</p>' if claim.reason else ""
    return (
        f'<article class="claim {kind_of(verdict)}{unexpected}" id="{escape(place)}">'
        f"<p>{verdict_words(verdict)}{expected} {set_text(claim.statement)} "
        f'<span class="dim">{escape(origin)}{set_text(claim.source, letters=False)}</span></p>{reason}'
        f'<p class="dim small">Rests on: {set_text(claim.ground or str(claim.basis))}</p>'
        f'<p class="small">{measured}</p></article>'
    )
