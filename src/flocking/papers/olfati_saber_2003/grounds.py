"""Grounds of the expected verdicts on Olfati-Saber."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

from flocking.papers.grounds import OBSERVED, Ground, proved, refuted
from flocking.papers.olfati_saber_2003.system import FREE, KEY, SINK, SMOOTH, scenarios

AT_THE_SINK = (
    "if all links had length d_alpha, no pair force would balance the force of the sink, and all would be there"
)


def grounds(name: str) -> Mapping[str, Ground]:
    """Grounds by the key of the claim.

    Parameters
    ----------
    name
        Name of the scenario.
    """
    ledger = {"energy": proved("identity: the declared forces' power is the rate of H_s, its dissipation and supply")}
    opposite = {"momentum": proved("the forces of every pair are opposite")}
    convergence = {"velocities-agree": OBSERVED, "distances-settle": OBSERVED}
    found: dict[str, Mapping[str, Ground]] = {
        KEY: ledger
        | dict.fromkeys(("quasi-flock", "no-entry", "velocities", "headings", "split", "rejoin", "squeeze"), OBSERVED),
        SINK: ledger
        | dict.fromkeys(("connected", "switching-stops", "rigid", "planar", "triangular", "low-defect"), OBSERVED)
        | {
            "energy-falls": proved("(61), (65): between switches the rate is minus a sum of squares"),
            "centred": proved("the pair forces add up to zero: the centre of mass is a damped oscillator at the sink"),
            "realization": proved(AT_THE_SINK),
            "flocking": proved(AT_THE_SINK),
        },
        FREE: ledger
        | opposite
        | convergence
        | {
            "energy-falls": proved("(61): between switches the rate is minus a sum of squares"),
            "jumps": proved("a link appears and is lost at r, where it stores h_0"),
            "decreasing": refuted(partial(scenarios()[FREE], 0)),
        },
        SMOOTH: ledger
        | opposite
        | convergence
        | {
            "H_s-continuous": proved("(17) vanishes at r"),
            "energy-falls": proved("Proposition 5: the rate is minus a sum of squares, and H_s is continuous"),
        },
    }
    return found[name]
