"""The report of a reproduction: one HTML file that needs nothing else and no network."""

from __future__ import annotations

import base64
from collections import Counter
from collections.abc import Iterable
from html import escape
from pathlib import Path
from types import ModuleType
from typing import Any

from flocking.apps.film import FILM
from flocking.apps.findings import Reproduction
from flocking.apps.report_style import STYLE
from flocking.apps.tables import short
from flocking.engine.run import Run
from flocking.model.potentials import Potential
from flocking.model.terms import Gradient
from flocking.study.audit import Judgement


def write_report(found: Reproduction, modules: dict[str, ModuleType], out: Path) -> Path:
    """Write ``report.html``; figures and films are read from the folder.

    Parameters
    ----------
    found
        What the reproduction found.
    modules
        The papers, by key.
    out
        Folder that holds the figures and films, to write to.

    Returns
    -------
    Path
        The report.
    """
    sections = []
    for key, module in modules.items():
        film = out / key / FILM
        filmed = next(iter(module.scenarios())) in found.runs and film.exists()
        sections.append(_paper(key, module, found, film if filmed else None))
    text = _page(_summary(found, modules) + "".join(sections) + _provenance(found))
    path = out / "report.html"
    path.write_text(text, encoding="utf-8")
    return path


def _page(body: str) -> str:
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>Flocking control: five papers, reproduced</title>\n<style>{STYLE}</style>\n</head>\n"
        f"<body>\n<main>\n{body}</main>\n</body>\n</html>\n"
    )


def _all(found: Reproduction) -> list[Judgement]:
    return [j for judgements in found.judgements.values() for j in judgements]


def _summary(found: Reproduction, modules: dict[str, ModuleType]) -> str:
    judged = _all(found)
    counts = Counter(str(j.verdict) for j in judged)
    odd = [j for j in judged if not j.as_expected]
    seeds = max((j.tried for j in judged), default=0)
    refuted = sum(len(rows) for rows in found.errata.values())
    numbers = [
        (str(len(judged)), "claims judged"),
        (str(counts["holds"]), "hold"),
        (str(counts["fails"]), "fail"),
        (str(refuted), "printed statements refuted"),
        (str(seeds), "seeds a scenario"),
        (f"{found.seconds:.0f} s", "computing time"),
    ]
    boxes = "".join(f"<div><b>{escape(value)}</b>{escape(name)}</div>" for value, name in numbers)
    verdict = (
        "Every claim came out as fixed before the runs."
        if not odd
        else f"{len(odd)} claims came out other than fixed before the runs; they are framed below."
    )
    links = "".join(f'<a href="#{escape(key)}">{escape(_name(module))}</a>' for key, module in modules.items())
    return (
        "<h1>Flocking control: the papers, reproduced</h1>\n"
        f'<p class="dim">What each theorem claims, whether it holds in its own simulations, by what margin, and where '
        f'the papers err.</p>\n<div class="numbers">{boxes}</div>\n<p>{escape(verdict)}</p>\n<nav>{links}</nav>\n'
    )


def _name(module: ModuleType) -> str:
    return f"{module.AUTHORS.split(',')[0].split()[-1]} {module.YEAR}: {module.TITLE}"


def _paper(key: str, module: ModuleType, found: Reproduction, film: Path | None) -> str:
    about = f"{escape(module.AUTHORS)}, {module.YEAR}"
    parts = [f'<h2 id="{escape(key)}">{escape(module.TITLE)}</h2>\n<p class="dim">{about}</p>\n']
    parts.append(_formulas(found, module))
    for name in module.scenarios():
        parts.append(f"<h3>{escape(name)}</h3>\n{_claims(found.judgements[name])}")
    parts.append("<h3>Figures</h3>\n" + _figures(key, module, found.figures, film))
    parts.append(_errata(found.errata.get(key, [])))
    parts.append(_equations(module))
    return "".join(parts)


def _formulas(found: Reproduction, module: ModuleType) -> str:
    runs = [found.runs[name] for name in module.scenarios() if name in found.runs]
    shown: dict[str, Potential] = {}
    for run in runs:
        for term in run.scenario.law.pair_terms:
            if isinstance(term, Gradient):
                shown.setdefault(term.potential.formula.structure, term.potential)
    return "".join(f'<div class="formula">{mathml(psi)}</div>\n' for psi in shown.values())


def mathml(potential: Potential) -> str:
    """A potential and its slope as MathML, which browsers typeset by themselves.

    Parameters
    ----------
    potential
        The potential.
    """
    import sympy
    from sympy.printing.mathml import mathml as print_mathml

    r, psi = potential.symbolic()
    value, slope = (print_mathml(e, printer="presentation") for e in (psi, sympy.diff(psi, r)))
    name = "<mi>&#968;</mi><mo>(</mo><mi>r</mi><mo>)</mo>"
    prime = "<msup><mi>&#968;</mi><mo>&#8242;</mo></msup><mo>(</mo><mi>r</mi><mo>)</mo>"
    return (
        f'<math display="block"><mrow>{name}<mo>=</mo>{value}</mrow></math>'
        f'<math display="block"><mrow>{prime}<mo>=</mo>{slope}</mrow></math>'
    )


def _table(head: str, rows: Iterable[str]) -> str:
    body = "".join(rows)
    return f'<div class="scroll"><table class="claims"><thead>{head}</thead><tbody>{body}</tbody></table></div>\n'


