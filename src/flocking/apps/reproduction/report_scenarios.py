"""The law of a scenario and its parts in reports."""

from __future__ import annotations

from html import escape

from flocking.apps.reproduction.report_page import more
from flocking.model.law import Scenario
from flocking.model.typesetting.law_formulas import law_latex
from flocking.model.typesetting.law_html import (
    formula_html,
    law_legend,
    parts_html,
    potential_html,
    potentials_of,
    start_words,
    world_html,
)


def scenario_section(scenario: Scenario) -> str:
    """A law in symbols with its potentials, its start, and, folded, every part in words with its values.

    Parameters
    ----------
    scenario
        The scenario.
    """
    law, dimension = scenario.law, scenario.start.dimension
    shown = "".join(potential_html(name, psi) for name, psi in potentials_of(law, dimension).values())
    return (
        f"{formula_html(law_latex(law, dimension))}{law_legend(law)}{shown}"
        f"<p><strong>Start</strong>: {escape(start_words(scenario))}</p>\n"
        + more(
            "Parts of the law, their values, the agents and their world",
            parts_html(law, dimension) + world_html(scenario),
        )
    )
