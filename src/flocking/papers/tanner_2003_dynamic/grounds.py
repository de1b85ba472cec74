"""Grounds of the expected verdicts on Tanner II."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

from flocking.papers.grounds import OBSERVED, Ground, proved, refuted
from flocking.papers.tanner_2003_dynamic.system import scenario

SEED_THAT_PARTS = 1
"""The first seed whose group becomes disconnected from a connected start."""


def grounds() -> Mapping[str, Ground]:
    """Grounds by the key of the claim."""
    return {
        "energy": proved("identity between switches, as in Part I; U_ij is continuous at R"),
        "energy-continuous": proved("U_ij is continuous at R, by the choice of V_R"),
        "energy-falls": proved("(10) between switches, and Q is continuous"),
        "connected": refuted(partial(scenario, seed=SEED_THAT_PARTS)),
        "transversal": OBSERVED,
        "velocities-agree": proved(
            "Q falls at least at the rate lambda_2 |v - mean|^2, lambda_2 of finitely many connected graphs, and "
            "accelerations are bounded: Barbalat's lemma"
        ),
        "distances-settle": OBSERVED,
        "all-apart": proved("Q never rises, and U_ij is infinite at contact"),
        "apart-by": proved("Q never rises, and all other pairs store at least the least of U_ij"),
        "stationary": OBSERVED,
        "minimal": refuted(partial(scenario, seed=0)),
        "local-minimum": OBSERVED,
        "switching-stops": OBSERVED,
        "links-kept": refuted(partial(scenario, seed=SEED_THAT_PARTS)),
        "speed-bound": proved("Q <= c and U_ij >= 0"),
        "distance-bound": proved("a connected graph has a path of at most N-1 links, each at most R long"),
        "momentum": proved("the forces of every pair are opposite"),
    }
