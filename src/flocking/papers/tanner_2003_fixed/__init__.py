"""Tanner, Jadbabaie, Pappas: Stable Flocking of Mobile Agents, Part I: Fixed Topology (CDC 2003)."""

from __future__ import annotations

from flocking.papers.assumptions import of_stated_law
from flocking.papers.description import Paper
from flocking.papers.tanner_2003_fixed.pictures import figures
from flocking.papers.tanner_2003_fixed.system import KEY, potential, scenario, scenarios
from flocking.papers.tanner_2003_fixed.theorems import claims, longest_path
from flocking.study.potentials.potential_check import Definition
from flocking.study.potentials.potential_check import Properties as Rule

DEFINITION = Definition(
    KEY,
    "Tanner I, Definition IV.3",
    True,
    (Rule.differentiable, Rule.nonnegative, Rule.unbounded, Rule.at_zero, Rule.unique),
)
"""The paper's definition of a potential."""

PAPER = Paper(
    key=KEY,
    title="Stable Flocking of Mobile Agents, Part I: Fixed Topology",
    authors="H. G. Tanner, A. Jadbabaie, G. J. Pappas",
    year=2003,
    venue="IEEE Conference on Decision and Control",
    scenario=scenario,
    scenarios=scenarios,
    claims=claims,
    figures=figures,
    potential_definition=DEFINITION,
    assumes=of_stated_law(scenarios, DEFINITION),
    titles={
        "tanner-2003-fixed": "Sec. V: ten agents in a random connected graph",
        "tanner-2003-fixed-complete": "The same with every pair linked",
    },
    questions={
        "tanner-2003-fixed": "Do velocities agree over fixed links, and do linked agents never collide?",
        "tanner-2003-fixed-complete": "Do velocities agree, and do no two agents collide, when every pair is linked?",
    },
)
TITLE, AUTHORS, YEAR = PAPER.title, PAPER.authors, PAPER.year
equations, errata, figure = PAPER.equations, PAPER.errata, PAPER.figure

__all__ = [
    "AUTHORS",
    "KEY",
    "PAPER",
    "TITLE",
    "YEAR",
    "claims",
    "equations",
    "errata",
    "figure",
    "figures",
    "longest_path",
    "potential",
    "scenario",
    "scenarios",
]
