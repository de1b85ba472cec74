"""The first view: scenarios grouped by paper, with their titles, and pictures of how they begin."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from flocking.apps.lab.access.confinement import Folder
from flocking.apps.lab.experiment.challenges import CHALLENGE, CHALLENGES, challenge_of
from flocking.apps.lab.panels.choices import LARGER_GROUPS, library
from flocking.apps.lab.panels.measures import MOST_CLAIMS
from flocking.apps.lab.scene.solids import solids
from flocking.apps.scenario_names import paper_scenarios
from flocking.formula.safe_digits import time_text
from flocking.model.law import Scenario
from flocking.papers import keys, paper

MOST_POINTS = 150
"""Agents of a small picture: more would hide each other."""

GROUP_TITLES = {
    "group-1000": "1,000 agents in the plane", "group-10000": "10,000 agents in the plane",
    "group-100000": "100,000 agents in the plane", "group-1000-3d": "1,000 agents in space",
}  # fmt: skip
"""Titles of the larger groups."""


def catalogue(folder: Folder) -> dict[str, object]:
    """All scenarios that a page offers, as JSON data.

    Parameters
    ----------
    folder
        The folder of the user's files.
    """
    groups: list[dict[str, object]] = []
    for key in keys():
        found = paper(key)
        names = list(found.scenarios())
        title = found.titles.get(names[0], names[0])
        groups.append(
            {
                "title": found.short_citation,
                "about": found.title,
                "first": title,
                "scenarios": [
                    {"name": name, "title": found.title_of(name), "question": found.question_of(name)} for name in names
                ],
            }
        )
    groups.append(
        {
            "title": "Larger groups",
            "about": "A bounded spring and velocity consensus over links with hysteresis",
            "scenarios": [{"name": name, "title": GROUP_TITLES.get(name, name)} for name in LARGER_GROUPS],
        }
    )
    built_in = {*paper_scenarios(), *LARGER_GROUPS}
    files = [name for name in library(folder) if name not in built_in]
    if files:
        groups.append(
            {"title": "Your files", "about": "In the folder of this lab",
             "scenarios": [{"name": name, "title": name} for name in files]}
        )  # fmt: skip
    return {"kind": "catalogue", "groups": groups, "challenges": challenges()}


def challenges() -> list[dict[str, str]]:
    """Key, title and goal of each challenge."""
    return [{"key": key, "title": x.title, "goal": x.goal} for key, x in CHALLENGES.items()]


def about(name: str, scenario: Scenario) -> dict[str, str]:
    """Title, question, paper and size of an open scenario, each a text that may be empty.

    Parameters
    ----------
    name
        The name that it was opened by.
    scenario
        The scenario.
    """
    known = paper_scenarios().get(name)
    n = scenario.start.n
    end = time_text(scenario.t_end, scenario.start.t, scenario.t_end, 6)
    size = f"{n} agent{'s' if n != 1 else ''} in {scenario.start.dimension} dimensions, until t = {end}"
    if name.startswith(CHALLENGE):
        found = challenge_of(name.removeprefix(CHALLENGE))
        return {"title": found.title, "question": found.goal, "paper": "", "citation": "", "size": size}
    if known is None:
        title = GROUP_TITLES.get(name, scenario.name or name)
        return {"title": title, "question": _own_question(scenario), "paper": "", "citation": "", "size": size}
    source = paper(known[0])
    return {
        "title": source.title_of(name), "question": source.question_of(name),
        "paper": f"{source.short_citation}: {source.title}", "citation": source.citation, "size": size,
    }  # fmt: skip


def _own_question(scenario: Scenario) -> str:
    """A question about any law, made of what the lab judges of this one; empty where it judges none of it."""
    judged = scenario.start.n <= MOST_CLAIMS and not scenario.imperfections
    asked = {
        "do velocities agree": scenario.agents.order == 2 and not scenario.agents.discrete,
        "does the group stay connected": scenario.law.graph.moves,
        "do no two agents meet": True,
    }
    parts = [part for part, applies in asked.items() if applies]
    if not judged or scenario.start.n < 2:
        return ""
    words = f"{', '.join(parts[:-1])} and {parts[-1]}" if len(parts) > 1 else parts[0]
    return f"{words[0].upper()}{words[1:]}?"


def small_picture(scenario: Scenario) -> dict[str, object]:
    """Positions, velocities, links and obstacles of a start, for a small picture.

    Parameters
    ----------
    scenario
        The scenario.
    """
    start = scenario.start
    some = np.unique(np.linspace(0, start.n - 1, min(start.n, MOST_POINTS)).astype(int))
    q = start.q if scenario.space.is_open else scenario.space.wrapped(start.q)
    return {
        "n": start.n, "d": start.dimension, "open": scenario.space.is_open,
        "q": _rounded(q[some, :2]), "p": _rounded(start.p[some, :2]),
        "obstacles": [
            _rounded((x.outline + x.position)[:, :2]) for x in solids(scenario, start.t) if len(x.outline)
        ],
    }  # fmt: skip


def _rounded(values: Iterable[object]) -> list[list[float]]:
    table = np.asarray(values, dtype=np.float64)
    if table.ndim == 2 and table.shape[1] == 1:
        table = np.column_stack([table, np.zeros(len(table))])
    return [[float(f"{x:.4g}") for x in row] for row in table]
