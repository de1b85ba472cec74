"""Values of the parameters of a law of which one agent has met some others."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array
from flocking.engine.kernels.layout import Layout
from flocking.model.graphs.weights import MatrixWeights
from flocking.model.law import Law
from flocking.model.state import Agents
from flocking.model.terms.schedules import Schedule


def known_slots(
    law: Law, layout: Layout, agent: int, count: int, body: tuple[float, float], t: float, headings: Array | None
) -> tuple[Array, Array, Array]:
    """Parameter arrays up to the largest index that the agent has met.

    Parameters
    ----------
    law, layout
        The law, and its slots.
    agent
        Which agent it is.
    count
        One more than the largest index that it has met.
    body
        Its mass and its damping.
    t
        Time.
    headings
        Headings of all agents, where a graph weighs by them.
    """
    sizes = [
        len(value.values if isinstance(value, MatrixWeights) else np.atleast_1d(value))
        for _, owned in layout.owners()
        for given in owned.values()
        if isinstance(value := given.at(t) if isinstance(given, Schedule) else given, MatrixWeights | np.ndarray)
    ]
    total = max([count, *sizes, 0 if headings is None else len(headings)])
    masses, dampings = np.ones(total), np.zeros(total)
    masses[agent], dampings[agent] = body
    return layout.values(Agents(masses, dampings, headings=headings), total, t)
