"""The law as a page shows it: its formula, its potentials, and a control for every parameter."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from flocking.apps.lab.experiment.events import Event
from flocking.apps.lab.experiment.potential_ranges import check_quickly, check_range, curves, reach_of
from flocking.apps.lab.experiment.settings import Section, Setting, sections
from flocking.errors import FlockingError, InvalidInput
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.law import Scenario
from flocking.model.parts.structure import Step, changed, children, value_at
from flocking.model.potentials.potential import Potential
from flocking.model.state import State
from flocking.model.terms.avoidance import ObstacleTerm
from flocking.model.typesetting.law_formulas import law_latex
from flocking.model.typesetting.law_html import formula_html, law_legend
from flocking.study.potentials.potential_check import check_potential

STEPS = 200
"""Steps of a slider from end to end, rounded to a power of ten."""
LONGEST_FORMULA = 2000
"""Characters of a formula that is checked while it is typed."""


@dataclass(frozen=True)
class PlacedPotential:
    """A potential in a law.

    Parameters
    ----------
    path
        Where it is in the scenario.
    potential
        The potential.
    graph
        The graph over which its term acts.
    pairs
        Whether it is of pairs of agents; else its distances are those from obstacles, which have nothing to do with the
        radius of a graph.
    """

    path: tuple[Step, ...]
    potential: Potential
    graph: Graph
    pairs: bool = True


def potentials(scenario: Scenario) -> list[PlacedPotential]:
    """The potentials of the terms of a scenario's law."""
    law = scenario.law
    return [
        PlacedPotential(
            ("law", "terms", k, step),
            child,
            getattr(term, "over", None) or law.graph,
            not isinstance(term, ObstacleTerm),
        )
        for k, term in enumerate(law.terms)
        for step, child in children(term).items()
        if isinstance(child, Potential)
    ]


def law_content(scenario: Scenario, state: State, base: Scenario) -> dict[str, object]:
    """The law of a scenario as JSON data: formula, controls, and curves of the potentials.

    Parameters
    ----------
    state
        The present state.
    base
        The scenario that factors multiply.
    """
    try:
        formula = formula_html(law_latex(scenario.law, state.dimension))
    except FlockingError as error:
        formula = f"<p>{error}</p>"
    placed = potentials(scenario)
    return {
        "kind": "law", "formula": formula, "legend": law_legend(scenario.law),
        "sections": [_section(section) for section in sections(scenario, base)],
        "potentials": [_potential(each, state) for each in placed],
    }  # fmt: skip


def _potential(each: PlacedPotential, state: State) -> dict[str, object]:
    reach = reach_of(each.graph, state)
    return {
        "path": list(each.path), "formula": each.potential.formula.text, "reach": reach, "pairs": each.pairs,
        "parameters": dict(each.potential.parameters), "curves": curves(each.potential, reach),
    }  # fmt: skip


def _section(section: Section) -> dict[str, object]:
    return {
        "title": section.title, "removal": section.removal,
        "settings": [_setting(each) for each in section.settings],
    }  # fmt: skip


def _setting(setting: Setting) -> dict[str, object]:
    found: dict[str, object] = {
        "path": list(setting.path), "kind": setting.kind, "label": setting.label, "value": setting.value,
        "choices": list(setting.choices),
    }  # fmt: skip
    if setting.kind in ("number", "factor"):
        step = 10.0 ** math.floor(math.log10((setting.high - setting.low) / STEPS))
        found |= {"low": setting.low, "high": setting.high, "step": step}
    return found


def values_of(scenario: Scenario, base: Scenario) -> Iterator[tuple[list[Step], Any]]:
    """Paths and values of all settings: what the controls must show after a change, or after one that was refused.

    Parameters
    ----------
    scenario, base
        The scenario, and the one that factors multiply.
    """
    for section in sections(scenario, base):
        for setting in section.settings:
            yield list(setting.path), setting.value


def tried(scenario: Scenario, state: State, path: Sequence[Step], text: str) -> dict[str, object]:
    """What a formula at ``path`` would be: its curves, its properties, and why it is refused, if it is.

    Parameters
    ----------
    scenario
        The scenario, which does not change.
    state
        The present state.
    text
        The formula.

    Raises
    ------
    InvalidInput
        When there is no potential at that path, or the formula is refused.
    """
    if len(text) > LONGEST_FORMULA:
        raise InvalidInput("lab", "formula", f"must have at most {LONGEST_FORMULA} characters", len(text))
    other = changed(scenario, (*path, "formula"), text)
    each = next((x for x in potentials(other) if list(x.path) == list(path)), None)
    if each is None:
        raise InvalidInput("lab", "path", "must lead to a potential", list(path))
    reach = reach_of(each.graph, state)
    check_quickly(each.potential, reach)
    return {"parameters": dict(each.potential.parameters), "reach": reach, "curves": curves(each.potential, reach)}


def properties(scenario: Scenario, path: Sequence[Step]) -> list[dict[str, object]]:
    """Properties of the potential at ``path``, by name.

    Parameters
    ----------
    scenario
        The scenario.
    """
    each = next((x for x in potentials(scenario) if list(x.path) == list(path)), None)
    if each is None:
        return []
    radius = float(np.max(np.asarray(each.graph.break_radius)))
    # Where all distances are linked there is no radius: the reach of the curves is none.
    report = check_potential(each.potential, radius=radius if each.pairs and np.isfinite(radius) else None)
    return [{"name": row.name, "holds": row.holds, "explanation": row.explanation} for row in report.rows]


class Controls:
    """Changes of the law that a page requests.

    Parameters
    ----------
    scenario
        Gives the present scenario.
    state
        Gives the present state.
    send
        Sends an event; of those with the same key only the last counts.
    """

    def __init__(
        self, scenario: Callable[[], Scenario], state: Callable[[], State], send: Callable[[Event, object], None]
    ) -> None:
        self._scenario, self._state, self._send = scenario, state, send

    def move(self, path: Sequence[Step], value: object, *, factor: bool = False) -> None:
        """Set the value at a path.

        Parameters
        ----------
        path
            Where it is in the scenario.
        value
            The value.
        factor
            Whether the values there are multiplied by it.

        Raises
        ------
        InvalidInput
            When it would make a potential infinite where pairs are linked.
        """
        if not factor:
            self._check(path, value)
        kind = "scale" if factor else "set"
        self._send({"kind": kind, "path": list(path), "value": value}, (kind, *path))

    def _check(self, path: Sequence[Step], value: object) -> None:
        scenario = self._scenario()
        for each in potentials(scenario):
            if list(path[: len(each.path)]) == list(each.path):
                other = changed(scenario, path, value)
                psi = value_at(other, each.path)
                if isinstance(psi, Potential):
                    check = check_range if path[-1] == "formula" else check_quickly
                    check(psi, reach_of(each.graph, self._state()))
