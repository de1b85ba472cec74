"""A scenario with a later end."""

from __future__ import annotations

import numpy as np

from flocking.model.law import Scenario


def longer(scenario: Scenario, t_end: float) -> Scenario:
    """The same scenario with a later end, and frames at the same mean distance on to it.

    Parameters
    ----------
    t_end
        The end. The scenario itself comes back for its own.
    """
    if t_end == scenario.t_end:
        return scenario
    times = scenario.frame_times
    each = float(times[-1] - times[0]) / (len(times) - 1) if len(times) > 1 else scenario.t_end - scenario.start.t
    more = np.arange(scenario.t_end, t_end, each)
    more = more[(more > times[-1]) & (more < t_end - 1e-6 * each)]
    return scenario.with_(t_end=t_end, frames=(*(float(t) for t in (*times, *more)), float(t_end)))