def _head(*names: str) -> str:
    return "<tr>" + "".join(f"<th>{name}</th>" for name in names) + "</tr>"


def _claims(judgements: Iterable[Judgement]) -> str:
    head = _head("verdict", "claim", "source", "held / met / tried", "worst margin", "measured")
    rows = []
    for j in judgements:
        kind = str(j.verdict) if str(j.verdict) in ("holds", "fails") else "other"
        frame = "" if j.as_expected else "odd"
        expected = "" if j.as_expected else f'<br><span class="dim">expected: {escape(str(j.claim.expected))}</span>'
        reason = f'<br><span class="dim">{escape(j.claim.reason)}</span>' if j.claim.reason else ""
        rows.append(
            f'<tr><td class="verdict {kind}"><span class="{frame}">{escape(str(j.verdict))}</span>{expected}</td>'
            f"<td>{escape(j.claim.statement)}{reason}</td>"
            f'<td data-name="source">{escape(j.claim.source)}</td>'
            f'<td class="count" data-name="held / met / tried">{j.held} / {j.met} / {j.tried}</td>'
            f'<td class="count" data-name="worst margin">{escape(short(j.worst.margin))}</td>'
            f'<td data-name="measured">{escape(j.worst.note)}</td></tr>'
        )
    return (
        f'<div class="scroll"><table class="claims"><thead>{head}</thead><tbody>{"".join(rows)}</tbody></table></div>\n'
    )


def _figures(key: str, module: ModuleType, drawn: Iterable[Path], film: Path | None) -> str:
    captions = {f"figure-{number}": (number, f.caption) for number, f in module.figures().items()}
    cards = []
    for path in drawn:
        if path.parent.name != key or path.suffix != ".svg" or path.stem not in captions:
            continue
        number, caption = captions[path.stem]
        cards.append(_card(_embedded(path, "image/svg+xml"), f"Fig. {number}. {caption}"))
    if film is not None:
        kind = "image/gif" if film.suffix == ".gif" else "video/mp4"
        cards.append(_card(_embedded(film, kind), "The first scenario in motion.", video=kind.startswith("video")))
    return f'<div class="figures">{"".join(cards)}</div>\n'


def _embedded(path: Path, kind: str) -> str:
    return f"data:{kind};base64,{base64.b64encode(path.read_bytes()).decode()}"


def _card(source: str, caption: str, *, video: bool = False) -> str:
    text = escape(caption)
    shown = f'<video src="{source}" controls loop muted></video>' if video else f'<img src="{source}" alt="{text}">'
    return f"<figure>{shown}<figcaption>{text}</figcaption></figure>"


def _errata(rows: list[dict[str, Any]]) -> str:
    if not rows:
        return ""
    items = []
    for row in rows:
        shown = row["demonstration"] or {}
        printed, true = (_number(shown.get(k)) for k in ("printed", "true"))
        items.append(
            f'<tr><td class="verdict {"wrong" if shown else "other"}">{escape(row["number"])}</td>'
            f"<td>{escape(row['title'])}"
            + (f'<br><span class="dim">{escape(row["reason"])}</span>' if row["reason"] else "")
            + f'</td><td class="count" data-name="printed">{printed}</td><td class="count" data-name="true">{true}</td>'
            f"<td>{escape(str(shown.get('example', '')))}</td></tr>"
        )
    head = _head("where", "what", "printed", "true", "example")
    return "<h3>Errata, each with a computed counter-example</h3>\n" + _table(head, items)


def _number(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, int | float) else escape(str(value))


def _equations(module: ModuleType) -> str:
    rows = [row.as_dict() for row in module.equations()]
    counts = Counter(row["verdict"] for row in rows)
    body = "".join(
        f"<tr><td>{escape(r['number'])}</td><td>{escape(r['title'])}</td><td>{escape(r['verdict'])}</td>"
        f"<td><code>{escape(r['home'].removeprefix('flocking.'))}</code></td></tr>"
        for r in rows
    )
    told = ", ".join(f"{count} {verdict}" for verdict, count in sorted(counts.items()))
    return (
        f"<details><summary>Equation table: {len(rows)} rows ({escape(told)})</summary>"
        f"<div class='scroll'><table><thead>{_head('number', 'statement', 'verdict', 'home')}</thead>"
        f"<tbody>{body}</tbody></table></div></details>\n"
    )


def _provenance(found: Reproduction) -> str:
    runs = list(found.runs.values())
    if not runs:
        return ""
    facts = dict(runs[0].provenance)
    for name in ("scenario", "seed", "steps", "tolerance"):
        facts.pop(name, None)
    shown = "".join(f"<dt>{escape(str(k))}</dt><dd>{escape(str(v))}</dd>" for k, v in facts.items())
    rows = "".join(_scenario_row(name, run) for name, run in found.runs.items())
    head = _head("scenario", "agents", "until", "tolerance", "steps", "switches", "parameters")
    return (
        f'<h2 id="provenance">Where the numbers come from</h2>\n<dl>{shown}</dl>\n'
        "<p>Seeds are 0, 1, 2 and so on; the row shows seed 0. The same call gives the same numbers.</p>\n"
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


def _plain(part: Any) -> str:
    values = dict(part.parameters) | {k: getattr(part, k) for k in ("radius", "gap") if hasattr(part, k)}
    return ", ".join(f"{k}={v:g}" if isinstance(v, int | float) else f"{k}=..." for k, v in values.items())
