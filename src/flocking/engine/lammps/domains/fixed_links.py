"""Links that never change, for the agents of one rank."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flocking.arrays import Numbers, Numbers32
from flocking.engine.tiles.kernels.spec import GraphKind
from flocking.engine.tiles.neighbours.fixed_lists import complete_lists
from flocking.engine.tiles.neighbours.neighbour_lists import LINKED, TileLists


def fixed_partners(
    ids: Numbers32, kinds: Sequence[GraphKind], edges: Sequence[tuple[Numbers, Numbers32] | None], everyone: int
) -> Numbers32:
    """Numbers of the agents to which some are linked under graphs whose links never change.

    Parameters
    ----------
    ids
        Numbers of the agents.
    kinds, edges
        The graphs, and the links of each as in `flocking.engine.tiles.particles.graph_radii.GraphRadii`.
    everyone
        Number of agents of all ranks.
    """
    found = [np.zeros(0, np.int32)]
    for kind, links in zip(kinds, edges, strict=True):
        if not kind.fixed:
            continue
        if links is None:
            return np.arange(everyone, dtype=np.int32)
        offsets, neighbours = links
        begin, many = offsets[ids], offsets[ids + 1] - offsets[ids]
        at = np.arange(int(many.sum())) + np.repeat(begin - (np.cumsum(many) - many), many)
        found.append(neighbours[at])
    return np.unique(np.concatenate(found))


def complete_beside(n: int, size: int, copies: int) -> TileLists:
    """Lists of the complete graph on one rank: all its agents, and copies of all others.

    Parameters
    ----------
    n, size
        Number of agents of the rank, and row of the first copy.
    copies
        Number of copies.
    """
    lists = complete_lists(n)
    if not copies:
        return lists
    others = np.repeat((size + np.arange(copies, dtype=np.uint32))[:, None] | LINKED, 16, axis=1)
    rows = [lists.rows[lists.first[0] : lists.first[0] + lists.count[0]] if n else lists.rows[:0], others]
    first = np.zeros(len(lists.first), np.int64)
    if n % 16:
        last = others.copy()
        last[:, n % 16 :] = np.arange(n, size, dtype=np.uint32)
        rows += [lists.rows[lists.first[-1] : lists.first[-1] + lists.count[-1]], last]
        first[-1] = n + copies
    return TileLists(np.concatenate(rows), first, np.full(len(lists.first), n + copies, np.int32))
