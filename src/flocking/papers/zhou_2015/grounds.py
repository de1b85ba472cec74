"""Grounds of the expected verdicts on Zhou, Zhou and Zeng."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

from flocking.papers.grounds import Ground, proved, refuted
from flocking.papers.zhou_2015.system import scenario


def grounds(led: bool) -> Mapping[str, Ground]:
    """Grounds by the key of the claim.

    Parameters
    ----------
    led
        Whether the group has the virtual leader.
    """
    example = partial(scenario, seed=0, leader=led)
    lasalle = (
        "LaSalle's principle on the final graph, which is connected: the rate of the energy vanishes only where "
        "velocities agree"
    )
    return {
        "energy": proved("identity: the pair forces' power cancels against the rate of the potential energy"),
        "energy-falls": proved("the Laplacian is positive semidefinite"),
        "energy-bound": proved("a new link adds psi(r - eps), at most M are new, and none is lost"),
        "energy-per-link": proved("a link appears at r - eps exactly, and velocities do not jump"),
        "new-links": proved("no link is lost, so that each of the M missing ones appears at most once"),
        "connected": proved("the start is connected and no link is lost"),
        "links-kept": proved("psi is infinite at r, and the energy is bounded"),
        "linked-apart": proved("psi is infinite at contact, and the energy is bounded"),
        "all-apart": proved("linked agents by their energy; unlinked ones are r - eps apart or more"),
        "unlinked-apart": proved("rule (iii): nearer ones are linked"),
        "distances-settle": proved(
            "on the final graph relative motion is that of a damped analytic potential, which converges (Haraux and "
            "Jendoubi, 1998)"
        ),
        "switching-stops": proved("at most M links appear and none is lost"),
        "speed-bound": proved("the energy is bounded and psi is positive"),
        "distance-bound": proved("a connected graph has a path of at most N-1 links, each shorter than r"),
        "coincide": proved("psi is infinite where linked agents meet, and the energy is bounded"),
        "one-length": refuted(example),
        "momentum": proved("the forces of every pair are opposite"),
        "velocities-agree": proved(lasalle),
        "velocities-follow": proved(lasalle + " with the leader's"),
        "mean-velocity": proved("(34): the mean of the pair forces is zero, what remains is linear"),
        "leader-offset": proved("integral of (34)"),
        "leader-met": refuted(example),
        "stationary": proved("on LaSalle's invariant set velocities stay equal, so that the forces balance"),
    }
