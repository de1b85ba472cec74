"""Olfati-Saber: Flocking with Obstacle Avoidance (Caltech, 2003)."""

from __future__ import annotations

from flocking.papers.olfati_saber_2003.closed_forms import (
    contraction,
    contraction_rate,
    gathering_energy,
    translational_energy,
)
from flocking.papers.olfati_saber_2003.pictures import figure, figures
from flocking.papers.olfati_saber_2003.system import KEY, scenario, scenarios
from flocking.papers.olfati_saber_2003.table import equations, errata
from flocking.papers.olfati_saber_2003.theorems import claims

TITLE = "Flocking with Obstacle Avoidance"
AUTHORS = "R. Olfati-Saber"
YEAR = 2003

__all__ = [
    "AUTHORS",
    "KEY",
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
