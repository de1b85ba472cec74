"""Neighbours under a cone: of the pairs within reach, lists hold those whose headings are similar.

Headings are constant: which pairs may ever be linked is decided as lists are built. Kernels compare distances alone.
"""

from __future__ import annotations

import math

import numpy as np

from flocking.arrays import Array, Numbers32
from flocking.engine.fixed_step.threads import Workers
from flocking.engine.tiles.neighbours.neighbour_lists import WIDTH, TileLists
from flocking.formula.native.functions import native
from flocking.model.graphs.smooth_cones import SmoothCone
from flocking.model.graphs.views import Cone, check_rotations

BAND = 1e-6
"""Gaps and openings that differ by less, in radians, are compared by the definition: the angle of a cosine that is
rounded near -1 is off by 1e-8, and whole turns are taken from headings up to 1e6 with an error of 1e-10."""
LARGEST = 1e6
"""Headings beyond it, in radians, are compared by the definition."""


class Openings:
    """Who may be a neighbour of whom by their constant headings.

    Parameters
    ----------
    cone
        The graph.
    headings
        Headings of all agents, as in `Agents`.
    n
        Number of agents of the law.

    Raises
    ------
    InvalidInput
        When there are no headings of all agents, or none that can be compared so.
    """

    def __init__(self, cone: Cone | SmoothCone, headings: Array | None, n: int) -> None:
        self._cone, self._headings = cone, cone.checked_headings(headings, n)
        opening = np.broadcast_to(np.asarray(cone.opening, dtype=np.float64), n)
        turns = self._headings.ndim == 1
        if not turns:
            check_rotations(self._headings, cone.measure)
        self._table = np.ascontiguousarray(self._headings.reshape(n, -1), dtype=np.float64)
        """Angles, shape (N, 1), or the numbers of rotation matrices, shape (N, d d)."""
        self._circular = turns and cone.measure != "real"
        if turns and cone.measure == "rotation":
            opening = np.where(opening < 2.0, np.arccos(np.clip(1.0 - opening, -1.0, 1.0)), np.inf)
        self._most = np.ascontiguousarray(opening, dtype=np.float64)
        """Largest gap of headings of each sensing agent: in radians, or as (6) for matrices."""

    def keep(self, lists: TileLists, n: int, ids: Numbers32, workers: Workers) -> None:
        """Take all others out of lists that hold no links yet.

        Parameters
        ----------
        lists
            The lists; rows that are not needed any more are left out.
        n
            Number of agents that have lists.
        ids
            Number of the agent at each index, copies of agents of other processes included.
        workers
            Threads to use.
        """
        tiles = len(lists.count)
        doubtful = np.zeros(tiles, np.int32)
        workers.each(
            _keep_similar, tiles, n, ids, self._table, self._most, self._circular, lists.rows, lists.first, lists.count,
            doubtful,
        )  # fmt: skip
        for tile in np.flatnonzero(doubtful).tolist():
            rows = lists.rows[lists.first[tile] : lists.first[tile] + lists.count[tile]]
            own = np.arange(tile * WIDTH, (tile + 1) * WIDTH)
            there = (rows != own) & (own < n)
            row, lane = np.nonzero(there)
            who, whom = ids[own[lane]], ids[rows[row, lane].astype(np.int64)]
            similar = self._cone.similar(self._headings, who, whom)
            rows[row[~similar], lane[~similar]] = own[lane[~similar]]


@native
def _keep_similar(  # type: ignore[no-untyped-def]
    first_tile, last_tile, n, ids, table, most, circular, rows, first, count, doubtful
):
    """Leave out the entries whose headings differ by more than the opening; count those too close to decide."""
    width = table.shape[1]
    for tile in range(first_tile, last_tile):
        left = np.int64(0)
        for lane in range(WIDTH):
            i = np.int64(tile * WIDTH + lane)
            if i >= n:
                continue
            a, found = np.int64(ids[i]), np.int64(0)
            for row in range(first[tile], first[tile] + count[tile]):
                j = np.int64(rows[row, lane])
                if j == i:
                    continue
                b = np.int64(ids[j])
                gap = 0.0
                if width > 1:
                    for k in range(width):
                        gap += table[a, k] * table[b, k]
                    gap = 0.5 * (np.sqrt(np.float64(width)) - gap)
                else:
                    gap = table[b, 0] - table[a, 0]
                    if circular:
                        gap -= 2.0 * math.pi * math.floor(gap / (2.0 * math.pi) + 0.5)
                    gap = abs(gap)
                far = width == 1 and circular and (abs(table[a, 0]) > LARGEST or abs(table[b, 0]) > LARGEST)
                near = far or not abs(gap - most[a]) > BAND
                if near:
                    doubtful[tile] += 1
                if near or gap < most[a]:
                    rows[first[tile] + found, lane] = np.uint32(j)
                    found += 1
            for row in range(first[tile] + found, first[tile] + count[tile]):
                rows[row, lane] = np.uint32(i)
            left = max(left, found)
        count[tile] = np.int32(left)
