"""How laws and scenarios are represented in a line, and displayed in notebooks."""

from __future__ import annotations

from flocking.formula.markup.cells import folded
from flocking.formula.safe_digits import time_text
from flocking.model.typesetting.law_formulas import law_latex
from flocking.model.typesetting.law_html import SIX, formula_html, law_html, scenario_html, start_words
from flocking.model.typesetting.stated import StatedLaw, StatedScenario

LONGEST = 160
"""Characters of a part in the line that represents a law or a scenario; longer ones are cut."""


def _short(part: object) -> str:
    text = " ".join(repr(part).split())
    return text if len(text) <= LONGEST else f"{type(part).__name__}(...)"


def law_line(law: StatedLaw) -> str:
    """A law in one line, without arrays."""
    return f"Law({_short(law.graph)}, [{', '.join(map(_short, law.terms))}])"


def law_cell(law: StatedLaw) -> str:
    """A law in a notebook: the formula, and folded its parts."""
    return formula_html(law_latex(law)) + folded("The parts of the law", law_html(law))


def scenario_line(scenario: StatedScenario) -> str:
    """A scenario in one line, without arrays."""
    imperfections = scenario.imperfections
    name, start = f"{scenario.name!r}, " if scenario.name else "", scenario.start
    begin, end = (time_text(t, start.t, scenario.t_end, SIX) for t in (start.t, scenario.t_end))
    size = f"{start.n} agents in {start.dimension} dimensions, t = {begin} to {end}"
    return f"<Scenario {name}{size}, {law_line(scenario.law)}{f', {imperfections}' if imperfections else ''}>"


def scenario_cell(scenario: StatedScenario) -> str:
    """A scenario in a notebook: its formula, how it begins, and folded everything it is made of."""
    shown = formula_html(law_latex(scenario.law, scenario.start.dimension))
    return shown + folded(f"{scenario.name or 'Scenario'}: {start_words(scenario)}", scenario_html(scenario))


class LawCell:
    """Base of a law: its line, and its display in notebooks."""

    def __repr__(self: StatedLaw) -> str:
        return law_line(self)

    def _repr_html_(self: StatedLaw) -> str:
        return law_cell(self)


class ScenarioCell:
    """Base of a scenario: its line, and its display in notebooks."""

    def __repr__(self: StatedScenario) -> str:
        return scenario_line(self)

    def _repr_html_(self: StatedScenario) -> str:
        return scenario_cell(self)
