"""A scenario with a later end."""

from __future__ import annotations

import numpy as np

from flocking.model.law import Scenario

ROUNDING = 1e-6
"""Share of the distance of frames within which a frame would coincide with the end, but for rounding."""


def longer(scenario: Scenario, t_end: float) -> Scenario:
    """The same scenario with the end ``t_end``, and further frames at the same mean distance.

    With its own end it is returned unchanged.
    """
    if t_end == scenario.t_end:
        return scenario
    times = scenario.frame_times
    each = float(times[-1] - times[0]) / (len(times) - 1) if len(times) > 1 else scenario.t_end - scenario.start.t
    more = np.arange(scenario.t_end, t_end, each)
    more = more[(more > times[-1]) & (more < t_end - ROUNDING * each)]
    return scenario.with_(t_end=t_end, frames=(*(float(t) for t in (*times, *more)), float(t_end)))
