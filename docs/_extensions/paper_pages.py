"""Pages of the papers: laws, claims, numbers, readings, counter-examples and equation table."""

from __future__ import annotations

import ast
import re
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import sympy
from text_tables import code, number, plain, table, typeset

from flocking.formula.safe_digits import rounded_down, rounded_up
from flocking.model.law import Scenario
from flocking.model.typesetting.documentation import summary_of
from flocking.model.typesetting.law_formulas import law_latex, motion_latex
from flocking.model.typesetting.law_html import potentials_of
from flocking.papers import ALL_KEYS, paper
from flocking.papers.description import Paper
from flocking.papers.equation_table import Demonstration, Fault, Row
from flocking.papers.numbered import NUMBERED, index
from flocking.papers.stored_observations import observed_scenarios, stored_observations
from flocking.papers.stored_rates import stored_rates


def constants(module: ModuleType) -> list[tuple[str, str, str]]:
    """Constants of a module with the sentence that stands under each."""
    found = []
    body = ast.parse(Path(str(module.__file__)).read_text()).body
    for k, node in enumerate(body):
        if not isinstance(node, ast.Assign | ast.AnnAssign):
            continue
        after = body[k + 1] if k + 1 < len(body) else None
        note = ""
        if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant):
            note = str(after.value.value)
        targets = node.targets if isinstance(node, ast.Assign) else [node.target]
        names = [n.id for t in targets for n in ast.walk(t) if isinstance(n, ast.Name)]
        for name in names:
            value = getattr(module, name)
            if name.isupper() and not isinstance(value, dict | str) and name != "LAST_FIGURE":
                found.append((name.lower().replace("_", " "), repr_of(value), note))
    return found


def repr_of(value: Any) -> str:
    """A value in one line."""
    if hasattr(value, "tolist"):
        return str(value.tolist())
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def parts(scenario: Scenario) -> list[str]:
    """Lines that say what a scenario is made of."""
    law = scenario.law
    lines = [f"- agents: {scenario.start.n} in {scenario.start.dimension} dimensions, until t = {scenario.t_end:g}"]
    lines.append(f"- graph: {code(type(law.graph).__name__)}{plain(graph_values(law.graph))}")
    lines += [f"- term: {code(type(term).__name__)}{plain(term_values(term))}" for term in law.terms]
    lines.append(f"- energy: {typeset(scenario.energy.name)} in the frame of the {plain(scenario.energy.frame)}")
    knows = "nothing beyond its neighbours" if law.distributed else ", ".join(law.beyond_neighbours)
    lines.append(f"- an agent must know: {plain(knows)}")
    return lines


def graph_values(graph: Any) -> str:
    """Radii of a graph, where it has one value for all."""
    names = [n for n in ("radius", "gap", "onset") if isinstance(getattr(graph, n, None), float)]
    return "".join(f", {n} {getattr(graph, n):.5g}" for n in names)


def term_values(term: Any) -> str:
    """Parameters of a term that are single numbers."""
    values = {k: v for k, v in term.parameters.items() if isinstance(v, int | float)}
    return "".join(f", {name} {value:.5g}" for name, value in values.items())


def formulas(scenario: Scenario) -> str:
    """The law of a scenario, its potentials and the slopes derived from them."""
    dimension = scenario.start.dimension
    parts = [f"$$\n{law_latex(scenario.law, dimension)}\n$$\n\n"]
    for name, psi in potentials_of(scenario.law, dimension).values():
        r, formula = psi.symbolic()
        shape = sympy.latex(sympy.piecewise_fold(formula))
        slope = sympy.latex(sympy.piecewise_fold(sympy.diff(formula, r)))
        values = ", ".join(f"${sympy.latex(sympy.Symbol(k))} = {value:.5g}$" for k, value in psi.parameters.items())
        where = f"with {values}, and its slope as the library derives it" if values else "and its slope"
        parts.append(f"The potential\n\n$$\n{name}(r) = {shape}\n$$\n\n{where}\n\n$$\n{name}'(r) = {slope}\n$$\n\n")
    return "".join(parts)


