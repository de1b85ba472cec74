"""Tanner, Jadbabaie, Pappas: Stable Flocking of Mobile Agents, Part II: Dynamic Topology (CDC 2003)."""

from __future__ import annotations

from flocking.papers.assumptions import of_stated_law
from flocking.papers.description import Paper
from flocking.papers.tanner_2003_dynamic.pictures import figures
from flocking.papers.tanner_2003_dynamic.system import (
    KEY,
    boundary_value,
    energy,
    inner_potential,
    potential,
    scenario,
    scenarios,
)
from flocking.papers.tanner_2003_dynamic.theorems import claims
from flocking.study.potentials.potential_check import Definition
from flocking.study.potentials.potential_check import Properties as Rule

DEFINITION = Definition(
    KEY, "Tanner II, Definition IV.2", False, (Rule.nonnegative, Rule.at_zero, Rule.unique, Rule.increasing)
)
"""The paper's definition of a potential."""

PAPER = Paper(
    key=KEY,
    title="Stable Flocking of Mobile Agents, Part II: Dynamic Topology",
    authors="H. G. Tanner, A. Jadbabaie, G. J. Pappas",
    year=2003,
    venue="IEEE Conference on Decision and Control",
    scenario=scenario,
    scenarios=scenarios,
    claims=claims,
    figures=figures,
    studies=("tanner-connectivity",),
    potential_definition=DEFINITION,
    assumes=of_stated_law(scenarios, DEFINITION),
    titles={
        "tanner-2003-dynamic": "Sec. VII: ten agents, linked while closer than R",
    },
    questions={
        "tanner-2003-dynamic": "Do velocities agree without collisions while links come and go with the distance?",
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
    "boundary_value",
    "claims",
    "energy",
    "equations",
    "errata",
    "figure",
    "figures",
    "inner_potential",
    "potential",
    "scenario",
    "scenarios",
]
