"""Links that a state gives, in engines that take links from the graph: they must be those that it has there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flocking.arrays import Links
from flocking.errors import UnsupportedLaw
from flocking.model.graphs.contradicting_links import contradicting_links
from flocking.model.graphs.distance_graphs import Graph, pair_distances
from flocking.model.graphs.seen_headings import links_at_state
from flocking.model.graphs.smooth_cones import SmoothCone
from flocking.model.graphs.views import Cone, FieldOfView
from flocking.model.law import Scenario
from flocking.model.state import State

PASSED = 0.01
"""How far beyond its distance a pair may be, as a share of it, before its link contradicts that: in states of these
engines pairs have passed it by up to a step."""


def check_given_links(engine: str, scenario: Scenario, state: State | None = None) -> None:
    """Refuse links of a state that are others than those of the graph there.

    Parameters
    ----------
    engine
        The engine, for the message.
    scenario
        The law and the space.
    state
        The state; the start when absent.

    Raises
    ------
    UnsupportedLaw
        When links of a graph whose links never change are others, or links by distances contradict these: other
        engines keep them until the pair crosses its distance, and this one takes those of the graph at once.
    """
    graph, given = scenario.law.graph, (scenario.start if state is None else state)
    if given.links is None:
        return
    if not graph.moves:
        wrong = np.argwhere(given.links != links_at_state(graph, scenario.space, given, scenario.agents.headings))
    elif graph.follows_radii:
        distance = pair_distances(given.q, scenario.space)
        wrong = np.argwhere(contradicting_links(graph, given.links, distance, PASSED))
    elif isinstance(graph, FieldOfView | Cone | SmoothCone):
        least, most = (_links_of(graph, scenario, given, 1.0 + share) for share in (-PASSED, PASSED))
        wrong = np.argwhere((least & ~given.links) | (given.links & ~most))
    else:
        return
    if wrong.size:
        raise UnsupportedLaw(
            f"engine={engine!r} takes the links of {type(graph).__name__} from the graph, and the links of the state "
            f"differ from it for agents {int(wrong[0][0])} and {int(wrong[0][1])}. Leave links out of the state, give "
            "a fixed graph of these links, or use an engine that keeps them, such as engine='exact'."
        )


def _links_of(graph: FieldOfView | Cone | SmoothCone, scenario: Scenario, state: State, factor: float) -> Links:
    """Links where radii and half angles are larger by a factor; the opening of a cone is the same at all times."""
    if isinstance(graph, SmoothCone):
        wider: Graph = replace(graph, radius=factor * graph.radius)
        return links_at_state(wider, scenario.space, state, scenario.agents.headings)
    if isinstance(graph, Cone):
        wider = replace(graph, radius=factor * np.asarray(graph.radius))
        return links_at_state(wider, scenario.space, state, scenario.agents.headings)
    angles = np.minimum(factor * np.asarray(graph.half_angle), np.pi)
    wider = FieldOfView(factor * np.asarray(graph.radius), angles, graph.heading_column)
    return links_at_state(wider, scenario.space, state, scenario.agents.headings)
