"""Shi, Wang, Chu: Flocking of multi-agent systems with a dynamic virtual leader (Int. J. Control, 2009)."""

from __future__ import annotations

from flocking.papers.assumptions import of_stated_law
from flocking.papers.description import Paper
from flocking.papers.shi_2009.bounds import distance_bound, speed_bounds
from flocking.papers.shi_2009.closed_forms import (
    centre_motion,
    exponential_leading_part,
    exponential_motion,
    free_motion,
    jordan_form,
    ramp_motion,
    steady_velocity_error,
)
from flocking.papers.shi_2009.pictures import figures
from flocking.papers.shi_2009.system import KEY, potential, scenario, scenarios
from flocking.papers.shi_2009.theorems import claims
from flocking.study.potentials.potential_check import Definition
from flocking.study.potentials.potential_check import Properties as Rule

DEFINITION = Definition(
    KEY,
    "Shi, Definition 2",
    True,
    (Rule.differentiable, Rule.nonnegative, Rule.at_zero, Rule.unique, Rule.constant_beyond),
)
"""The paper's definition of a potential."""

PAPER = Paper(
    key=KEY,
    title="Flocking of multi-agent systems with a dynamic virtual leader",
    authors="H. Shi, L. Wang, T. Chu",
    year=2009,
    venue="International Journal of Control",
    scenario=scenario,
    scenarios=scenarios,
    claims=claims,
    figures=figures,
    studies=("shi-informed",),
    potential_definition=DEFINITION,
    assumes=of_stated_law(scenarios, DEFINITION),
    titles={
        "shi-2009": "Fig. 4: law (4), velocity known to some, acceleration to all",
        "shi-2009-all-informed": "Fig. 5: law (4), velocity and acceleration known to all",
        "shi-2009-disconnected": "Fig. 6: law (4), velocity and acceleration known to all, while the graph falls apart",
        "shi-2009-uniform": "Law (8) of Theorem 3, which the paper does not simulate",
        "shi-2009-velocity-only": "Fig. 7: law (12), acceleration unknown",
        "shi-2009-position": "Fig. 8: law (15) with position feedback, acceleration unknown",
        "shi-2009-partial": "Fig. 10: law (4), acceleration known to some",
        "shi-2009-partial-disconnected": "Fig. 11: law (4), acceleration known to some, while the graph falls apart",
    },
    questions={
        "shi-2009": "Do all agents track a leader whose acceleration all know, and whose velocity only some?",
        "shi-2009-all-informed": "Do all agents track a leader whose velocity and acceleration all know?",
        "shi-2009-disconnected": "Do all agents track the leader when the graph falls apart?",
        "shi-2009-uniform": "Does the centre of mass move as Theorem 3 predicts, and do all agents track the leader?",
        "shi-2009-velocity-only": "How far does the mean velocity stay from a leader's of unknown acceleration?",
        "shi-2009-position": "How far does the mean velocity stay from the leader's with position feedback?",
        "shi-2009-partial": "Do velocities agree when only some agents know the leader's acceleration?",
        "shi-2009-partial-disconnected": "Do velocities agree when the graph falls apart, with only some informed?",
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
    "centre_motion",
    "claims",
    "distance_bound",
    "equations",
    "errata",
    "exponential_leading_part",
    "exponential_motion",
    "figure",
    "figures",
    "free_motion",
    "jordan_form",
    "potential",
    "ramp_motion",
    "scenario",
    "scenarios",
    "speed_bounds",
    "steady_velocity_error",
]
