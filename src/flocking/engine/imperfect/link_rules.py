"""When true links switch: distances at which they appear and break, and whether pairs sense each other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flocking.arrays import Array, Indices, Links, Numbers
from flocking.model.graphs.distance_graphs import Graph


class LinkRules(NamedTuple):
    """When true links switch.

    Parameters
    ----------
    ways
        Of each graph: 0 where its links never change, or not by distances alone, 1 where both agents of a pair sense
        each other, 2 where they may differ; shape (graphs,).
    appear, break_
        Distances of each graph and sensing agent, shape (graphs, N).
    """

    ways: Numbers
    appear: Array
    break_: Array

    def followed(self, graph: int, links: Links, distance: Array, agents: Indices | slice = slice(None)) -> Links:
        """Links of ``agents`` of one ``graph`` after their distances have become what they are.

        Parameters
        ----------
        links, distance
            Their links before, and their distances from all others, shape (agents, N).
        """
        enter, leave = self.appear[graph, agents][:, None], self.break_[graph, agents][:, None]
        return np.where(links, distance < leave, distance < enter)


def link_rules(graphs: Sequence[Graph], n: int) -> LinkRules:
    """The rules of ``graphs`` of ``n`` agents."""
    levels = [
        [np.broadcast_to(np.asarray(x, dtype=np.float64), n) for x in (g.appear_radius, g.break_radius)] for g in graphs
    ]
    follows = [g.moves and not g.sees_headings for g in graphs]
    ways = np.array([(2 if g.directed else 1) if f else 0 for g, f in zip(graphs, follows, strict=True)], np.int64)
    return LinkRules(ways, np.array([a for a, _ in levels]), np.array([b for _, b in levels]))


def known_rules(rules: LinkRules, graphs: Sequence[Graph]) -> LinkRules:
    """The ``rules`` of ``graphs`` for distances at single moments: at the radius of a closed graph there is a link.

    Where motions are followed a link switches as its distance passes the radius, and stays what it is at the radius.
    """
    closed = np.array([bool(getattr(graph, "closed", False)) for graph in graphs])[:, None]
    appear, break_ = (np.where(closed, np.nextafter(x, np.inf), x) for x in (rules.appear, rules.break_))
    return LinkRules(rules.ways, appear, break_)
