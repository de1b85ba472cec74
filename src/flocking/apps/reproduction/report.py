"""The report of a reproduction: one self-contained HTML file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from html import escape
from pathlib import Path

from flocking.apps.reproduction.film import film_in
from flocking.apps.reproduction.report_certificates import certificates_table
from flocking.apps.reproduction.report_claims import card, cited, claims_beside_pictures, embedded, place_of
from flocking.apps.reproduction.report_errata import equation_table, errata_tables
from flocking.apps.reproduction.report_formulas import formulas
from flocking.apps.reproduction.report_style import STYLE
from flocking.apps.reproduction.report_tables import head_row, table
from flocking.apps.reproduction.results import Reproduction
from flocking.engine.runs.run import Run
from flocking.engine.storage.atomic_files import write_file
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.potentials.potential import Potential
from flocking.model.terms.pair_terms import Gradient, Term
from flocking.papers.description import Paper
from flocking.papers.equation_table import Fault
from flocking.show.declaration import Figure
from flocking.study.claims.claim import Origin, Verdict
from flocking.study.claims.judgement import Judgement

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
    text = _page(_summary(found, papers) + "".join(sections) + _provenance(found))
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


def _page(body: str) -> str:
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>Flocking control: five papers, reproduced</title>\n<style>{STYLE}</style>\n</head>\n"
        f"<body>\n<main>\n{body}</main>\n</body>\n</html>\n"
    )


def _all(found: Reproduction) -> list[Judgement]:
    return [j for judgements in found.judgements.values() for j in judgements]


def _summary(found: Reproduction, papers: dict[str, Paper]) -> str:
    judged = _all(found)
    counts = Counter(j.verdict for j in judged)
    faults = Counter(row["verdict"] for rows in found.errata.values() for row in rows)
    origins = Counter(j.claim.origin for j in judged)
    numbers = [
        (str(len(judged)), "claims judged"),
        (str(counts[Verdict.HOLDS]), "hold"),
        (str(counts[Verdict.FAILS]), "fail"),
        (str(counts[Verdict.OBSERVED]), "observed, with a rate"),
        (str(len(judged) - sum(counts[v] for v in (Verdict.HOLDS, Verdict.FAILS, Verdict.OBSERVED))), "undecided"),
        (str(origins[Origin.ASSUMPTION]), "of these assumed by a paper"),
        (str(origins[Origin.OWN]), "of these our own questions"),
        (str(faults[Fault.FALSE]), "false statements"),
        (str(faults[Fault.MISPRINT]), "misprints"),
        (str(faults[Fault.READING]), "ambiguities or missing values"),
        (str(faults[Fault.OWN]), "rows of our own"),
        (str(max((j.tried for j in judged), default=0)), "seeds a scenario"),
        (f"{found.seconds:.0f} s", "computing time"),
    ]
    boxes = "".join(f"<div><b>{escape(value)}</b>{escape(name)}</div>" for value, name in numbers)
    rows = "".join(_paper_row(key, article, found) for key, article in papers.items())
    head = head_row("paper", *COUNTED)
    return (
        "<h1>Flocking control: the papers, reproduced</h1>\n"
        f'<p class="dim">What each theorem claims, whether it holds in the simulations, by what margin, and which '
        f'printed statements are wrong.</p>\n<div class="numbers">{boxes}</div>\n<p>{escape(_outcome(judged))}</p>\n'
        f"{table(head, rows)}{_failing(found)}"
    )


def _outcome(judged: list[Judgement]) -> str:
    unexpected = sum(not j.as_expected for j in judged)
    if not unexpected:
        return "Every claim has the verdict that follows from its proof or counter-example; observations have rates."
    untested = sum(j.verdict == Verdict.UNTESTED for j in judged)
    few = f" {untested} are untested: a verdict needs five seeds that meet the hypothesis." if untested else ""
    waiting = sum(j.verdict == Verdict.NOT_YET for j in judged)
    if waiting:
        few += f" {waiting} are not yet decided: for some seed the motion has not settled by the end of the run."
    claims = "1 claim differs" if unexpected == 1 else f"{unexpected} claims differ"
    return f"{claims} from the verdict that follows from its proof or counter-example, framed below.{few}"


def _paper_row(key: str, article: Paper, found: Reproduction) -> str:
    judged = [j for name in article.scenarios() for j in found.judgements[name]]
    shown = (Verdict.HOLDS, Verdict.FAILS, Verdict.OBSERVED)
    holds, fails, seen = (sum(j.verdict == v for j in judged) for v in shown)
    undecided = len(judged) - holds - fails - seen
    counted = (len(judged), holds, fails, seen, undecided, sum(j.as_expected for j in judged))
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


def _failing(found: Reproduction) -> str:
    """The claims that fail by origin, each statement once, with links to its scenarios."""
    return "".join(_failing_of(found, origin, heading) for origin, heading in FAILING.items())


def _failing_of(found: Reproduction, origin: Origin, heading: str) -> str:
    places: dict[tuple[str, str], list[tuple[str, Judgement]]] = {}
    for name, judgements in found.judgements.items():
        for j in judgements:
            if j.verdict == Verdict.FAILS and j.claim.origin is origin:
                places.setdefault((j.claim.statement, j.claim.source), []).append((name, j))
    if not places:
        return ""
    items = []
    for (statement, source), where in places.items():
        links = ", ".join(f'<a href="#{escape(place_of(n, j))}">{escape(n)}</a>' for n, j in where)
        items.append(f'<li>{escape(statement)} <span class="dim">{escape(source)}</span>: {links}</li>')
    return f"<h3>{escape(heading)}</h3>\n<ul>{''.join(items)}</ul>\n"


def _name(article: Paper) -> str:
    return f"{article.authors.split(',')[0].split()[-1]} {article.year}: {article.title}"


def _paper(key: str, article: Paper, found: Reproduction, out: Path) -> str:
    about = escape(f"{article.authors}. {article.venue}, {article.year}")
    parts = [f'<h2 id="{escape(key)}">{escape(article.title)}</h2>\n<p class="dim">{about}</p>\n']
    parts.append(_formulas(found, article))
    drawn = {p.stem.removeprefix("figure-"): p for p in found.figures if p.parent.name == key and p.suffix == ".svg"}
    captions = {str(k): f.caption + seeds_of(f, found.runs) for k, f in article.figures().items()}
    shown: set[str] = set()
    for name in article.scenarios():
        judgements = found.judgements[name]
        seed = f" Seed {found.runs[name].scenario.seed}." if name in found.runs else ""
        figures = {n: (drawn[n], captions[n]) for n in figures_of(article, name) if n in drawn}
        shown |= cited(judgements, figures)
        beside = claims_beside_pictures(name, judgements, out / key / CLAIMS, figures, seed)
        certificates = certificates_table(found.runs[name]) if name in found.runs else ""
        parts.append(f'<h3>{escape(name)}</h3>\n<div class="groups">\n{beside}</div>\n{certificates}')
    filmed = next(iter(article.scenarios())) in found.runs
    rest = {n: path for n, path in drawn.items() if n not in shown}
    parts.append(_figures(captions, rest, film_in(out / key) if filmed else None))
    parts.append(errata_tables(found.errata.get(key, [])))
    parts.append(equation_table(article))
    return "".join(parts)


def _formulas(found: Reproduction, article: Paper) -> str:
    runs = [found.runs[name] for name in article.scenarios() if name in found.runs]
    shown: dict[str, Potential] = {}
    for run in runs:
        for term in run.scenario.law.pair_terms:
            if isinstance(term, Gradient):
                shown.setdefault(term.potential.formula.structure, term.potential)
    return "".join(f'<div class="formula">{formulas(psi)}</div>\n' for psi in shown.values())


def _figures(captions: dict[str, str], drawn: dict[str, Path], film: Path | None) -> str:
    """The paper's figures that are beside no claim, and the film."""
    cards = [
        card(embedded(drawn[number], "image/svg+xml"), f"Fig. {number}. {caption}")
        for number, caption in captions.items()
        if number in drawn
    ]
    if film is not None:
        video = film.suffix == ".mp4"
        shown = embedded(film, "video/mp4" if video else "image/gif")
        cards.append(card(shown, "The first scenario in motion.", video=video))
    return f'<h3>Figures</h3>\n<div class="figures">{"".join(cards)}</div>\n' if cards else ""


