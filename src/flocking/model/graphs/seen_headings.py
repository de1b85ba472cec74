"""The headings that a graph uses: constant ones of the agents, a direction that turns with them, or velocities."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import Array
from flocking.model.graphs.connectivity import Links
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.graphs.views import VELOCITY, HeadingGraph
from flocking.model.space import Space


class Placed(Protocol):
    """What is read of a state."""

    @property
    def q(self) -> Array:
        """Positions, shape (N, m)."""

    @property
    def p(self) -> Array:
        """Velocities, shape (N, m)."""

    @property
    def columns(self) -> Mapping[str, Array]:
        """Further columns by name, shape (N, width) each."""


class LinkedState(Placed, Protocol):
    """What is read of a state that may give links."""

    @property
    def links(self) -> Links | None:
        """Links of the law's own graph, shape (N, N)."""


def heading_column(graph: Graph) -> str:
    """Name of the column of the bodies, or of the velocities, that a graph uses; empty where it uses none."""
    return graph.heading_column if isinstance(graph, HeadingGraph) else ""


def body_directions(graphs: Sequence[Graph]) -> list[str]:
    """Names of the directions of bodies that ``graphs`` use, in order; velocities are none."""
    return sorted({heading_column(graph) for graph in graphs} - {"", VELOCITY})


def seen_headings(graph: Graph, headings: Array | None, state: Placed) -> Array | None:
    """Headings that ``graph`` uses at a state.

    Parameters
    ----------
    graph
        The graph.
    headings
        Constant headings of the agents, as in `Agents`.
    state
        Their velocities, and the columns that turn with them.

    Returns
    -------
    Array or None
        The column that the graph names, unit vectors of shape (N, m), or the velocities; else ``headings``.

    Raises
    ------
    InvalidInput
        If the state lacks that column.
    """
    name = heading_column(graph)
    if not name:
        return headings
    if name == VELOCITY:
        return state.p
    columns = state.columns
    if name not in columns:
        raise InvalidInput(
            type(graph).__name__, "heading_column", f"must be a column of the state, which has: "
            f"{', '.join(columns) or 'none'}", name, "Give the state its columns, or take the state of a run.",
        )  # fmt: skip
    return columns[name]


def links_at_state(graph: Graph, space: Space, state: Placed, headings: Array | None) -> Links:
    """Links of ``graph`` by its initial rule at a state, shape (N, N).

    Parameters
    ----------
    graph, space
        The graph, and the space of the agents.
    state
        Their positions and velocities, and the columns that turn with them.
    headings
        Constant headings of the agents, as in `Agents`.

    Raises
    ------
    InvalidInput
        If the state lacks a column that the graph uses, or the graph does not support the space.
    """
    return graph.links_in(space, state.q, seen_headings(graph, headings, state))


def links_of_graphs(graphs: Sequence[Graph], space: Space, state: LinkedState, headings: Array | None) -> list[Links]:
    """Links of each of the ``graphs`` of a law at a state, shape (N, N) each: those that it gives, else by the rule.

    Parameters
    ----------
    graphs, space
        The graphs, the law's own first, and the space of the agents.
    state
        Where they are, with the links of the law's own graph if it gives any.
    headings
        Constant headings of the agents, as in `Agents`.

    Raises
    ------
    InvalidInput
        As `links_at_state`.
    """
    given = [] if state.links is None else [np.asarray(state.links)]
    return [*given, *(links_at_state(graph, space, state, headings) for graph in graphs[len(given) :])]
