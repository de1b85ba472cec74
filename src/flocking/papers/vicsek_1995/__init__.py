"""Vicsek et al.: Novel Type of Phase Transition in a System of Self-Driven Particles (PRL 75, 1995).

As it is commonly cited, with what later work found of its transition.
"""

from __future__ import annotations

from flocking.papers.assumptions import links_by_rule
from flocking.papers.description import Paper
from flocking.papers.vicsek_1995.closed_forms import binder_cumulant, deviations, mean_directions, random_order
from flocking.papers.vicsek_1995.large_groups import HeadingGroup
from flocking.papers.vicsek_1995.order_curves import order_series
from flocking.papers.vicsek_1995.pictures import figures
from flocking.papers.vicsek_1995.system import KEY, scenario, scenarios
from flocking.papers.vicsek_1995.theorems import claims
from flocking.papers.vicsek_1995.transition import measured_fluctuations, order_values, stored_study

PAPER = Paper(
    key=KEY,
    title="Novel Type of Phase Transition in a System of Self-Driven Particles",
    authors="T. Vicsek, A. Czirok, E. Ben-Jacob, I. Cohen, O. Shochet",
    year=1995,
    venue="Physical Review Letters 75(6)",
    scenario=scenario,
    scenarios=scenarios,
    claims=claims,
    figures=figures,
    assumes=links_by_rule,
    titles={
        "vicsek-1995": "Fig. 1 (a), (c): 300 agents on a wide torus with strong noise",
        "vicsek-1995-gathering": "Fig. 1 (b): low density and weak noise",
        "vicsek-1995-ordered": "Fig. 1 (d): high density and weak noise",
        "vicsek-1995-small": "Fig. 2: forty agents at noise 1",
        "vicsek-1995-noiseless": "Forty agents without noise, within half a turn",
        "vicsek-1995-random": "Forty agents with headings drawn anew at every update",
        "vicsek-1995-vectorial": "Later work: vectorial noise and the forward update",
        "vicsek-1995-middle": "Fig. 2: four hundred agents half way down the curve",
        "vicsek-1995-phases": "Later work: order and disorder take turns",
        "vicsek-1995-bands": "Later work: bands beside the transition",
        "vicsek-1995-fluctuations": "Later work: giant fluctuations in an ordered group",
    },
    questions={
        "vicsek-1995": "Is the motion ordered on a wide torus, with strong noise?",
        "vicsek-1995-gathering": "Is the motion ordered at low density, with weak noise?",
        "vicsek-1995-ordered": "Is the motion ordered at high density, with weak noise?",
        "vicsek-1995-small": "Are forty agents ordered at noise 1?",
        "vicsek-1995-noiseless": "Do headings within half a turn become the same without noise?",
        "vicsek-1995-random": "Are headings independent when noise reaches all angles evenly?",
        "vicsek-1995-vectorial": "Does vectorial noise of 0.4 leave an ordered motion?",
        "vicsek-1995-middle": "Does the order parameter change between two phases half way down the curve?",
        "vicsek-1995-phases": "Is the group disordered at times and ordered at others at the transition?",
        "vicsek-1995-bands": "Is the density of an ordered group one wave beside the transition?",
        "vicsek-1995-fluctuations": "Do numbers of agents in boxes deviate as N^0.8 in an ordered group?",
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
    "HeadingGroup",
    "binder_cumulant",
    "claims",
    "deviations",
    "equations",
    "errata",
    "figure",
    "figures",
    "mean_directions",
    "measured_fluctuations",
    "order_series",
    "order_values",
    "random_order",
    "scenario",
    "scenarios",
    "stored_study",
]
