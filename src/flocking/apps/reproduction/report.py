"""The report of a reproduction: one self-contained HTML file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from html import escape
from pathlib import Path

from flocking.apps.reproduction.film import film_in
from flocking.apps.reproduction.report_certificates import certificates_table
from flocking.apps.reproduction.report_claims import cited, claims_beside_pictures, place_of, verdict_words
from flocking.apps.reproduction.report_errata import equation_table, errata_tables
from flocking.apps.reproduction.report_margins import margins_table
from flocking.apps.reproduction.report_page import boxes, card, contents, embedded, folding, page
from flocking.apps.reproduction.report_provenance import runs_table, software_facts
from flocking.apps.reproduction.report_scenarios import scenario_section
from flocking.apps.reproduction.report_tables import head_row, table
from flocking.apps.reproduction.results import Reproduction
from flocking.engine.runs.run import Run
from flocking.engine.storage.atomic_files import write_file
from flocking.formula.markup.text_formulas import set_text
from flocking.papers.description import Paper
from flocking.papers.equation_table import Fault
from flocking.papers.stored_margins import is_stored
from flocking.show.declaration import Figure
from flocking.study.claims.claim import Origin, Verdict
from flocking.study.claims.judgement import Judgement

MARGINS = "Margins: how much delay, loss, noise and limits its conclusions withstand"
"""Heading of the stored margins of a paper."""

CLAIMS = "claims"
"""Folder of a paper that holds the pictures drawn for its claims."""

COUNTED = (
    "claims",
    "hold",
    "fail",
    "observed",
    "undecided",
    "as expected",
    "false statements",
    "misprints",
    "ambiguous or missing",
    "own questions",
)
"""What the summary counts for each paper."""


def write_report(found: Reproduction, papers: dict[str, Paper], out: Path) -> Path:
    """Write ``report.html``; figures and films are read from the folder.

    Parameters
    ----------
    found
        Results of the reproduction.
    papers
        The papers, by key.
    out
        Folder that holds the figures and films, to write to.

    Returns
    -------
    Path
        The report.
    """
    sections = [_paper(key, article, found, out) for key, article in papers.items()]
    body = _summary(found, papers) + _contents(found, papers, out) + "".join(sections) + _provenance(found, papers)
    text = page("Flocking control: papers, reproduced", body)
    return write_file(out / "report.html", text.encode(), "write the report")


def seeds_of(figure: Figure, runs: Mapping[str, Run]) -> str:
    """Sentence for a figure's caption: which seeds the runs it shows have; empty where it shows none.

    Parameters
    ----------
    figure
        The figure.
    runs
        The runs that are drawn, by the names of their scenarios.
    """
    names = figure.scenarios("") if figure.scenario else ()
    seeds = dict.fromkeys(runs[name].scenario.seed for name in names if name in runs)
    return f" Seed{'s' * (len(seeds) > 1)} {' and '.join(map(str, seeds))}." if seeds else ""


def figures_of(article: Paper, name: str) -> dict[str, str]:
    """Captions of the figures that are drawn from a scenario, alone or beside others, by number.

    Parameters
    ----------
    article
        The paper.
    name
        Name of the scenario.
    """
    first = next(iter(article.scenarios()))
    return {str(k): f.caption for k, f in article.figures().items() if name in f.scenarios(first)}


def anchor_of(scenario: str) -> str:
    """Anchor of the section of a scenario, whose name may be the key of its paper."""
    return f"scenario-{scenario}"


def _contents(found: Reproduction, papers: dict[str, Paper], out: Path) -> str:
    entries = []
    for key, article in papers.items():
        below = [(anchor_of(name), article.title_of(name)) for name in article.scenarios()]
        below += [(f"{key}-figures", "Figures")]
        below += [(f"{key}-film", "Film")] if _film_of(found, article, out / key) is not None else []
        below += [(f"{key}-margins", MARGINS)] if is_stored(key) else []
        below += [(f"{key}-errata", "False statements, misprints, ambiguities, own questions; equation table")]
        entries.append((key, _name(article), below))
    entries.append(("provenance", "Provenance", []))
    return f"<h2 id='contents'>Contents</h2>\n{contents(entries)}"


def _film_of(found: Reproduction, article: Paper, folder: Path) -> Path | None:
    return film_in(folder) if next(iter(article.scenarios())) in found.runs else None


def _all(found: Reproduction) -> list[Judgement]:
    return [j for judgements in found.judgements.values() for j in judgements]


def _summary(found: Reproduction, papers: dict[str, Paper]) -> str:
    judged = _all(found)
    counts = Counter(j.verdict for j in judged)
    faults = Counter(row["verdict"] for rows in found.errata.values() for row in rows)
    origins = Counter(j.claim.origin for j in judged)
    # Where few seeds meet a hypothesis more of them are tried.
    tried = [j.tried for j in judged] or [0]
    numbers = [
        (str(len(judged)), "claims judged"),
        (str(counts[Verdict.HOLDS]), "hold"),
        (str(counts[Verdict.FAILS]), "fail"),
        (str(counts[Verdict.OBSERVED]), "observed, with a rate"),
        (str(len(judged) - sum(counts[v] for v in (Verdict.HOLDS, Verdict.FAILS, Verdict.OBSERVED))), "undecided"),
        (str(origins[Origin.ASSUMPTION]), "claims that a paper assumes"),
        (str(origins[Origin.OWN]), "claims that are our own questions"),
        (str(faults[Fault.FALSE]), "false statements"),
        (str(faults[Fault.MISPRINT]), "misprints"),
        (str(faults[Fault.READING]), "ambiguities or missing values"),
        (str(faults[Fault.OWN]), "statements of our own, not printed"),
        (" to ".join(map(str, sorted({min(tried), max(tried)}))), "seeds a scenario"),
        (f"{found.seconds:.0f} s", "computing time"),
    ]
    rows = "".join(_paper_row(key, article, found) for key, article in papers.items())
    head = head_row("paper", *COUNTED)
    return (
        "<h1>Flocking control: the papers, reproduced</h1>\n"
        f'<p class="dim">What each theorem claims, whether it holds in the simulations, by what margin, and which '
        f"printed statements are wrong.</p>\n{boxes(numbers)}<p>{escape(_outcome(found))}</p>\n"
        f"{table(head, rows, 'What was found in each paper')}{_failing(found, papers)}"
    )


def _outcome(found: Reproduction) -> str:
    judged = _all(found)
    contrary = sum(j.is_contrary for j in judged)
    proof = f"the verdict that follows from {'their' if contrary > 1 else 'its'} proof or counter-example"
    if all(j.as_expected for j in judged):
        every = f"Every claim with an expected verdict has {proof}; observations have rates"
        without = f", but for {found.without_rate} that fewer than five seeds decided" if found.without_rate else ""
        return f"{every}{without}."
    claims = {0: "No claim differs", 1: "1 claim differs"}.get(contrary, f"{contrary} claims differ")
    parts = [f"{claims} from {proof}{', framed below' if contrary else ' where one was found'}."]
    return " ".join([*parts, *found.left_open])


def _paper_row(key: str, article: Paper, found: Reproduction) -> str:
    judged = [j for name in article.scenarios() for j in found.judgements[name]]
    shown = (Verdict.HOLDS, Verdict.FAILS, Verdict.OBSERVED)
    holds, fails, seen = (sum(j.verdict == v for j in judged) for v in shown)
    undecided = len(judged) - holds - fails - seen
    counted = (len(judged), holds, fails, seen, undecided, sum(j.has_expected and j.as_expected for j in judged))
    faults = Counter(row["verdict"] for row in found.errata.get(key, []))
    own = faults[Fault.OWN] + sum(j.claim.origin is Origin.OWN for j in judged)
    cells = (*counted, faults[Fault.FALSE], faults[Fault.MISPRINT], faults[Fault.READING], own)
    counts = "".join(f'<td class="count" data-name="{name}">{n}</td>' for name, n in zip(COUNTED, cells, strict=True))
    return f'<tr><td><a href="#{escape(key)}">{escape(_name(article))}</a></td>{counts}</tr>'


FAILING = {
    Origin.PAPER: "Stated by a paper, and false in its simulations",
    Origin.ASSUMPTION: "Assumed by a paper, and not always true",
    Origin.OWN: "Our own questions, answered no",
}
"""Headings over the claims that fail, by their origin: only the first contradict a paper."""


def _failing(found: Reproduction, papers: dict[str, Paper]) -> str:
    """The claims that fail by origin, each statement once, with links to its scenarios."""
    titles = {name: article.title_of(name) for article in papers.values() for name in article.scenarios()}
    return "".join(_failing_of(found, titles, origin, heading) for origin, heading in FAILING.items())


def _failing_of(found: Reproduction, titles: dict[str, str], origin: Origin, heading: str) -> str:
    places: dict[tuple[str, str], list[tuple[str, Judgement]]] = {}
    for name, judgements in found.judgements.items():
        for j in judgements:
            if j.verdict == Verdict.FAILS and j.claim.origin is origin:
                places.setdefault((j.claim.statement, j.claim.source), []).append((name, j))
    if not places:
        return ""
    items = []
    for (statement, source), where in places.items():
        links = "; ".join(f'<a href="#{escape(place_of(n, j))}">{escape(titles[n])}</a>' for n, j in where)
        shown = f'{set_text(statement)} <span class="dim">{set_text(source, letters=False)}</span>'
        items.append(f"<li>{verdict_words(Verdict.FAILS)} {shown}: {links}</li>")
    return f"<h2>{escape(heading)}</h2>\n<ul>{''.join(items)}</ul>\n"


def _name(article: Paper) -> str:
    return f"{article.short_citation}: {article.title}"


def _paper(key: str, article: Paper, found: Reproduction, out: Path) -> str:
    about = escape(f"{article.authors}. {article.venue}, {article.year}")
    parts = [f'<h2 id="{escape(key)}">{escape(article.title)}</h2>\n<p class="dim">{about}</p>\n']
    drawn = {p.stem.removeprefix("figure-"): p for p in found.figures if p.parent.name == key and p.suffix == ".svg"}
    captions = {str(k): f.caption + seeds_of(f, found.runs) for k, f in article.figures().items()}
    shown: set[str] = set()
    for name in article.scenarios():
        judgements = found.judgements[name]
        seed = f" Seed {found.runs[name].scenario.seed}." if name in found.runs else ""
        figures = {n: (drawn[n], captions[n]) for n in figures_of(article, name) if n in drawn}
        shown |= cited(judgements, figures)
        # Of a scenario that was not drawn the folder may hold pictures of an earlier reproduction.
        pictures = out / key / CLAIMS if name in found.runs else None
        beside = claims_beside_pictures(name, judgements, pictures, figures, seed)
        certificates = certificates_table(found.runs[name]) if name in found.runs else ""
        system = scenario_section(found.runs[name].scenario) if name in found.runs else ""
        heading = f'{escape(article.title_of(name))} <span class="dim">{escape(_counts(judgements))}</span>'
        parts.append(folding(anchor_of(name), heading, f"{system}<h4>Claims</h4>\n{beside}{certificates}"))
    rest = {n: path for n, path in drawn.items() if n not in shown}
    parts.append(folding(f"{key}-figures", "Figures", _figures(captions, rest) or "<p>All are beside claims.</p>"))
    film = _film_of(found, article, out / key)
    if film is not None:
        parts.append(folding(f"{key}-film", "Film", _film(film, article.title_of(next(iter(article.scenarios()))))))
    if margins := margins_table(key):
        parts.append(folding(f"{key}-margins", MARGINS, margins))
    errata = errata_tables(found.errata.get(key, [])) + equation_table(article)
    parts.append(folding(f"{key}-errata", "How its statements are read", errata))
    return "".join(parts)


def _counts(judgements: list[Judgement]) -> str:
    counts = Counter(j.verdict for j in judgements)
    several = {Verdict.HOLDS: "hold", Verdict.FAILS: "fail"}
    words = (f"{n} {verdict if n == 1 else several.get(verdict, str(verdict))}" for verdict, n in counts.items())
    return ", ".join(words)


def _figures(captions: dict[str, str], drawn: dict[str, Path]) -> str:
    """The paper's figures that are beside no claim."""
    cards = [
        card(embedded(drawn[number], "image/svg+xml"), f"Fig. {number}. {caption}")
        for number, caption in captions.items()
        if number in drawn
    ]
    return f'<div class="figures">{"".join(cards)}</div>\n' if cards else ""


def _film(film: Path, title: str) -> str:
    video = film.suffix == ".mp4"
    shown = embedded(film, "video/mp4" if video else "image/gif")
    return f'<div class="figures">{card(shown, f"{title}, in motion.", video=video)}</div>\n'


def _provenance(found: Reproduction, papers: dict[str, Paper]) -> str:
    tried = [j.tried for j in _all(found)] or [0]
    asked = found.seeds or min(tried)
    stated = {
        "papers": ", ".join(papers),
        "command": f"flocking reproduce {' '.join(papers)} --seeds {asked} --first-seed {found.first_seed}",
        "seeds": f"from {found.first_seed} on, {min(tried)} to {max(tried)} a scenario, and those of counter-examples",
        "computing time": f"{found.seconds:.0f} s",
    }
    rows = {
        anchor_of(name): (article.title_of(name), found.runs[name])
        for article in papers.values()
        for name in article.scenarios()
        if name in found.runs
    }
    body = (
        f"{software_facts(stated)}"
        "<p>The table lists the runs that are drawn; their laws and parameters are in their sections. The same call "
        "gives the same numbers.</p>\n" + (runs_table(rows) if rows else "")
    )
    return folding("provenance", "Provenance", body, level=2)
