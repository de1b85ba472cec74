"""Olfati-Saber: Flocking for Multi-Agent Dynamic Systems (IEEE TAC 51, 2006), as it is commonly cited."""

from __future__ import annotations

from flocking.papers.assumptions import links_by_rule
from flocking.papers.description import Paper
from flocking.papers.olfati_saber_2006.closed_forms import (
    action,
    bump,
    centre_motion,
    metrics,
    most_collisions,
    obstacle_action,
    pair_potential,
    structural_energy,
    uneven_sigmoid,
)
from flocking.papers.olfati_saber_2006.pictures import figures
from flocking.papers.olfati_saber_2006.system import KEY, potential, repulsion, scenario, scenarios, sigma_norm
from flocking.papers.olfati_saber_2006.theorems import claims

PAPER = Paper(
    key=KEY,
    title="Flocking for Multi-Agent Dynamic Systems: Algorithms and Theory",
    authors="R. Olfati-Saber",
    year=2006,
    venue="IEEE Transactions on Automatic Control 51(3)",
    scenario=scenario,
    scenarios=scenarios,
    claims=claims,
    figures=figures,
    assumes=links_by_rule,
    titles={
        "olfati-saber-2006": "Algorithm 2: 150 agents follow a gamma-agent",
        "olfati-saber-2006-fragments": "Algorithm 1: forty agents without a common goal",
        "olfati-saber-2006-space": "Algorithm 2 in three dimensions, fifty agents",
        "olfati-saber-2006-gentle": "Algorithm 1: ten agents with less energy than one collision needs",
        "olfati-saber-2006-pressed": "Algorithm 2 in three dimensions with a strong pull",
        "olfati-saber-2006-split": "Algorithm 3: split and rejoin among obstacles",
        "olfati-saber-2006-squeeze": "Algorithm 3: squeeze through a gap",
        "olfati-saber-2006-firm": "Algorithm 3: the same gap with a larger gain at obstacles",
        "olfati-saber-2006-against": "Algorithm 3: agents led straight at an obstacle",
        "olfati-saber-2006-network": "The setting of a published network simulator",
        "olfati-saber-2006-network-held": "The same with control held for 0.2, as the simulator runs it",
    },
    questions={
        "olfati-saber-2006": "Do 150 agents end in one flock that follows the gamma-agent?",
        "olfati-saber-2006-fragments": "Do forty agents without a common goal gather in one flock?",
        "olfati-saber-2006-space": "Do fifty agents in space end in one flock that follows the gamma-agent?",
        "olfati-saber-2006-gentle": "Do ten agents stay apart that have less energy than one collision needs?",
        "olfati-saber-2006-pressed": "Does a strong pull of the goal press agents together until they merge?",
        "olfati-saber-2006-split": "Does the flock split at the obstacles and rejoin behind them?",
        "olfati-saber-2006-squeeze": "Do all agents squeeze through the gap and end in one flock behind it?",
        "olfati-saber-2006-firm": "Does a larger gain at obstacles keep all agents out of them?",
        "olfati-saber-2006-against": "Does an agent enter an obstacle that it is led straight at?",
        "olfati-saber-2006-network": "Does the simulator's flock split, rejoin and stay out of its obstacles?",
        "olfati-saber-2006-network-held": "Does the simulator's flock split and rejoin when control is held for 0.2?",
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
    "action",
    "bump",
    "centre_motion",
    "claims",
    "equations",
    "errata",
    "figure",
    "figures",
    "metrics",
    "most_collisions",
    "obstacle_action",
    "pair_potential",
    "potential",
    "repulsion",
    "scenario",
    "scenarios",
    "sigma_norm",
    "structural_energy",
    "uneven_sigmoid",
]
