"""Grounds of the expected verdicts on Tanner I."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

from flocking.papers.grounds import OBSERVED, Ground, proved, refuted
from flocking.papers.tanner_2003_fixed.system import scenario

SEED_OF_A_RIGID_GRAPH = 10
"""The first seed whose random graph is too rigid for all links to be at the minimum of the potential."""


def grounds(complete: bool) -> Mapping[str, Ground]:
    """Grounds by the key of the claim.

    Parameters
    ----------
    complete
        Whether all agents are linked.
    """
    return {
        "energy": proved("identity: the pair forces' power cancels against the rate of V, alignment leaves (9)"),
        "energy-falls": proved("(9): the Laplacian is positive semidefinite"),
        "velocities-agree": proved(
            "LaSalle's principle on the level set of W, compact up to translation for a connected graph; (9) vanishes "
            "only where velocities agree"
        ),
        "linked-apart": proved("W bounds the potential of every link, which is infinite at contact"),
        "all-apart": proved("as for linked agents: all are linked") if complete else refuted(partial(scenario, seed=0)),
        "stationary": proved(
            "on LaSalle's invariant set velocities stay equal, so that the forces are equal, and their sum is zero"
        ),
        "minimal": proved("all V_i are least only where all distances are 1: at most three points of a plane are so")
        if complete
        else refuted(partial(scenario, seed=SEED_OF_A_RIGID_GRAPH)),
        "local-minimum": OBSERVED,
        "speed-bound": proved("W <= c and V_ij >= 0"),
        "distance-bound": proved("every link is at most V^-1(c) long, and a path has at most N-1 links"),
        "momentum": proved("the forces of every pair are opposite"),
    }
