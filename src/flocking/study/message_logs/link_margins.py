"""Margin by which another agent is in view or not, by the rule of a graph."""

from __future__ import annotations

import math

import numpy as np

from flocking.arrays import Array
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.graphs.seen_headings import heading_column
from flocking.model.graphs.smooth_cones import SmoothCone
from flocking.model.graphs.views import Cone, FieldOfView, view_cosines

SAME_HEADING = 1e-12
"""Differences of headings this close to the opening of a cone are decided by rounding, some units of 2.2e-16."""


def radii_of(graph: Graph, n: int) -> tuple[Array, Array]:
    """Radii of each of ``n`` agents below which links appear and beyond which they break, shape (n, 1) each.

    Parameters
    ----------
    graph
        The graph.
    n
        Number of agents.
    """
    enter, leave = (
        np.broadcast_to(np.asarray(r, dtype=np.float64), n)[:, None] for r in (graph.appear_radius, graph.break_radius)
    )
    return enter, leave


def margin_of(
    graph: Graph, headings: Array | None, pair: tuple[int, int], linked: bool, offset: Array, looks: Array
) -> tuple[float, float]:
    """How far another agent is from where a link switches, and the radius.

    Parameters
    ----------
    graph
        The graph.
    headings
        Headings of the agents, where there are some.
    pair
        Who senses, and the other one.
    linked
        Whether they are linked so far.
    offset
        Displacement to where it assumes the other one to be, shape (m,).
    looks
        Along what it looks where that turns: the velocity that it takes to be its own, or a direction of its body.

    Returns
    -------
    tuple
        A length, positive where they are linked now; and the radius beyond which they are not. Outside a cone it is
        minus infinity, and zero where rounding decides on it.
    """
    agent, other = pair

    def own(value: float | Array) -> float:
        return float(value if np.ndim(value) == 0 else np.asarray(value)[agent])

    distance = math.hypot(*offset)
    if isinstance(graph, FieldOfView):
        radius, angle = own(graph.radius), own(graph.half_angle)
        if graph.heading_column:
            length = math.hypot(*looks)
            if length == 0.0:
                return radius - distance, radius
            ahead = [float(x) / length for x in looks]
        else:
            assert headings is not None
            heading = np.asarray(headings)[agent]
            ahead = [math.cos(heading), math.sin(heading)] if np.ndim(heading) == 0 else heading[:, 0]
        along = sum(float(a) * float(b) for a, b in zip(offset, ahead, strict=True))
        return min(radius - distance, along - float(view_cosines(angle)) * distance), radius
    if isinstance(graph, Cone | SmoothCone):
        assert headings is not None
        radius, opening = own(graph.radius), own(graph.opening)
        spare = opening - _apart(graph.measure, headings[agent], headings[other])
        if abs(spare) <= SAME_HEADING:
            return min(0.0, radius - distance), radius
        return (radius - distance if spare > 0.0 else -math.inf), radius
    radius = own(graph.break_radius if linked else graph.appear_radius)
    return radius - distance, radius


def doubt_of(graph: Graph, offset: Array, looks: Array, off: float) -> float:
    """By how much the margin of `margin_of` is uncertain because an agent looks along what is.

    Parameters
    ----------
    graph
        The graph.
    offset, looks
        As for `margin_of`.
    off
        By how much each coordinate of that may be off.
    """
    distance, length, error = math.hypot(*offset), math.hypot(*looks), math.sqrt(len(looks)) * off
    if not heading_column(graph) or error == 0.0 or distance == 0.0:
        return 0.0
    return 2.0 * distance * (error / length if length > error else math.inf)


def _apart(measure: str, one: Array, other: Array) -> float:
    """By how much two headings differ, angles or rotation matrices (Olfati-Saber 2003, (5) and (6))."""
    if np.ndim(one):
        return 0.5 * float(np.trace(np.eye(len(one)) - other.T @ one))
    gap = float(other) - float(one)
    if measure == "rotation":
        return 1.0 - math.cos(gap)
    return abs(math.remainder(gap, 2.0 * math.pi)) if measure == "wrapped" else abs(gap)
