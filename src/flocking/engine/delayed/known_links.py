"""When links switch that follow what an agent knows of another: its distance, and whether it is in view."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from flocking.arrays import Array, Links, Numbers
from flocking.engine.imperfect.cone_switches import ConeView
from flocking.engine.imperfect.constant_views import add_view_changes
from flocking.engine.imperfect.graph_views import GraphView
from flocking.engine.imperfect.link_rules import LinkRules
from flocking.engine.imperfect.pair_polynomials import (
    ROUNDING,
    Paths,
    nearest_offset,
    paths_in,
    reach_within,
    too_many_images,
)
from flocking.engine.imperfect.pair_switches import TwoPaths, WatchedLink, add_switches
from flocking.engine.imperfect.turning_views import MovingView, add_turning_changes, turning_paths
from flocking.engine.imperfect.view_switches import Looking, View
from flocking.engine.kernels.bernstein import all_rows
from flocking.errors import SimulationError
from flocking.formula.native.functions import native_apart
from flocking.model.space import Space


@native_apart
def find_known_switches(
    paths: Paths, span: float, links: Links, ways: Numbers, enter: Array, leave: Array, size: float, found: Array
) -> int:
    """Fill rows (time, i, j, graph) of all switches of what agents know within a time; -1 for too many images.

    Parameters
    ----------
    paths
        How the agents move, 0 to N - 1, and what is known of each, N to 2 N - 1.
    span
        How long from now on.
    links
        Links by what agents know, shape (graphs, N, N).
    ways, enter, leave
        See `flocking.engine.imperfect.link_rules.LinkRules`.
    size
        Size of the coordinates, for rounding.
    found
        Takes the rows, shape (room, 4).
    """
    n, total = paths.S.shape[1] // 2, 0
    nearest = np.empty(paths.S.shape[2])
    for i in range(n):
        for j in range(n):
            if i == j:
                continue
            distance, reach = nearest_offset(paths, i, n + j, nearest), reach_within(paths, i, n + j, span)
            two = TwoPaths(i, n + j, span, distance, reach)
            for graph in range(links.shape[0]):
                if ways[graph] == 0:
                    continue
                link = WatchedLink(links[graph, i, j], enter[graph, i], leave[graph, i], i, j, graph)
                total = add_switches(paths, two, nearest, link, size, found, total)
                if total < 0:
                    return -1
    return total


def known_switches(
    space: Space, own: Array, known: Array, span: float, now: float, links: Links, rules: LinkRules
) -> Array:
    """Rows (time, i, j, graph) of all switches that `find_known_switches` finds, in order of time.

    Parameters
    ----------
    space
        Space of the agents.
    own, known
        Taylor coefficients about now of the positions of the agents as they know their own, and as others know them,
        shape (8, N, m).
    span
        How long from now on.
    now
        The scenario's time, for messages.
    links, rules
        Links by what agents know, and when they switch.

    Raises
    ------
    SimulationError
        When agents cross a periodic box too often within the span.
    """
    paths = paths_in(space, np.concatenate([own, known], axis=1), now)
    size = float(np.abs(paths.S[0]).max())

    def rows_in(found: Array) -> int:
        count = int(find_known_switches(paths, span, links, *rules, size, found))
        if count < 0:
            raise too_many_images(now)
        return count

    rows = all_rows(rows_in, 4)
    return rows[np.lexsort(rows.T[::-1])]


def followed_links(
    rules: LinkRules, views: Mapping[int, View | ConeView], links: Links, offset: Array
) -> dict[int, Links]:  # fmt: skip
    """Links of each graph, by its number, after what agents know has become what it is.

    Parameters
    ----------
    rules, views
        How links follow distances, and fields of view and cones now, by the number of the graph.
    links
        Links before, shape (graphs, N, N).
    offset
        Displacements to what each agent knows of the others, shape (N, N, m).
    """
    distance, by_distance = np.sqrt((offset**2).sum(axis=-1)), np.flatnonzero(rules.ways).tolist()
    found = {graph: rules.followed(graph, links[graph], distance) for graph in by_distance}
    return found | {graph: view.seen(slice(None), offset) for graph, view in views.items()}


def with_cones(rules: LinkRules, views: Mapping[int, GraphView]) -> tuple[LinkRules, Links | None]:
    """The ``rules`` of links by distances with those of cones, and the pairs that may be linked, (graphs, N, N).

    Parameters
    ----------
    views
        Fields of view and cones by the number of the graph. Without cones there is nothing to add, and every pair may.
    """
    cones = {k: view for k, view in views.items() if isinstance(view, ConeView)}
    if not cones:
        return rules, None
    n = rules.appear.shape[1]
    found = LinkRules(rules.ways.copy(), rules.appear.copy(), rules.break_.copy())
    allowed = np.ones((len(rules.ways), n, n), dtype=bool)
    for graph, view in cones.items():
        # Knowledge is directed: two agents may know different distances from each other.
        found.ways[graph], allowed[graph] = 2, view.allowed
        found.appear[graph] = found.break_[graph] = view.radii
    return found, allowed


def allowed_rows(rows: Array, allowed: Links | None) -> Array:
    """The ``rows`` (time, i, j, graph) of pairs that are ``allowed`` to be linked, by what `with_cones` gives."""
    return rows if allowed is None else rows[allowed[tuple(rows[:, [3, 1, 2]].astype(np.int64).T)]]


@native_apart
def find_known_view_switches(
    paths: Paths, span: float, links: Links, turning: bool, headings: Array, cosines: Array, radii: Array, size: float,
    found: Array,
) -> int:  # fmt: skip
    """Fill rows (time, i, j) of all changes of what agents take to be in view within a time; how many there are.

    Parameters
    ----------
    paths, span, size
        As for `find_known_switches`; in open space, and by `turning_paths` where views turn.
    links
        Links of the graph by what agents know, shape (N, N).
    turning, headings
        Whether views turn, and Taylor coefficients about now of the vectors along which agents look, unit vectors that
        stay what they are if not, shape (N, terms, m).
    cosines, radii
        Cosine of the half angle and radius of each agent, shape (N,).
    found
        Takes the rows, shape (room, 3).
    """
    n, total = links.shape[0], 0
    nearest = np.empty(paths.S.shape[2])
    for i in range(n):
        slack = ROUNDING * (radii[i] + size)
        for j in range(n):
            if i == j:
                continue
            distance, reach = nearest_offset(paths, i, n + j, nearest), reach_within(paths, i, n + j, span)
            two, look = TwoPaths(i, n + j, span, distance, reach), Looking(i, j, radii[i], cosines[i], slack)
            if turning:
                total = add_turning_changes(paths, two, look, links[i, j], headings[i], found, total)
            else:
                total = add_view_changes(paths, two, look, links[i, j], headings[i, 0], found, total)
    return total


def known_view_switches(
    space: Space, own: Array, known: Array, span: float, now: float, links: Links, graph: int,
    view: View | ConeView | MovingView,
) -> Array:  # fmt: skip
    """Rows (time, i, j, graph) of all changes of what agents take to be in view under one graph.

    Parameters
    ----------
    space, own, known, span, now
        As for `known_switches`.
    links
        Links of the graph by what agents know, shape (N, N).
    graph, view
        The number of the graph, and how agents look under it. Cones are not looked at, see `with_cones`.
    """
    if isinstance(view, ConeView):
        return np.zeros((0, 4))
    paths = paths_in(space, np.concatenate([own, known], axis=1), now)
    size, turning = float(np.abs(paths.S[0]).max()), isinstance(view, MovingView)
    headings = view.headings if isinstance(view, MovingView) else np.ascontiguousarray(view.directions[:, None])
    if turning:
        paths = turning_paths(paths, headings.shape[1])
    given = paths, span, links, turning, headings, view.cosines, view.radii, size
    rows = all_rows(lambda found: int(find_known_view_switches(*given, found)), 3)
    return np.column_stack([rows, np.full(len(rows), float(graph))])


def without_end(time: float, agents: tuple[int, ...], *, seen: bool) -> SimulationError:
    """The error for a known link that would switch to and fro without end.

    Parameters
    ----------
    time, agents
        When, and the agent that knows and the one that is known.
    seen
        Whether it follows a field of view or a cone.
    """
    fix = (
        "Fields of view and cones have no memory of links: hold the control, as control=fk.Held(0.01), with Messages "
        "in the place of Delayed."
        if seen
        else "Use a graph with hysteresis."
    )
    return SimulationError(
        f"The state of agent {agents[1]} that agent {agents[0]} has stays where a link switches, and it would switch "
        f"without end. {fix}",
        time=time, agents=agents,
    )  # fmt: skip
