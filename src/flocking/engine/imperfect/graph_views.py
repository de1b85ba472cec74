"""How agents look under each graph of a law: along constant headings, by cones, or along what turns with them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from flocking.arrays import Array, Links
from flocking.engine.imperfect.cone_switches import ConeView, cone_view
from flocking.engine.imperfect.constant_views import constant_view_events
from flocking.engine.imperfect.pair_polynomials import Paths
from flocking.engine.imperfect.turning_views import MovingView, TurningView
from flocking.engine.imperfect.view_switches import View
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.graphs.smooth_cones import SmoothCone
from flocking.model.graphs.views import VELOCITY, Cone, FieldOfView

CONES = (Cone, SmoothCone)
"""Graphs whose links are those of a radius between agents whose headings differ little enough."""

GraphView = View | ConeView | TurningView
"""The fields of view or cones of one graph."""


def views_of(graphs: Sequence[Graph], headings: Array | None, q: Array) -> dict[int, GraphView]:
    """The fields of view and cones of those graphs that have some, by number.

    Parameters
    ----------
    headings
        Those of the agents; they must be given where a graph has fields of view along constant headings.
    q
        Positions at the start, shape (N, m).
    """
    n = len(q)
    found: dict[int, GraphView] = {}
    for k, graph in enumerate(graphs):
        if isinstance(graph, CONES):
            found[k] = cone_view(graph, headings, n)
        elif isinstance(graph, FieldOfView):
            radii = np.broadcast_to(np.asarray(graph.radius, dtype=np.float64), n).copy()
            if graph.heading_column:
                found[k] = TurningView(graph.heading_column, graph.cosines(n), radii)
            else:
                found[k] = View(np.ascontiguousarray(graph.directions(headings)), graph.cosines(n), radii)
    return found


def view_from(view: GraphView, headings: Callable[[str], Array]) -> View | ConeView | MovingView:
    """The same ``view`` from a moment on, until the motion changes.

    Parameters
    ----------
    headings
        Gives the Taylor coefficients of a column about that moment by its name, shape (terms, N, m).
    """
    return view.along(headings(view.column)) if isinstance(view, TurningView) else view


def turns_with_bodies(view: GraphView | None) -> bool:
    """Whether agents look under a ``view`` along a column of their bodies, which they know at once."""
    return isinstance(view, TurningView) and view.column != VELOCITY


def with_bodies(views: Mapping[int, GraphView], columns: Callable[[], Mapping[str, Array]]) -> dict[int, GraphView]:
    """The same ``views``, those along directions of the bodies as they are at a moment: whoever looks knows them.

    Parameters
    ----------
    columns
        Gives the columns of the bodies at that moment by name, shape (N, width) each.
    """
    return {
        k: view.looking(columns()[view.column]) if isinstance(view, TurningView) and turns_with_bodies(view) else view
        for k, view in views.items()
    }


def views_now(views: Mapping[int, GraphView], headings: Callable[[str], Array]) -> dict[int, View | ConeView]:
    """The same ``views`` at a moment.

    Parameters
    ----------
    headings
        Gives the vectors of a column at that moment by its name, shape (N, m), as agents look along them.
    """
    return {
        k: view.looking(headings(view.column)) if isinstance(view, TurningView) else view for k, view in views.items()
    }


def view_events(
    paths: Paths, length: Array, changed: Links, near: Links, view: View | ConeView | MovingView, size: float
) -> Array:
    """Rows (time, i, j) of all changes of what agents see, in order of time.

    Parameters
    ----------
    paths, length, changed, near, size
        As for `flocking.engine.imperfect.constant_views.find_view_events`.
    view
        The fields of view or cones.
    """
    if isinstance(view, View):
        return constant_view_events(paths, length, changed, near, view, size)
    return view.events(paths, length, changed, near, size)
