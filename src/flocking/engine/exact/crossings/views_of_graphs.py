"""How agents look under each graph of a law: along constant headings, a column of the bodies, or velocities."""

from __future__ import annotations

from collections.abc import Sequence

from flocking.engine.adaptive_steps.state_vectors import place_of
from flocking.engine.exact.crossings.turning_view_guards import TurningView
from flocking.engine.exact.crossings.view_guards import ConstantView, ViewGuard
from flocking.model.bodies.body import Body
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.graphs.views import FieldOfView


def views_of(graphs: Sequence[Graph], bodies: Body | None, n: int, m: int) -> list[ViewGuard | None]:
    """The fields of view of each graph; None for graphs without.

    Parameters
    ----------
    graphs
        Graphs of the law.
    bodies
        What the agents are; None if no graph uses their headings.
    n, m
        Number of agents and of axes.
    """
    return [_view_of(graph, bodies, n, m) if isinstance(graph, FieldOfView) else None for graph in graphs]


def _view_of(graph: FieldOfView, bodies: Body | None, n: int, m: int) -> ViewGuard:
    if bodies is None or not graph.heading_column:
        return ConstantView(graph.directions(None if bodies is None else bodies.headings), graph.cosines(n))
    first = place_of(graph.heading_column, bodies.order, n, m, bodies.widths(m))
    return TurningView(first, n, m, graph.cosines(n), unit=not graph.along_velocity)
