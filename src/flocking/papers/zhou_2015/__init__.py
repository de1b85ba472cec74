"""Zhou, Zhou, Zeng: Flocking Control of Multiple Mobile Agents with the Rules of Avoiding Collision (2015)."""

from __future__ import annotations

from flocking.papers.assumptions import of_stated_law
from flocking.papers.description import Paper
from flocking.papers.zhou_2015.bounds import largest_energy, most_new_links
from flocking.papers.zhou_2015.pictures import figures
from flocking.papers.zhou_2015.system import KEY, potential, scenario, scenarios
from flocking.papers.zhou_2015.theorems import claims
from flocking.study.potentials.potential_check import Definition
from flocking.study.potentials.potential_check import Properties as Rule

DEFINITION = Definition(
    KEY, "Zhou, psi and its properties (i), (ii)", False, (Rule.nonnegative, Rule.unique, Rule.at_zero, Rule.at_radius)
)
"""The paper's definition of a potential."""

PAPER = Paper(
    key=KEY,
    title="Flocking Control of Multiple Mobile Agents with the Rules of Avoiding Collision",
    authors="H. Zhou, W. Zhou, W. Zeng",
    year=2015,
    venue="Mathematical Problems in Engineering",
    scenario=scenario,
    scenarios=scenarios,
    claims=claims,
    figures=figures,
    studies=("zhou-bound",),
    potential_definition=DEFINITION,
    assumes=of_stated_law(scenarios, DEFINITION),
    titles={
        "zhou-2015": "Ten agents without a leader",
        "zhou-2015-leader": "Ten agents with a virtual leader",
    },
    questions={
        "zhou-2015": "Do ten agents agree on one velocity, stay connected and never collide?",
        "zhou-2015-leader": "Do ten agents take on the leader's velocity, stay connected and never collide?",
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
    "largest_energy",
    "most_new_links",
    "potential",
    "scenario",
    "scenarios",
]
