"""Vasarhelyi et al.: Optimized flocking of autonomous drones in confined environments (Sci. Robot. 3, 2018).

In its own imperfect world: late and inaccurate knowledge of others, vehicles that follow wanted velocities with a lag,
and noise. Parameters are those that the authors released with their program; the text of the paper was not at hand.
"""

from __future__ import annotations

from flocking.model.terms.braking import braking_distance, braking_speed
from flocking.papers.description import Paper
from flocking.papers.vasarhelyi_2018.closed_forms import error_variances, lone_speeds
from flocking.papers.vasarhelyi_2018.parameters import OrderParameters, cluster_radius, order_parameters
from flocking.papers.vasarhelyi_2018.pictures import figures
from flocking.papers.vasarhelyi_2018.system import KEY, scenario, scenarios
from flocking.papers.vasarhelyi_2018.theorems import claims

PAPER = Paper(
    key=KEY,
    title="Optimized flocking of autonomous drones in confined environments",
    authors="G. Vasarhelyi, C. Viragh, G. Somorjai, T. Nepusz, A. E. Eiben, T. Vicsek",
    year=2018,
    venue="Science Robotics 3, eaat3536",
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
    "OrderParameters",
    "braking_distance",
    "braking_speed",
    "claims",
    "cluster_radius",
    "equations",
    "errata",
    "error_variances",
    "figure",
    "figures",
    "lone_speeds",
    "order_parameters",
    "scenario",
    "scenarios",
]
