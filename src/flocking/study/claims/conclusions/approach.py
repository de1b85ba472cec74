"""Claims about how close agents come to each other."""

from __future__ import annotations

import numpy as np

from flocking.engine.runs.run import Closest
from flocking.formula.safe_digits import given_text, rounded_down
from flocking.model.world.safety_filters import ROUNDING, SafetyFilter
from flocking.study.claims.claim import Measure, above
from flocking.study.claims.subjects import Subject, Witness, about
from flocking.study.evidence import Evidence, NotMeasurable


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
        return _at_one_point(e, *together[0])
    c = e.closest_linked
    if np.isfinite(c.distance):
        return _apart(e, c)
    # Links that never change need no motion to be known.
    if not e.law.graph.moves:
        return Measure(np.inf, 0.0, "no linked pair")
    return Measure(np.inf, e.error_of(c), "no linked pair", absent=e.beyond_radius())


@about(Subject.CLOSEST, _closest, lasting=True)
def all_apart(e: Evidence) -> Measure:
    """Closest approach ever of any two agents."""
    if e.coincidences:
        return _at_one_point(e, *e.coincidences[0])
    return _apart(e, e.closest)


@about(Subject.CLOSEST, _closest, lasting=True)
def safe_distance_kept(e: Evidence) -> Measure:
    """Closest approach ever of any two agents against the distance of the safety filter, up to its rounding."""
    control = e.run.scenario.control
    if not isinstance(control, SafetyFilter):
        raise NotMeasurable("no safety filter is declared")
    c = e.closest
    note = f"closest {c.distance:.9g}, the filter keeps {given_text(control.distance)}"
    # At every tick the filter begins anew with the states as they were computed: earlier errors do not add up.
    error = c.error if np.isfinite(c.error) else e.error_of(c)
    return above(c.distance, control.distance * (1.0 - ROUNDING), note, error)


def _entered(e: Evidence) -> Witness:
    found = e.nearest_obstacle
    return Witness(found.time, (found.agent,))


@about(Subject.NET, _entered, lasting=True)
def outside_obstacles(e: Evidence) -> Measure:
    """Smallest signed distance ever of an agent from an obstacle."""
    found = e.nearest_obstacle
    where = f"at t = {e.when(found.time, 3)} (agent {found.agent})"
    if found.at_samples + found.off <= 0.0:
        # However agents moved between frames, one is inside there.
        return above(found.at_samples, 0.0, f"{-found.at_samples:.4g} inside an obstacle {where}", found.off)
    note = f"closest {found.distance:.4g} to an obstacle"
    if found.distance < found.at_samples:
        note += f"; at frames {found.at_samples:.4g}"
        if found.error >= abs(found.distance):
            # What agents could have done between frames is no measurement.
            seen, possible = f"{found.at_samples:.4g} to an obstacle at frames", f"{found.distance:.4g} is possible"
            note = f"closest {seen}; between them {possible}"
    return above(found.distance, 0.0, f"{note}, {where}", found.error)


def needs_obstacles(e: Evidence) -> str:
    """Why no obstacle is to be kept clear of: none is declared."""
    return "" if e.obstacles else "no obstacle is declared"


def needs_filter(e: Evidence) -> str:
    """Why no distance is to be kept: there is no safety filter."""
    return "" if isinstance(e.run.scenario.control, SafetyFilter) else "no safety filter is declared"


def _apart(e: Evidence, c: Closest) -> Measure:
    note = "one agent alone" if e.run.n == 1 else f"no pair closer than {rounded_down(c.distance, 4)}"
    if c.pair[0] >= 0:
        note = f"closest {c.distance:.4g} at t = {e.when(c.time, 3)} (agents {c.pair[0]}, {c.pair[1]})"
    if (agents := e.run.scenario.agents).summary and agents.ideal:
        note += f"; of {agents.summary}"
    return above(c.distance, 0.0, note, e.error_of(c))


def _at_one_point(e: Evidence, time: float, pair: tuple[int, int]) -> Measure:
    """Two agents given at one point are not apart, whatever the error of the motion."""
    return Measure(0.0, 0.0, f"agents {pair[0]} and {pair[1]} are at one point at t = {e.when(time, 3)}")
