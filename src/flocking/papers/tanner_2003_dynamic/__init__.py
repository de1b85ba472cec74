"""Tanner, Jadbabaie, Pappas: Stable Flocking of Mobile Agents, Part II: Dynamic Topology (CDC 2003)."""

from __future__ import annotations

from flocking.papers.tanner_2003_dynamic.pictures import figure, figures
from flocking.papers.tanner_2003_dynamic.system import (
    KEY,
    boundary_value,
    energy,
    inner_potential,
    potential,
    scenario,
    scenarios,
)
from flocking.papers.tanner_2003_dynamic.table import equations, errata
from flocking.papers.tanner_2003_dynamic.theorems import claims

TITLE = "Stable Flocking of Mobile Agents, Part II: Dynamic Topology"
AUTHORS = "H. G. Tanner, A. Jadbabaie, G. J. Pappas"
YEAR = 2003

__all__ = [
    "AUTHORS",
    "KEY",
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
