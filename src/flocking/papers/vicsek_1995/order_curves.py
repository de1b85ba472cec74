"""The order parameter of groups over time, and its mean at several noises."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from flocking.engine.discrete.heading_updates import why_not
from flocking.engine.driver.simulate import start
from flocking.model.checks import Array, integer
from flocking.model.law import Scenario
from flocking.model.state import State
from flocking.papers.vicsek_1995 import system
from flocking.papers.vicsek_1995.large_groups import HeadingGroup

NOISES = tuple(float(x) for x in np.linspace(0.0, 5.0, 6))
"""Noises at which the curves of Fig. 2a are computed."""

CURVES = system.FIGURE_2
"""Groups whose curves are drawn."""

SETTLING, AVERAGED = 200, 400
"""Updates before the order parameter is averaged, and over which it is."""

MANY = 1000
"""Number of agents from which on a group begins with equal headings; from random ones it orders in thousands of
updates."""


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


def begun(agents: int, side: float, noise: float) -> Scenario:
    """A group at random places; with random headings up to `MANY` agents, with equal ones beyond.

    Parameters
    ----------
    agents, side, noise
        N, L and eta.
    """
    made = system.group(agents, side, noise)
    if agents < MANY:
        return made
    return made.with_(start=State(made.start.q, np.tile([system.SPEED, 0.0], (agents, 1))))


@lru_cache(maxsize=64)
def mean_order(agents: int, side: float, noise: float) -> float:
    """Mean of v_a after it has settled.

    Parameters
    ----------
    agents, side, noise
        N, L and eta.
    """
    made = begun(agents, side, noise)
    if why_not(made):
        return float(order_series(made, SETTLING + AVERAGED)[SETTLING:].mean())
    group = HeadingGroup(made, threads=1)
    group.update(SETTLING)
    total = 0.0
    for _ in range(AVERAGED):
        group.update()
        total += group.order
    return total / AVERAGED
