"""How far agents are from the borders of fields of view at times within pieces of motion, for checks of checkpoints."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flocking.arrays import Array, Indices, Links
from flocking.engine.imperfect.graph_views import GraphView
from flocking.engine.imperfect.turning_views import TurningView

Places = Callable[[Indices, Array], Array]
"""Vectors of agents at times in seconds from the start, shape (..., m) for agents and times of shape (...)."""

SLOW = 1e-4
"""Length of a heading, as a share of that at an end of a piece, below which its direction is not judged: the agent
turns back or begins to move there, and rounding of the time decides where it looks."""


class MarginsInPieces:
    """Margins of one graph.

    Parameters
    ----------
    view
        The fields of view or cones.
    looks
        Along which vectors agents look, by the name of the column.
    now, ends
        When the pieces of motion at hand begin to be of interest, and when that of each agent ends, shape (N,).
    """

    def __init__(self, view: GraphView, looks: Callable[[str], Places], now: float, ends: Array) -> None:
        self._view = view
        if isinstance(view, TurningView):
            self._looks, everyone = looks(view.column), np.arange(len(ends))
            at_ends = (self._looks(everyone, t) for t in (np.full(len(ends), now), np.maximum(ends, now)))
            self._least = SLOW * np.max([np.linalg.norm(x, axis=1) for x in at_ends], axis=0)

    def at(self, i: Indices, j: Indices, offset: Array, time: Array) -> tuple[Array, Links]:
        """How far ``j`` are from the borders of agents ``i``, negative outside, and whether that is sure, shape (k,).

        Parameters
        ----------
        offset, time
            Displacements from one to the other, shape (k, m), and when, shape (k,).
        """
        view = self._view
        if not isinstance(view, TurningView):
            return view.margins(i, j, offset), np.ones(len(i), dtype=bool)
        headings = self._looks(i, time)
        sure = (np.linalg.norm(headings, axis=1) > self._least[i]) | (self._least[i] == 0.0)
        return view.of(i).looking(headings).margins(np.arange(len(i)), j, offset), sure