SYMBOLS = (
    "$q_i$ and $p_i$ are position and velocity of agent $i$, $N_i$ its neighbours, $r_{ij}$ is the distance of $i$ and "
    "$j$, $\\mathbf{n}_{ij}$ the unit vector from $i$ to $j$."
)


def law_section(scenario: Scenario) -> str:
    """The law in symbols and in words."""
    law = scenario.law
    words = [f"- {code(type(part).__name__)}: {typeset(summary_of(part))}" for part in (law.graph, *law.terms)]
    moving = [f"$$\n{latex}\n$$\n\n" for latex in motion_latex(scenario.agents)]
    return "".join([formulas(scenario), f"{SYMBOLS}\n\n", "\n".join(words), "\n\n", *moving])


def claim_rows(article: Paper, name: str) -> list[tuple[str, ...]]:
    """One row for each claim about a scenario: what is expected, and what ten seeds gave."""
    rates = stored_rates(name)
    return [
        (
            code(c.key), typeset(c.source, letters=False), typeset(c.statement),
            plain(c.expectation) + (f": {typeset(c.reason)}" if c.reason else ""),
            plain(rates[c.key].text) if c.key in rates else "",
        )
        for c in article.claims(name)
    ]  # fmt: skip


MEASURED = (
    "*Measured* are ten seeds, run by run, or more until five meet the hypotheses; of one scenario nine, for one run "
    "ends early, see {doc}`/two_papers` (`make rates` computes them again). Seeds that do not meet a hypothesis, or "
    "whose run leaves a claim open, decide nothing. A claim that rests on a proof or a "
    "counter-example has an expected verdict; one that rests on neither is "
    "an observation, whose rate among the seeds that decide it is given with its 95 % interval (Clopper and "
    "Pearson).\n\n"
)

FURTHER_PAGES = {
    "olfati-saber-2003": ("two_papers",),
    "olfati-saber-2006": ("two_papers",),
    "vicsek-1995": ("large_groups",),
    "reynolds-1987": ("released_programs",),
    "vasarhelyi-2018": ("released_programs",),
}
"""Pages about one paper beside its own."""


def further(key: str) -> str:
    """A sentence with links to further pages about a paper; empty where there are none."""
    links = ", ".join(f"{{doc}}`/{page}`" for page in FURTHER_PAGES.get(key, ()))
    return f" See also {links}." if links else ""


def observed_section(key: str) -> str:
    """Means of what is observed over seeds, with intervals; empty for papers of which nothing is stored."""
    rows = []
    for name in observed_scenarios(key):
        found = stored_observations(name)
        for quantity in found.values:
            interval = found.interval(quantity)
            reach = (
                interval.method
                if np.isnan(interval.low)
                else f"{rounded_down(interval.low, 4)} to {rounded_up(interval.high, 4)}"
            )
            rows.append((code(name), plain(quantity), plain(f"{found.mean(quantity):.4g}"), plain(reach)))
    if not rows:
        return ""
    about = summary_of(import_module(f"{paper(key).package}.observations").quantities)
    return f"## What is observed\n\n{typeset(about, letters=False)} Means over ten seeds.\n\n" + table(
        ("scenario", "quantity", "mean", "95 % interval of the mean"), rows
    )


FAULTS = {
    Fault.FALSE: "False statements",
    Fault.MISPRINT: "Misprints",
    Fault.READING: "Ambiguities and missing values",
    Fault.OWN: "Not printed: questions of our own",
}


def errata_sections(rows: list[Row], level: int) -> str:
    """A table for each kind of fault; counter-examples are computed now."""
    parts = []
    for fault, heading in FAULTS.items():
        found = [erratum_row(row, shown) for row in rows for verdict, shown in [row.verdict()] if verdict is fault]
        if found:
            parts.append(f"{'#' * level} {heading} ({len(found)})\n\n" + table(ERRATUM_HEAD, found))
    return "".join(parts)


def departures_section(key: str, rows: list[Row], level: int) -> str:
    """Where a released program departs from the statements of its paper, from the notes of the equation table."""
    if "released_programs" not in FURTHER_PAGES.get(key, ()):
        return ""
    found = [
        (typeset(row.number, letters=False), typeset(row.title), typeset(row.note))
        for row in rows
        if re.search(r"\b(program|library)\b", row.note)
    ]
    head = f"{'#' * level} Where the released program departs ({len(found)})\n\n"
    return head + "More of it on {doc}`/released_programs`.\n\n" + table(("number", "statement", "note"), found)