def _provenance(found: Reproduction) -> str:
    runs = list(found.runs.values())
    if not runs:
        return ""
    facts = dict(runs[0].provenance)
    for name in ("scenario", "seed", "steps", "tolerance"):
        facts.pop(name, None)
    shown = "".join(f"<dt>{escape(str(k))}</dt><dd>{escape(str(v))}</dd>" for k, v in facts.items())
    rows = "".join(_scenario_row(name, run) for name, run in found.runs.items())
    head = head_row("scenario", "agents", "until", "tolerance", "steps", "switches", "parameters")
    return (
        f'<h2 id="provenance">Provenance</h2>\n<dl>{shown}</dl>\n'
        f"<p>Seeds are {found.first_seed}, {found.first_seed + 1} and so on; the table shows the run that is drawn. "
        "The same call gives the same numbers.</p>\n"
        f'<div class="scroll"><table><thead>{head}</thead><tbody>{rows}</tbody></table></div>\n'
    )


def _scenario_row(name: str, run: Run) -> str:
    law = run.scenario.law
    values = [f"{type(law.graph).__name__} {_plain(law.graph)}"] + [
        f"{type(t).__name__} {_plain(t)}" for t in law.terms
    ]
    return (
        f"<tr><td>{escape(name)}</td><td class='count'>{run.n}</td><td class='count'>{run.scenario.t_end:g}</td>"
        f"<td class='count'>{run.scenario.tolerance:g}</td><td class='count'>{run.provenance.get('steps', '')}</td>"
        f"<td class='count'>{len(run.switches)}</td><td>{escape('; '.join(values))}</td></tr>"
    )


def _plain(part: Graph | Term) -> str:
    values = dict(part.parameters) | {k: getattr(part, k) for k in ("radius", "gap") if hasattr(part, k)}
    return ", ".join(f"{k}={v:g}" if isinstance(v, int | float) else f"{k}=..." for k, v in values.items())
