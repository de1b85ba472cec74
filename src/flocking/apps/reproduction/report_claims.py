"""Claims in the report, each beside the picture of its subject."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Mapping
from html import escape
from pathlib import Path

from flocking.apps.reproduction.claim_pictures import CAPTIONS, picture_of
from flocking.apps.reproduction.results import rate_of
from flocking.apps.tables import short
from flocking.study.claims.claim import Origin, Verdict
from flocking.study.claims.judgement import Judgement


def claims_beside_pictures(
    name: str,
    judgements: Iterable[Judgement],
    pictures: Path,
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
        Folder of the pictures that were drawn for the claims.
    figures
        The paper's figures drawn from this scenario: file and caption, by number.
    seed
        Sentence for the captions of the others: whose run they show.
    """
    groups: dict[str, list[Judgement]] = {}
    for judgement in judgements:
        groups.setdefault(picture_of(judgement.claim, figures), []).append(judgement)
    parts = []
    for picture, group in groups.items():
        shown = _picture(name, picture, pictures, figures, seed)
        parts.append(f'<div class="beside">{shown}<div>{"".join(_claim(name, j) for j in group)}</div></div>\n')
    return "".join(parts)


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


def place_of(name: str, judgement: Judgement) -> str:
    """Anchor of a claim of a scenario.

    Parameters
    ----------
    judgement
        Judgement of the claim.
    """
    return f"{name}-claim-{judgement.claim.key}"


def _picture(name: str, picture: str, pictures: Path, figures: Mapping[str, tuple[Path, str]], seed: str) -> str:
    if picture.startswith("figure-"):
        number = picture.removeprefix("figure-")
        file, caption = figures[number]
        return card(embedded(file, "image/svg+xml"), f"Fig. {number}. {caption}")
    file = pictures / f"{name}-{picture}.svg"
    return card(embedded(file, "image/svg+xml"), f"{CAPTIONS[picture]}{seed}") if file.exists() else "<div></div>"


def _claim(name: str, j: Judgement) -> str:
    verdict = str(j.verdict)
    kind = verdict if verdict in ("holds", "fails") else "other"
    rate = (
        f"; held in {rate_of(j)} of the decided seeds, with the 95 % interval" if j.verdict == Verdict.OBSERVED else ""
    )
    origin = "" if j.claim.origin is Origin.PAPER else f"{j.claim.origin}; "
    basis = j.claim.ground or str(j.claim.basis)
    decisive = "counter-example:" if j.counterexample is not None else "worst margin"
    unexpected = "" if j.as_expected else " unexpected"
    expected = "" if j.as_expected else f' <span class="dim">expected: {escape(j.claim.expectation)}</span>'
    reason = f'<p class="dim">{escape(j.claim.reason)}</p>' if j.claim.reason else ""
    measured = f"; {escape(j.worst.note)}" if j.worst.note else ""
    waiting = f", not yet {j.waiting}" if j.waiting else ""
    waiting += f", not resolved {j.unresolved}" if j.unresolved else ""
    return (
        f'<article class="claim {kind}{unexpected}" id="{escape(place_of(name, j))}">'
        f'<p><span class="verdict {kind}">{escape(verdict)}</span>{expected} {escape(j.claim.statement)} '
        f'<span class="dim">{escape(origin)}{escape(j.claim.source)}</span></p>{reason}'
        f'<p class="dim small">Rests on: {escape(basis)}</p>'
        f'<p class="small">held {j.held}{waiting}, met {j.met}, tried {j.tried}{escape(rate)}; {decisive} '
        f"{escape(short(j.worst.margin))}{measured}</p></article>"
    )


def embedded(path: Path, kind: str) -> str:
    """A file as a data URL.

    Parameters
    ----------
    path
        The file.
    kind
        Its media type.
    """
    return f"data:{kind};base64,{base64.b64encode(path.read_bytes()).decode()}"


def card(source: str, caption: str, *, video: bool = False) -> str:
    """A picture or film with its caption.

    Parameters
    ----------
    source
        Address of the picture.
    caption
        What it shows.
    video
        Whether it is a video and not a picture.
    """
    text = escape(caption)
    shown = (
        f'<video src="{source}" controls loop muted playsinline></video>'
        if video
        else f'<img src="{source}" alt="{text}">'
    )
    return f"<figure>{shown}<figcaption>{text}</figcaption></figure>"
