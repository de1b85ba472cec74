"""Zhou, Zhou, Zeng: Flocking Control of Multiple Mobile Agents with the Rules of Avoiding Collision (2015)."""

from __future__ import annotations

from flocking.papers.zhou_2015.bounds import largest_energy, most_new_links
from flocking.papers.zhou_2015.pictures import figure, figures
from flocking.papers.zhou_2015.system import KEY, potential, scenario, scenarios
from flocking.papers.zhou_2015.table import equations, errata
from flocking.papers.zhou_2015.theorems import claims

TITLE = "Flocking Control of Multiple Mobile Agents with the Rules of Avoiding Collision"
AUTHORS = "H. Zhou, W. Zhou, W. Zeng"
YEAR = 2015

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
    "largest_energy",
    "most_new_links",
    "potential",
    "scenario",
    "scenarios",
]
