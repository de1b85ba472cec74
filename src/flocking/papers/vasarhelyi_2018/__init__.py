"""Vasarhelyi et al.: Optimized flocking of autonomous drones in confined environments (Sci. Robot. 3, 2018).

In its own imperfect world: late and inaccurate knowledge of others, vehicles that follow desired velocities with a lag,
and noise. Two sets of parameters: those of the file that the authors released with their program, with which no order
arises, and those that their optimisation found, as commonly cited. The text of the paper was not at hand.
"""

from __future__ import annotations

from flocking.model.terms.braking import braking_distance, braking_speed
from flocking.papers.description import Paper
from flocking.papers.vasarhelyi_2018.closed_forms import error_variances, lone_speeds
from flocking.papers.vasarhelyi_2018.observations import observed
from flocking.papers.vasarhelyi_2018.parameters import OrderParameters, order_parameters
from flocking.papers.vasarhelyi_2018.pictures import figures
from flocking.papers.vasarhelyi_2018.rules import next_state
from flocking.papers.vasarhelyi_2018.system import KEY, cluster_radius, scenario, scenarios
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
    titles={
        "vasarhelyi-2018": "A hundred agents with the parameters of the released file",
        "vasarhelyi-2018-program": "The same as the released program runs it",
        "vasarhelyi-2018-optimized": "A hundred agents with the parameters that the optimisation found",
        "vasarhelyi-2018-obstacles": "The optimised flock among three obstacles",
        "vasarhelyi-2018-quiet": "Thirty agents without noise, judged tick by tick",
        "vasarhelyi-2018-alone": "One agent in free space",
    },
    questions={
        "vasarhelyi-2018": "Do directions correlate, without collisions, with the parameters of the released file?",
        "vasarhelyi-2018-program": "Do directions correlate, without collisions, as the released program runs it?",
        "vasarhelyi-2018-optimized": "Do directions correlate, without collisions, with the optimised parameters?",
        "vasarhelyi-2018-obstacles": "Does the optimised flock stay correlated, apart and together among obstacles?",
        "vasarhelyi-2018-quiet": "Does each agent of a flock without noise do at every tick what the rule says?",
        "vasarhelyi-2018-alone": "Does a lone agent reach the speed of the flock on a straight line?",
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
    "next_state",
    "observed",
    "order_parameters",
    "scenario",
    "scenarios",
]
