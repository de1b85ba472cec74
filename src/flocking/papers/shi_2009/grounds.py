"""Grounds of the expected verdicts on Shi, Wang, Chu."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

from flocking.papers.grounds import OBSERVED, Ground, proved, refuted
from flocking.papers.shi_2009.system import SETTINGS, scenario


def grounds(name: str) -> Mapping[str, Ground]:
    """Grounds by the key of the claim.

    Parameters
    ----------
    name
        Name of the scenario.
    """
    some = SETTINGS[name].acceleration == "some"
    linear = "the pair forces and alignments of the group add up to zero, what remains of the centre of mass is linear"
    return {
        "energy": proved("identity: (6)-(7), (11)"),
        "J-continuous": proved("(3) is continuous at R, and constant beyond"),
        # If only some agents are informed of a0, J may increase and gives no bound.
        "apart": OBSERVED if some else proved("J never rises, and (3) is infinite at contact"),
        "no-flocking": OBSERVED,
        "no-tracking": OBSERVED if some else proved(linear + ": its distance from v0 does not vanish"),
        "J-falls": proved("(7), (11): dJ/dt is minus a sum of squares between switches, and J is continuous"),
        "stationary": proved("velocities agree and the slope of (3) is uniformly continuous: Barbalat's lemma"),
        "minimal": refuted(partial(scenario, name=name, seed=0)),
        "tracks": proved("J falls at rate e^T (L + H) e, which is positive if an informed agent is in reach"),
        "agree": proved("J falls at rate e^T L e, and accelerations are bounded: Barbalat's lemma"),
        "steady-error": proved(linear),
        "centre": proved(linear),
    }
