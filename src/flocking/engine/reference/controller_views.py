"""Which near agents are in view of the agent of a controller: by headings, and by where they are."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array, Indices, Mask
from flocking.errors import InvalidInput
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.graphs.smooth_cones import SmoothCone
from flocking.model.graphs.views import VELOCITY, Cone, FieldOfView, check_rotations


class ControllerView:
    """The field of view, or the cone, of one agent under a graph.

    Parameters
    ----------
    graph
        The graph.
    agent
        Number of the agent.
    headings
        Constant headings of all agents, as in `Agents`; None where the agent looks along its velocity or its body.
    shape
        Number of agents, and of axes.

    Raises
    ------
    InvalidInput
        When there are no headings of all agents, or they are no directions in these axes, or cannot be compared so.
    """

    def __init__(
        self, graph: Cone | SmoothCone | FieldOfView, agent: int, headings: Array | None, shape: tuple[int, int]
    ) -> None:
        count, axes = shape
        self._similar: Mask | None = None
        self._direction: Array | None = None
        self.along_body = isinstance(graph, FieldOfView) and graph.heading_column not in ("", VELOCITY)
        """Whether the agent looks along a direction of its body, which each call must state."""
        self._cosine = 0.0
        if not isinstance(graph, FieldOfView):
            others = np.arange(count)
            found = graph.checked_headings(headings, count)
            if found.ndim > 1:
                check_rotations(found, graph.measure)
            self._similar = graph.similar(found, np.full(count, agent), others)
            return
        self._cosine = float(graph.cosines(count)[agent])
        if not graph.heading_column:
            self._direction = graph.directions(graph.checked_headings(headings, count))[agent]
            if self._direction.shape != (axes,):
                raise InvalidInput(
                    "FieldOfView", "headings", f"must be directions in {axes} dimensions", len(self._direction),
                    "Give angles in the plane and rotation matrices elsewhere.",
                )  # fmt: skip

    def holds(self, who: Indices, offset: Array, distance: Array, moving: Array, facing: Array) -> Mask:
        """Which others are in view, shape (k,).

        Parameters
        ----------
        who
            Their numbers, shape (k,).
        offset
            Their positions less that of the agent, shape (k, m).
        distance
            How far away they are, shape (k,).
        moving, facing
            Velocity of the agent, and the direction of its body, a unit vector where it looks along that; shape (m,).
        """
        if self._similar is not None:
            return self._similar[who]
        direction = facing if self.along_body else self._direction
        if direction is None:
            fastest = float(np.abs(moving).max())
            if fastest == 0.0:
                return np.ones(len(who), dtype=bool)
            direction = moving / fastest
            direction = direction / np.sqrt((direction**2).sum())
        ahead = (offset * direction).sum(axis=1)
        return np.asarray(ahead >= self._cosine * distance)


def is_known_view(graph: Graph) -> bool:
    """Whether an agent by itself knows who is in view under a graph that reads headings.

    A class of a user may link others than these do.

    Parameters
    ----------
    graph
        The graph.
    """
    if isinstance(graph, FieldOfView):
        return type(graph) is FieldOfView
    return type(graph) in (Cone, SmoothCone)


def controller_view(graph: Graph, agent: int, headings: Array | None, shape: tuple[int, int]) -> ControllerView | None:
    """The view of an agent under a graph; None where all that are near enough are in view.

    Parameters
    ----------
    graph, agent, headings, shape
        As for `ControllerView`.

    Raises
    ------
    InvalidInput
        When the links of the graph follow from something else, such as a rule of its own.
    """
    if is_known_view(graph):
        assert isinstance(graph, Cone | SmoothCone | FieldOfView)
        return ControllerView(graph, agent, headings, shape)
    if graph.sees_headings or (graph.moves and not graph.follows_radii):
        raise InvalidInput("Controller", "law", "must link by distances or fields of view", type(graph).__name__)
    return None
