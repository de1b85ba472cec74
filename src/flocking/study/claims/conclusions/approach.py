"""Claims about how close agents come to each other."""

from __future__ import annotations

import numpy as np

from flocking.study.claims.claim import Measure, above
from flocking.study.claims.subjects import Subject, Witness, about
from flocking.study.evidence import Evidence


def _closest_linked(e: Evidence) -> Witness:
    c = e.run.closest_linked
    return Witness(c.time, c.pair)


def _closest(e: Evidence) -> Witness:
    c = e.run.closest
    return Witness(c.time, c.pair)


@about(Subject.CLOSEST, _closest_linked, lasting=True)
def linked_apart(e: Evidence) -> Measure:
    """Closest approach ever of two linked agents."""
    together = [found for found in e.coincidences if e.linked_together(*found)]
    if together:
        return _at_one_point(*together[0])
    c = e.closest_linked
    if not np.isfinite(c.distance):
        return Measure(np.inf, 0.0, "no linked pair")
    error = e.error_of(c)
    return above(
        c.distance, 0.0, f"closest {c.distance:.4g} at t = {c.time:.3g} (agents {c.pair[0]}, {c.pair[1]})", error
    )


@about(Subject.CLOSEST, _closest, lasting=True)
def all_apart(e: Evidence) -> Measure:
    """Closest approach ever of any two agents."""
    if e.coincidences:
        return _at_one_point(*e.coincidences[0])
    c = e.closest
    error = e.error_of(c)
    if c.pair[0] < 0:
        return above(c.distance, 0.0, f"no pair closer than {c.distance:.4g}", error)
    return above(
        c.distance, 0.0, f"closest {c.distance:.4g} at t = {c.time:.3g} (agents {c.pair[0]}, {c.pair[1]})", error
    )


def _at_one_point(time: float, pair: tuple[int, int]) -> Measure:
    """Two agents that are given at one point are not apart, whatever the error of the motion."""
    return Measure(0.0, 0.0, f"agents {pair[0]} and {pair[1]} are at one point at t = {time:.3g}")
