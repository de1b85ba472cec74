"""Claims about how close agents come to each other."""

from __future__ import annotations

import numpy as np

from flocking.study.claims import Measure, above
from flocking.study.evidence import Evidence


def linked_apart(e: Evidence) -> Measure:
    """Closest approach ever of two linked agents."""
    c = e.closest_linked
    if not np.isfinite(c.distance):
        return Measure(np.inf, 0.0, "no linked pair")
    error = e.approach_error
    return above(
        c.distance, 0.0, f"closest {c.distance:.4g} at t = {c.time:.3g} (agents {c.pair[0]}, {c.pair[1]})", error
    )


def all_apart(e: Evidence) -> Measure:
    """Closest approach ever of any two agents."""
    c = e.closest
    error = e.approach_error
    if c.pair[0] < 0:
        return above(c.distance, 0.0, f"no pair closer than {c.distance:.4g}", error)
    return above(
        c.distance, 0.0, f"closest {c.distance:.4g} at t = {c.time:.3g} (agents {c.pair[0]}, {c.pair[1]})", error
    )
