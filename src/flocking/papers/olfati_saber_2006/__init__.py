"""Olfati-Saber: Flocking for Multi-Agent Dynamic Systems (IEEE TAC 51, 2006), as it is commonly cited."""

from __future__ import annotations

from flocking.papers.description import Paper
from flocking.papers.olfati_saber_2006.closed_forms import (
    action,
    bump,
    centre_motion,
    metrics,
    most_collisions,
    obstacle_action,
    pair_potential,
    structural_energy,
    uneven_sigmoid,
)
from flocking.papers.olfati_saber_2006.pictures import figures
from flocking.papers.olfati_saber_2006.system import KEY, potential, repulsion, scenario, scenarios, sigma_norm
from flocking.papers.olfati_saber_2006.theorems import claims

PAPER = Paper(
    key=KEY,
    title="Flocking for Multi-Agent Dynamic Systems: Algorithms and Theory",
    authors="R. Olfati-Saber",
    year=2006,
    venue="IEEE Transactions on Automatic Control 51(3)",
    scenario=scenario,
    scenarios=scenarios,
    claims=claims,
    figures=figures,
)
TITLE, AUTHORS, YEAR = PAPER.title, PAPER.authors, PAPER.year
equations, errata, figure = PAPER.equations, PAPER.errata, PAPER.figure

__all__ = [
    "AUTHORS",
    "KEY",
    "PAPER",
    "TITLE",
    "YEAR",
    "action",
    "bump",
    "centre_motion",
    "claims",
    "equations",
    "errata",
    "figure",
    "figures",
    "metrics",
    "most_collisions",
    "obstacle_action",
    "pair_potential",
    "potential",
    "repulsion",
    "scenario",
    "scenarios",
    "sigma_norm",
    "structural_energy",
    "uneven_sigmoid",
]
