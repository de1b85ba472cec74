"""The order parameter of groups over time, and its mean at several noises."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from flocking.engine.driver.simulate import start
from flocking.model.checks import Array, integer
from flocking.model.law import Scenario
from flocking.papers.vicsek_1995 import system

NOISES = tuple(float(x) for x in np.linspace(0.0, 5.0, 6))
"""Noises at which the curves of Fig. 2a are computed."""

CURVES = system.FIGURE_2[:3]
"""Groups whose curves are drawn; the larger ones take minutes."""

SETTLING, AVERAGED = 200, 400
"""Updates before the order parameter is averaged, and over which it is."""


def order_series(scenario: Scenario, updates: int) -> Array:
    """V_a after each of the first updates of a scenario, shape (updates,); frames are not kept.

    Parameters
    ----------
    scenario
        A scenario of this package.
    updates
        Number of updates; the scenario may end before.
    """
    count = integer("order_series", "updates", updates, least=1)
    session = start(scenario.with_(frames=1), engine="discrete")
    found = np.empty(count)
    for k in range(count):
        session.advance(scenario.start.t + (k + 1) * system.STEP)
        p = session.state.p
        found[k] = np.linalg.norm(p.sum(axis=0)) / np.linalg.norm(p, axis=1).sum()
    return found


@lru_cache(maxsize=64)
def mean_order(agents: int, side: float, noise: float) -> float:
    """Mean of v_a after it has settled.

    Parameters
    ----------
    agents, side, noise
        N, L and eta.
    """
    series = order_series(system.group(agents, side, noise), SETTLING + AVERAGED)
    return float(series[SETTLING:].mean())
