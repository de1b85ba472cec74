"""Laws and scenarios as HTML: formulas, their parts in words, values and potentials."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape

import numpy as np

from flocking.errors import InvalidInput
from flocking.formula.derivatives import derivative
from flocking.formula.markup.mathml import to_mathml
from flocking.formula.markup.text_formulas import number_latex, set_text
from flocking.formula.safe_digits import time_text
from flocking.model.parts.registration import description_of
from flocking.model.potentials.potential import Potential
from flocking.model.typesetting.documentation import meanings_of, summary_of
from flocking.model.typesetting.law_formulas import law_latex, motion_latex, term_formulas, weight_latex
from flocking.model.typesetting.part_words import value_words
from flocking.model.typesetting.stated import StatedLaw, StatedScenario
from flocking.model.typesetting.symbols import parameter_latex

LISTED_BESIDE = frozenset({"potential", "over"})
"""Fields that are shown elsewhere."""

SIX = 6
"""Digits of times, as pictures and tables of runs have them; a convention."""


def formula_html(latex: str) -> str:
    """A formula in ``latex`` on a line of its own, which scrolls where it is wide; as it is where it cannot be set."""
    try:
        shown = to_mathml(latex, block=True)
    except InvalidInput:
        shown = f"<code>{escape(latex)}</code>"
    return f'<div class="formula" tabindex="0" role="group" aria-label="formula">{shown}</div>'


def part_html(part: object, symbols: tuple[str, ...] = (), numbers: Mapping[str, int] | None = None) -> str:
    """A part in words: its name, what it is, and a table of its values with their meanings.

    Parameters
    ----------
    part
        The part.
    symbols
        Names of its fields that stand in a formula by a symbol.
    numbers
        Numbers of these fields among different ones of a name, where they are not the first.
    """
    kind = description_of(part)
    name = type(part).__name__
    head = f"<p><strong>{escape(name)}</strong>: {set_text(summary_of(part))}</p>"
    if kind is None:
        return head
    meanings, rows = meanings_of(part), []
    for field in kind.fields.values():
        value = getattr(part, field.attribute, None)
        if value is None or field.name in LISTED_BESIDE or isinstance(value, Potential):
            continue
        each = isinstance(value, np.ndarray)
        latex = parameter_latex(field.name, each=each, number=(numbers or {}).get(field.name, 1))
        symbol = to_mathml(latex) if field.name in symbols else ""
        rows.append(
            f"<tr><td>{symbol}</td><th scope='row'>{escape(field.name)}</th><td>{escape(value_words(value))}</td>"
            f"<td>{set_text(meanings.get(field.name, ''))}</td></tr>"
        )
    if not rows:
        return head
    heads = "".join(f"<th scope='col'>{x}</th>" for x in ("symbol", "name", "value", "meaning"))
    return (
        f"{head}<div class='scroll' tabindex='0' role='group' aria-label='{escape(name)}: values'>"
        f"<table class='values'><thead><tr>{heads}</tr></thead>"
        f"<tbody>{''.join(rows)}</tbody></table></div>"
    )


def potentials_of(law: StatedLaw, dimension: int) -> dict[str, tuple[str, Potential]]:
    """The different potentials of a law: the name of each in LaTeX and the potential, by name and values."""
    found: dict[str, tuple[str, Potential]] = {}
    for term in term_formulas(law, dimension):
        for name, psi in term.potentials.items():
            found.setdefault(f"{name} {psi!r}", (name, psi))
    return found


def potential_html(name: str, psi: Potential) -> str:
    """A potential ``psi`` with its name in LaTeX, its slope and its parameters."""
    import sympy

    r, formula = psi.symbolic()
    shape = sympy.latex(sympy.piecewise_fold(formula))
    slope = sympy.latex(sympy.piecewise_fold(derivative(formula, r)))
    values = ", ".join(
        to_mathml(rf"{sympy.latex(sympy.Symbol(k))} = {number_latex(f'{v:.6g}')}") for k, v in psi.parameters.items()
    )
    given = f"<p>with {values}</p>" if values else ""
    return formula_html(f"{name}(r) = {shape}") + formula_html(f"{name}'(r) = {slope}") + given


def law_html(law: StatedLaw, dimension: int = 2) -> str:
    """A law: its formula, its potentials, and each of its parts in words.

    Parameters
    ----------
    law
        The law.
    dimension
        Number of axes.
    """
    shown = "".join(potential_html(name, psi) for name, psi in potentials_of(law, dimension).values())
    return formula_html(law_latex(law, dimension)) + law_legend(law) + shown + parts_html(law, dimension)


def law_legend(law: StatedLaw) -> str:
    """What the symbols of a law are, and what agents must know."""
    i, normal = to_mathml("i"), to_mathml(r"\mathbf{n}_{ij}")
    knows = "Every agent can compute it from what it and its neighbours know."
    if not law.distributed:
        knows = f"An agent must also know: {escape(', '.join(law.beyond_neighbours))}."
    return (
        f"<p>{to_mathml('q_i')} and {to_mathml('p_i')} are position and velocity of agent {i}, {to_mathml('N_i')} its "
        f"neighbours, {to_mathml('r_{ij}')} is the distance of {i} and {to_mathml('j')}, {normal} the unit vector from "
        f"{i} to {to_mathml('j')}. {knows}</p>"
    )


def parts_html(law: StatedLaw, dimension: int) -> str:
    """Graphs and terms of a law in words, with their values.

    Parameters
    ----------
    law
        The law.
    dimension
        Number of axes.
    """
    parts = []
    for number, graph in enumerate(law.graphs):
        weight = weight_latex(graph, number)
        parts.append(part_html(graph, tuple(graph.parameters)) + (formula_html(weight) if weight else ""))
    for term in term_formulas(law, dimension):
        note = "" if term.exact else "<p>Its formula has no short form; its documentation states it.</p>"
        parts.append(part_html(term.term, tuple(term.term.parameters), term.numbers) + note)
    return "".join(parts)


def start_words(scenario: StatedScenario) -> str:
    """How a scenario begins, in a sentence."""
    q, p = scenario.start.q, scenario.start.p
    # Far from the origin, or late, numbers need more digits to differ.
    ends = zip(q.min(axis=0), q.max(axis=0), strict=True)
    box = " × ".join(f"[{time_text(low, low, high)}, {time_text(high, low, high)}]" for low, high in ends)
    first, last = scenario.start.t, scenario.t_end
    begin, end = (time_text(t, first, last, SIX) for t in (first, last))
    speeds = np.linalg.norm(p, axis=1)
    slowest, fastest = f"{speeds.min():.4g}", f"{speeds.max():.4g}"
    moving = "at rest" if not speeds.any() else f"speeds {slowest} to {fastest}"
    if speeds.any() and slowest == fastest:
        moving = f"{'speed' if len(q) == 1 else 'speeds'} {fastest}"
    if scenario.agents.order == 1:
        moving = "without velocities of their own"
    agents = "1 agent" if len(q) == 1 else f"{len(q)} agents"
    dimensions = "1 dimension" if q.shape[1] == 1 else f"{q.shape[1]} dimensions"
    seed = "" if scenario.seed is None else f" Seed {scenario.seed}."
    return f"{agents} in {dimensions}, within {box}, {moving}, from t = {begin} to {end}.{seed}"


def scenario_html(scenario: StatedScenario) -> str:
    """A scenario: its law, its start, what its agents are, and what is not ideal about its world.

    Parameters
    ----------
    scenario
        The scenario.
    """
    start = f"<p><strong>Start</strong>: {escape(start_words(scenario))}</p>"
    return law_html(scenario.law, scenario.start.dimension) + start + world_html(scenario)


def world_html(scenario: StatedScenario) -> str:
    """What the agents of a scenario are, what they know, when they act, and its energy.

    Parameters
    ----------
    scenario
        The scenario.
    """
    moving = "".join(formula_html(latex) for latex in motion_latex(scenario.agents))
    parts = [part_html(scenario.agents, ("masses", "damping")) + moving]
    parts += [part_html(part) for part in (scenario.space, scenario.information, scenario.control)]
    energy = scenario.energy
    unlinked = f"; a pair without a link stores {energy.unlinked:.6g}" if energy.unlinked else ""
    parts.append(
        f"<p><strong>Energy</strong>: {set_text(energy.name)}, in the frame of the {escape(energy.frame)}{unlinked}. "
        f"Error tolerance {scenario.tolerance:g}.</p>"
    )
    return "".join(parts)