def figures_section(article: Paper) -> str:
    """Captions of the figures with what is seen in them, for papers where that is stated."""
    figures = list(article.figures().values())
    if not any(figure.seen for figure in figures):
        return ""
    rows = [(plain(x.number), typeset(x.caption, letters=False), typeset(x.seen, letters=False)) for x in figures]
    return (
        "## Figures\n\n`flocking reproduce` draws them. The printed figures were not at hand: what is seen is held "
        "against what is commonly said of the paper.\n\n" + table(("number", "caption", "what is seen"), rows)
    )


def erratum_row(row: Row, shown: Demonstration | None) -> tuple[str, ...]:
    """One row of a table of errata."""
    example = ("", "", "") if shown is None else (typeset(shown.example), number(shown.printed), number(shown.true))
    return (typeset(row.number, letters=False), typeset(row.title), typeset(row.reading or row.note), *example)


ERRATUM_HEAD = ("number", "statement", "reading", "example", "as printed", "computed")


def paper_page(key: str) -> str:
    """The page of one paper."""
    article = paper(key)
    system = import_module(f"{article.package}.system")
    rows = list(article.equations())
    about = f"{article.authors}. {article.venue}, {article.year}"
    lines = [f"# {plain(article.title)}\n\n{plain(about)}. Key: {code(key)}.\n\n"]
    folder = article.package.rsplit(".", 1)[1]
    lines.append(f"A run and its picture: {{ref}}`sphx_glr_gallery_plot_{folder}.py`.{further(key)}\n\n")
    first = next(iter(article.scenarios().values()))(0)
    lines.append(f"## The law\n\n{law_section(first)}## Scenarios and claims\n\n")
    lines.append(MEASURED if stored_rates(first.name) else "")
    shown = formulas(first)
    for name, make in article.scenarios().items():
        scenario = make(0)
        title = article.title_of(name)
        lines.append(f"### {typeset(title)}\n\n" + (f"Key: {code(name)}.\n\n" if title != name else ""))
        lines.append("\n".join(parts(scenario)) + "\n\n")
        if formulas(scenario) != shown:
            shown = formulas(scenario)
            lines.append(shown)
        lines.append(table(("claim", "source", "statement", "expected", "measured"), claim_rows(article, name)))
    lines.append(observed_section(key) + figures_section(article))
    known = [(plain(n), plain(value), typeset(note)) for n, value, note in constants(system)]
    lines.append("## Numbers\n\n" + table(("name", "value", "note"), known))
    lines.append("## How it is read\n\n" + errata_sections(rows, 3) + departures_section(key, rows, 3))
    listed = []
    for row in rows:
        statement = " ".join(filter(None, (f"{row.title}.", row.note)))
        place = typeset(row.number, letters=False)
        listed.append((place, plain(row.kind), typeset(statement), code(row.home), plain(row.verdict()[0])))
    lines.append("## Equation table\n\n" + table(("number", "kind", "statement", "home", "verdict"), listed))
    if key in NUMBERED:
        numbered = [
            (plain(n), typeset(", ".join(r.number for r in found), letters=False)) for n, found in index(key).items()
        ]
        lines.append("## Numbered statements of the text\n\n" + table(("number", "rows of the table"), numbered))
    return "".join(lines)


def errata_page() -> str:
    """All counter-examples of all papers."""
    lines = [
        "# Errata of the papers\n\nFour kinds are kept apart. A *false statement* is refuted by a counter-example "
        "under every sensible reading. A *misprint* has one sensible reading, under which the paper's argument stands; "
        "where a counter-example to the printed form helps, it is shown. An *ambiguity or missing value* is a choice "
        "that the paper leaves open. What is *not printed* is a question of our own.\n\n"
        "Both sides of every counter-example were computed when this page was built.\n\n"
    ]
    for key in ALL_KEYS:
        article = paper(key)
        head = f"## {plain(article.title)} ({article.year})\n\n"
        rows = list(article.equations())
        lines.append(head + errata_sections(rows, 3) + departures_section(key, rows, 3))
    return "".join(lines)
