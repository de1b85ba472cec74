"""When links switch that follow the distance between an agent and what it knows of another."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array, Links, Numbers
from flocking.engine.imperfect.link_rules import LinkRules
from flocking.engine.imperfect.pair_polynomials import (
    Paths,
    nearest_offset,
    paths_in,
    reach_within,
    too_many_images,
)
from flocking.engine.imperfect.pair_switches import TwoPaths, WatchedLink, add_switches
from flocking.engine.kernels.bernstein import all_rows
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
