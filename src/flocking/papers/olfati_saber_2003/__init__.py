"""Olfati-Saber: Flocking with Obstacle Avoidance (Caltech, 2003)."""

from __future__ import annotations

from flocking.papers.assumptions import of_stated_law
from flocking.papers.description import Paper
from flocking.papers.olfati_saber_2003.closed_forms import (
    contraction,
    contraction_rate,
    gathering_energy,
    translational_energy,
)
from flocking.papers.olfati_saber_2003.pictures import figures
from flocking.papers.olfati_saber_2003.system import KEY, scenario, scenarios
from flocking.papers.olfati_saber_2003.theorems import claims

PAPER = Paper(
    key=KEY,
    title="Flocking with Obstacle Avoidance",
    authors="R. Olfati-Saber",
    year=2003,
    venue="California Institute of Technology",
    scenario=scenario,
    scenarios=scenarios,
    claims=claims,
    figures=figures,
    studies=("olfati-saber-density",),
    assumes=of_stated_law(scenarios, any_feedback=frozenset({KEY})),
    titles={
        "olfati-saber-2003": "Figs. 7 and 8: a hundred agents pass six obstacles",
        "olfati-saber-2003-sink": "Fig. 9: a hundred agents gather around a sink",
        "olfati-saber-2003-free": "Protocol (34) alone, thirty agents near a lattice",
        "olfati-saber-2003-smooth": "Protocol (35) alone, thirty agents near a lattice",
    },
    questions={
        "olfati-saber-2003": "Does the flock split at the obstacles, squeeze through the gap and rejoin?",
        "olfati-saber-2003-sink": "Does a scattered group gather around a sink as one rigid flock?",
        "olfati-saber-2003-free": "Do velocities agree under protocol (34), whose energy jumps where links appear?",
        "olfati-saber-2003-smooth": "Do velocities agree under protocol (35), whose energy does not jump at links?",
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
    "contraction",
    "contraction_rate",
    "equations",
    "errata",
    "figure",
    "figures",
    "gathering_energy",
    "scenario",
    "scenarios",
    "translational_energy",
]
