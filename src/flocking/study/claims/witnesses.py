"""Agents that broke a claim, and when: the witnesses of a verdict."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from flocking.model.graphs.connectivity import Links, components
from flocking.study.claims import general_claims as general
from flocking.study.claims.claim import Measure, Result, Verdict
from flocking.study.evidence import Evidence, NotMeasurable, NotResolvable


@dataclass(frozen=True)
class Witness:
    """A moment of a run and the agents it is about.

    Parameters
    ----------
    time
        When.
    agents
        Who; empty when it is about no one in particular.
    """

    time: float
    agents: tuple[int, ...] = ()


def witness_of(result: Result, evidence: Evidence) -> Witness | None:
    """The moment and the agents that broke a claim; None where it holds or nothing points at anyone.

    Parameters
    ----------
    result
        Verdict on the claim.
    evidence
        Evidence it rests on.
    """
    broken = {Verdict.FAILS: result.claim.conclusion, Verdict.HYPOTHESIS_NOT_MET: result.claim.hypothesis}
    measure = broken.get(result.verdict)
    found = None if measure is None else _FINDERS.get(measure)
    if found is None:
        return None
    try:
        return found(evidence)
    except (NotMeasurable, NotResolvable, ArithmeticError, LookupError, ValueError):
        # What refutes a claim need not be told to the pair and the moment.
        return None


def _pair(time: float, i: int, j: int) -> Witness:
    return Witness(float(time), (int(i), int(j)))


def _apart(links: Links, time: float) -> Witness:
    """The agents outside the largest flock."""
    flock = components(links)
    largest = int(np.bincount(flock).argmax())
    return Witness(time, tuple(int(i) for i in np.flatnonzero(flock != largest)))


def _first_split(e: Evidence) -> Witness:
    links = next((links for t, links in e.link_looks if t == e.seen_disconnected), e.link_looks[-1][1])
    return _apart(links, float(e.seen_disconnected))


def _split_at_start(e: Evidence) -> Witness:
    time, links = e.link_looks[0]
    return _apart(links, time)


def _first_break(e: Evidence) -> Witness:
    rows = e.link_switches[e.link_switches["kind"] == "break"]
    return _pair(rows["time"][0], rows["i"][0], rows["j"][0])


def _last_switch(e: Evidence) -> Witness:
    row = e.link_switches[-1]
    return _pair(row["time"], row["i"], row["j"])


def _slowest_crossing(e: Evidence) -> Witness:
    row = e.link_switches[np.abs(e.link_switches["speed"]).argmin()]
    return _pair(row["time"], row["i"], row["j"])


def _closest_linked(e: Evidence) -> Witness:
    c = e.run.closest_linked
    return Witness(c.time, c.pair)


def _closest(e: Evidence) -> Witness:
    c = e.run.closest
    return Witness(c.time, c.pair)


def _largest_rise(e: Evidence) -> Witness:
    rises = np.diff(e.run.trace["energy"]) - np.diff(e.run.trace["jumped"])
    return Witness(float(e.run.trace["time"][1 + int(rises.argmax())]))


def _worst_residual(e: Evidence) -> Witness:
    return Witness(float(e.run.trace["time"][int(np.abs(e.run.residual).argmax())]))


def _odd_velocity(e: Evidence) -> Witness:
    offsets = np.linalg.norm(e.run.p[-1] - e.mean_velocity[-1], axis=1)
    return Witness(float(e.run.t[-1]), (int(offsets.argmax()),))


def _fastest_agent(e: Evidence) -> Witness:
    frame = int(e.speeds.argmax())
    return Witness(float(e.run.t[frame]), (int(np.linalg.norm(e.run.p[frame], axis=1).argmax()),))


def _unbalanced(e: Evidence) -> Witness:
    return Witness(float(e.run.t[-1]), (int(np.linalg.norm(e.equilibrium.forces, axis=1).argmax()),))


_FINDERS: dict[Callable[[Evidence], Measure], Callable[[Evidence], Witness]] = {
    general.starts_connected: _split_at_start,
    general.stays_connected: _first_split,
    general.no_link_lost: _first_break,
    general.switching_stops: _last_switch,
    general.crossings_transversal: _slowest_crossing,
    general.linked_apart: _closest_linked,
    general.all_apart: _closest,
    general.energy_rise: _largest_rise,
    general.ledger_residual: _worst_residual,
    general.velocities_agree: _odd_velocity,
    general.momentum_drift: _fastest_agent,
    general.forces_vanish: _unbalanced,
}
"""By the function that measures a claim, so that claims of papers that measure the same find theirs here."""
