"""How agents look under each graph of a law, along constant headings or a column of the bodies, and whom they see."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flocking.engine.exact.crossings.turning_view_guards import TurningView
from flocking.engine.exact.crossings.view_guards import ConstantView, ViewGuard
from flocking.model.bodies.body import Body
from flocking.model.graphs.connectivity import Links
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.graphs.seen_headings import links_at_state
from flocking.model.graphs.views import FieldOfView
from flocking.model.space import Space
from flocking.model.state import State


def links_of_graphs(graphs: Sequence[Graph], space: Space, state: State, bodies: Body | None) -> list[Links]:
    """Links of each graph by its initial rule, shape (N, N) each.

    Parameters
    ----------
    graphs, space
        Graphs of the law, and the space of the agents.
    state
        Where they are.
    bodies
        What they are; None if no graph uses their headings.
    """
    headings = None if bodies is None else bodies.headings
    return [np.array(links_at_state(g, space, state, headings)) for g in graphs]


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
    if graph.along_velocity:
        return TurningView(n * m, n, m, graph.cosines(n), unit=False)
    widths = bodies.widths(m)
    before = list(widths).index(graph.heading_column)
    # State vectors hold positions, velocities of agents that have some, and then the further columns in order.
    first = n * (bodies.order * m + sum(list(widths.values())[:before]))
    return TurningView(first, n, m, graph.cosines(n))
