"""Shi, Wang, Chu: Flocking of multi-agent systems with a dynamic virtual leader (Int. J. Control, 2009)."""

from __future__ import annotations

from flocking.papers.shi_2009.pictures import figure, figures
from flocking.papers.shi_2009.system import potential, scenario, scenarios
from flocking.papers.shi_2009.table import equations, errata
from flocking.papers.shi_2009.theorems import claims

KEY = "shi-2009"
TITLE = "Flocking of multi-agent systems with a dynamic virtual leader"
AUTHORS = "H. Shi, L. Wang, T. Chu"
YEAR = 2009

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
    "potential",
    "scenario",
    "scenarios",
]
