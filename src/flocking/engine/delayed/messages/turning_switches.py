"""When links of what agents know switch by fields of view along their own velocities."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array, Links
from flocking.engine.delayed.messages.samples_in_use import InUse, put_sample
from flocking.engine.imperfect.pair_polynomials import ROUNDING, Paths, nearest_offset, reach_within
from flocking.engine.imperfect.pair_switches import TwoPaths
from flocking.engine.imperfect.turning_views import MovingView, add_turning_changes, turning_paths
from flocking.engine.imperfect.view_switches import Looking
from flocking.engine.kernels.bernstein import all_rows
from flocking.formula.native.functions import native_apart


@native_apart
def find_turning_switches(
    paths: Paths, used: InUse, span: float, links: Links, headings: Array, cosines: Array, radii: Array, size: float,
    found: Array,
) -> int:  # fmt: skip
    """Fill rows (time since the step began, i, j) of the first switch of every link of a graph on a step.

    Parameters
    ----------
    paths
        How agents know themselves to move from the beginning of the step on, by `turning_paths`; its time is that in
        seconds from the start.
    used
        What they know of others.
    span
        How long the step is.
    links
        Links of the graph by what agents know, shape (N, N).
    headings, cosines, radii
        See `flocking.engine.imperfect.turning_views.MovingView`.
    size
        Size of the coordinates, for rounding.
    found
        Takes the rows, shape (room, 3).

    Returns
    -------
    int
        How many rows there are, those included for which there was no room.
    """
    n, m, total = paths.S.shape[1], paths.S.shape[2], 0
    S, nearest, row = np.zeros((paths.S.shape[0], 2, m)), np.empty(m), np.empty((1, 3))
    two_paths = Paths(S, paths.lengths, paths.table, paths.now)
    for i in range(n):
        slack = ROUNDING * (radii[i] + size)
        for a in range(S.shape[0]):
            for k in range(m):
                S[a, 0, k] = paths.S[a, i, k]
        for j in range(n):
            if i == j or not used.there[i, j]:
                continue
            put_sample(S, used, i, j, paths.now)
            distance, reach = nearest_offset(two_paths, 0, 1, nearest), reach_within(two_paths, 0, 1, span)
            two, look = TwoPaths(0, 1, span, distance, reach), Looking(i, j, radii[i], cosines[i], slack)
            if add_turning_changes(two_paths, two, look, links[i, j], headings[i], row, 0) > 0:
                if total < found.shape[0]:
                    found[total, 0], found[total, 1], found[total, 2] = row[0, 0], i, j
                total += 1
    return total


def turning_switches(
    paths: Paths, used: InUse, span: float, links: Links, graph: int, view: MovingView, size: float
) -> Array:
    """Rows (time since the step began, i, j, graph) of the first switch of every link of a graph on a step.

    Parameters
    ----------
    paths, used, span, links, size
        As for `find_turning_switches`.
    graph, view
        The number of the graph, and how agents look under it as they know themselves to move.
    """
    given = turning_paths(paths, view.headings.shape[1]), used, span, links, *view, size
    rows = all_rows(lambda found: int(find_turning_switches(*given, found)), 3)
    return np.column_stack([rows, np.full(len(rows), float(graph))])
