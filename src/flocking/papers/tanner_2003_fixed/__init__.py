"""Tanner, Jadbabaie, Pappas: Stable Flocking of Mobile Agents, Part I: Fixed Topology (CDC 2003)."""

from __future__ import annotations

from flocking.papers.tanner_2003_fixed.pictures import figure, figures
from flocking.papers.tanner_2003_fixed.system import KEY, potential, scenario, scenarios
from flocking.papers.tanner_2003_fixed.table import equations, errata
from flocking.papers.tanner_2003_fixed.theorems import claims, longest_path

TITLE = "Stable Flocking of Mobile Agents, Part I: Fixed Topology"
AUTHORS = "H. G. Tanner, A. Jadbabaie, G. J. Pappas"
YEAR = 2003

__all__ = [
    "AUTHORS",
    "KEY",
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
