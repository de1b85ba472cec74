"""Cucker, Smale: Emergent Behavior in Flocks (IEEE TAC 52, 2007), as it is commonly cited, and later results."""

from __future__ import annotations

from flocking.papers.assumptions import links_by_rule
from flocking.papers.cucker_smale_2007.closed_forms import (
    delay_limits,
    discrete_motion,
    discrete_step,
    final_distance,
    final_speed,
    pair_invariant,
    scatter,
    sufficient_condition,
    weights,
)
from flocking.papers.cucker_smale_2007.pictures import figures
from flocking.papers.cucker_smale_2007.system import KEY, scenario, scenarios
from flocking.papers.cucker_smale_2007.theorems import claims
from flocking.papers.description import Paper

PAPER = Paper(
    key=KEY,
    title="Emergent Behavior in Flocks",
    authors="F. Cucker, S. Smale",
    year=2007,
    venue="IEEE Transactions on Automatic Control 52(5)",
    scenario=scenario,
    scenarios=scenarios,
    claims=claims,
    figures=figures,
    assumes=links_by_rule,
    titles={
        "cucker-smale-2007": "Twenty agents, exponent 0.4: agreement from every start",
        "cucker-smale-2007-critical": "Twenty agents, exponent 1/2",
        "cucker-smale-2007-sharp": "Twenty agents, exponent 1: a condition on the start",
        "cucker-smale-2007-pair": "Two agents on a line, slow enough for each other",
        "cucker-smale-2007-parting": "Two agents on a line, too fast for each other",
        "cucker-smale-2007-delayed": "Five agents that know each other late",
        "cucker-smale-2007-reaction": "Two agents with all states known late",
        "cucker-smale-2007-monotone": "Two agents with a delay too short to overshoot",
        "cucker-smale-2007-unstable": "Two agents with a delay beyond the limit of stability",
        "cucker-smale-2007-discrete": "Twenty agents in discrete time",
    },
    questions={
        "cucker-smale-2007": "Do all velocities become the same for an exponent below 1/2?",
        "cucker-smale-2007-critical": "Do all velocities become the same for the exponent 1/2, too?",
        "cucker-smale-2007-sharp": "Do all velocities become the same for exponent 1, under a condition on the start?",
        "cucker-smale-2007-pair": "To which distance do two agents tend that are slow enough for each other?",
        "cucker-smale-2007-parting": "Do two agents part for ever that are too fast for each other?",
        "cucker-smale-2007-delayed": "Do velocities agree when neighbours are known late?",
        "cucker-smale-2007-reaction": "Do velocities agree when all states are known late, the own one too?",
        "cucker-smale-2007-monotone": "Does the relative velocity never turn when the delay is short?",
        "cucker-smale-2007-unstable": "Do differences of velocities shrink beyond the limit of stability?",
        "cucker-smale-2007-discrete": "Do all velocities become the same in discrete time, too?",
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
    "claims",
    "delay_limits",
    "discrete_motion",
    "discrete_step",
    "equations",
    "errata",
    "figure",
    "figures",
    "final_distance",
    "final_speed",
    "pair_invariant",
    "scatter",
    "scenario",
    "scenarios",
    "sufficient_condition",
    "weights",
]
