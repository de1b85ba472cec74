"""Tanner, Jadbabaie, Pappas: Stable Flocking of Mobile Agents, Part I: Fixed Topology (CDC 2003)."""

from __future__ import annotations

from flocking.papers.tanner_2003_fixed.theorems import claims


from flocking.papers.tanner_2003_fixed.system import potential, scenario, scenarios

KEY = "tanner-2003-fixed"
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
    "figure",
    "figures",
    "potential",
    "scenario",
    "scenarios",
]
