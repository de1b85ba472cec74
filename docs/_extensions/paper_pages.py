"""Pages of the papers: numbers, laws, claims, readings, counter-examples and equation table."""

from __future__ import annotations

import ast
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import sympy
from text_tables import code, number, plain, table

from flocking.model.law import Scenario
from flocking.model.terms.pair_terms import Gradient
from flocking.papers import ALL_KEYS, paper
from flocking.papers.description import Paper
from flocking.papers.equation_table import Demonstration, Fault, Row
from flocking.papers.numbered import NUMBERED, index


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
    lines.append(f"- energy: {plain(scenario.energy.name)} in the frame of the {plain(scenario.energy.frame)}")
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


def potentials(scenario: Scenario) -> str:
    """The potential of a scenario and the slope derived from it, as formulas."""
    found = [t.potential for t in scenario.law.terms if isinstance(t, Gradient)]
    if not found:
        return ""
    psi = found[0]
    r, formula = psi.symbolic()
    shape = sympy.latex(sympy.piecewise_fold(formula))
    slope = sympy.latex(sympy.piecewise_fold(sympy.diff(formula, r)))
    values = ", ".join(f"{name} = {value:.5g}" for name, value in psi.parameters.items())
    where = f"with {plain(values)}, and its slope as the library derives it\n\n" if values else "and its slope\n\n"
    return f"The potential\n\n$$\\psi(r) = {shape}$$\n\n{where}$$\\psi'(r) = {slope}$$\n\n"


def claim_rows(article: Paper, name: str) -> list[tuple[str, ...]]:
    """One row for each claim about a scenario."""
    return [
        (
            code(c.key), plain(c.source), plain(c.statement),
            plain(c.expected) + (f": {plain(c.reason)}" if c.reason else ""),
        )
        for c in article.claims(name)
    ]  # fmt: skip


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


def erratum_row(row: Row, shown: Demonstration | None) -> tuple[str, ...]:
    """One row of a table of errata."""
    example = ("", "", "") if shown is None else (plain(shown.example), number(shown.printed), number(shown.true))
    return (plain(row.number), plain(row.title), plain(row.reading or row.note), *example)


ERRATUM_HEAD = ("number", "statement", "reading", "example", "as printed", "computed")


def paper_page(key: str) -> str:
    """The page of one paper."""
    article = paper(key)
    system = import_module(f"{article.package}.system")
    rows = list(article.equations())
    about = f"{article.authors}. {article.venue}, {article.year}"
    lines = [f"# {plain(article.title)}\n\n{plain(about)}. Key: {code(key)}.\n\n"]
    folder = article.package.rsplit(".", 1)[1]
    lines.append(f"A run and its picture: {{ref}}`sphx_glr_gallery_plot_{folder}.py`.\n\n")
    lines.append("## Numbers\n\n" + table(("name", "value", "note"), [tuple(map(plain, r)) for r in constants(system)]))
    lines.append("## Scenarios and claims\n\n")
    shown = ""
    for name, make in article.scenarios().items():
        scenario = make(0)
        lines.append(f"### {plain(name)}\n\n" + "\n".join(parts(scenario)) + "\n\n")
        formulas = potentials(scenario)
        if formulas != shown:
            lines.append(formulas)
            shown = formulas
        lines.append(table(("claim", "source", "statement", "expected"), claim_rows(article, name)))
    lines.append("## How it is read\n\n" + errata_sections(rows, 3))
    listed = [
        (plain(r.number), plain(r.kind), plain(" ".join(filter(None, (f"{r.title}.", r.note)))), code(r.home),
         plain(r.verdict()[0]))
        for r in rows
    ]  # fmt: skip
    lines.append("## Equation table\n\n" + table(("number", "kind", "statement", "home", "verdict"), listed))
    if key in NUMBERED:
        numbered = [(plain(n), plain(", ".join(r.number for r in found))) for n, found in index(key).items()]
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
        lines.append(head + errata_sections(list(article.equations()), 3))
    return "".join(lines)
