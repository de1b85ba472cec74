"""By how much an agent sees another one, or does not, by the rule of a graph."""

from __future__ import annotations

import math

import numpy as np

from flocking.arrays import Array
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.graphs.views import FieldOfView


def margin_of(graph: Graph, headings: Array | None, agent: int, linked: bool, offset: Array) -> tuple[float, float]:
    """How far another agent is from where a link switches, and the radius.

    Parameters
    ----------
    graph
        The graph.
    headings
        Headings of the agents, where there are some.
    agent
        Who senses.
    linked
        Whether it is linked with the other one so far.
    offset
        Displacement to where it assumes the other one to be, shape (m,).

    Returns
    -------
    tuple
        A length, positive where they are linked now; and the radius beyond which they are not.
    """

    def own(value: float | Array) -> float:
        return float(value if np.ndim(value) == 0 else np.asarray(value)[agent])

    distance = math.hypot(*offset)
    if isinstance(graph, FieldOfView):
        assert headings is not None
        heading = np.asarray(headings)[agent]
        ahead = [math.cos(heading), math.sin(heading)] if np.ndim(heading) == 0 else heading[:, 0]
        radius, angle = own(graph.radius), own(graph.half_angle)
        along = sum(float(a) * float(b) for a, b in zip(offset, ahead, strict=True))
        return min(radius - distance, along - math.cos(angle) * distance), radius
    radius = own(graph.break_radius if linked else graph.appear_radius)
    return radius - distance, radius
