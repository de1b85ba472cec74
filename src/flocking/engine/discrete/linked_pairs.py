"""Linked pairs of one graph at the ticks of agents, found with a cell list where links follow distances."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array, Indices, Links, Mask
from flocking.engine.discrete.cell_pairs import AXES, CellPairs
from flocking.errors import InvalidInput
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.space import Space

MOST_DENSE = 3000
"""Largest group of a graph whose links do not follow two distances: a matrix of all pairs is kept for it."""


class Neighbours:
    """Linked pairs of one graph.

    Parameters
    ----------
    graph, space
        The graph, and the space.
    q
        Positions at the start, shape (N, m).
    given
        Links at the start, shape (N, N), where they are given.

    Raises
    ------
    InvalidInput
        When a group is too large for a graph that needs all pairs.
    """

    def __init__(self, graph: Graph, space: Space, q: Array, given: Links | None = None) -> None:
        self.graph, self.space, self.n = graph, space, len(q)
        reach = float(np.max(np.asarray(graph.break_radius)))
        self._sparse = graph.moves and graph.follows_radii and np.isfinite(reach) and q.shape[1] <= AXES
        if not self._sparse and self.n > MOST_DENSE:
            raise InvalidInput(
                "start", "engine", f"must be another one for more than {MOST_DENSE} agents of {type(graph).__name__}",
                f"'discrete' for {self.n}", "It keeps a matrix of all pairs for this graph.",
            )  # fmt: skip
        self._enter, self._leave = (
            np.broadcast_to(np.asarray(x, dtype=np.float64), self.n) for x in (graph.appear_radius, graph.break_radius)
        )
        self._remembers = bool((self._enter != self._leave).any())
        self._search = CellPairs(space, reach, self.n)
        self._first, self._pairs = q, None if given is None else _of_matrix(given)
        self._states_start = given is not None or not self._sparse

    @property
    def pairs(self) -> tuple[Indices, Indices]:
        """Sensing and sensed agents of the linked pairs, found at the first use; sorted where links are stored."""
        if self._pairs is None:
            self._pairs = self._at_first(self._first)
        return self._pairs

    @pairs.setter
    def pairs(self, pairs: tuple[Indices, Indices]) -> None:
        self._pairs = pairs

    def _at_first(self, q: Array) -> tuple[Indices, Indices]:
        if not self._sparse:
            return _of_matrix(self.graph.links_in(self.space, q))
        i, j, r = self.near(q)
        if not np.ndim(self.graph.break_radius):
            linked = np.asarray(self.graph.among(r), dtype=bool)
        elif getattr(self.graph, "closed", False):
            linked = r <= self._leave[i]
        else:
            linked = r < self._leave[i]
        return i[linked], j[linked]

    def near(self, q: Array) -> tuple[Indices, Indices, Array]:
        """Ordered pairs up to the largest radius apart, and their distances; sorted where links are stored.

        Parameters
        ----------
        q
            Positions, shape (N, m).
        """
        i, j, r = self._search.near(q)
        if self._remembers:
            order = np.argsort(i * self.n + j)
            return i[order], j[order], r[order]
        return i, j, r

    def after(self, q: Array) -> tuple[Indices, Indices]:
        """Linked pairs after agents that had the links of `pairs` moved to ``q``, shape (N, m)."""
        if not self.graph.moves:
            return self.pairs
        if not self._sparse:
            return _of_matrix(self.graph.update(q, self.matrix(self.pairs), self.space))
        i, j, r = self.near(q)
        linked = r < self._enter[i]
        if self._remembers:
            linked |= self.remembered(i, j) & (r < self._leave[i])
        return i[linked], j[linked]

    def remembered(self, i: Indices, j: Indices) -> Mask:
        """Which of the ordered pairs (i, j) are among `pairs`."""
        known = self.pairs[0] * self.n + self.pairs[1]
        asked = i * self.n + j
        place = np.minimum(np.searchsorted(known, asked), max(len(known) - 1, 0))
        return np.asarray(known[place] == asked) if len(known) else np.zeros(len(asked), dtype=bool)

    def move(self, q: Array) -> None:
        """Let agents be at ``q``, shape (N, m), from now on."""
        self.pairs = self.after(q)

    def matrix(self, pairs: tuple[Indices, Indices]) -> Links:
        """A link matrix, shape (N, N).

        Parameters
        ----------
        pairs
            Sensing and sensed agents of the linked pairs.
        """
        found = np.zeros((self.n, self.n), dtype=bool)
        found[pairs] = True
        return found

    def seen_by(
        self, agents: Indices, q: Array, slack: float, *, at_start: bool = False
    ) -> tuple[Indices, Indices, Mask]:
        """Links of some agents by a comparison with all others, for a check of the cell list.

        Parameters
        ----------
        agents
            The agents.
        q
            Positions, shape (N, m).
        slack
            Relative difference of a distance from a radius within which a link is uncertain.
        at_start
            Whether nobody has moved yet: links that the start gives, or a matrix of the graph, are then as stated.

        Returns
        -------
        tuple of arrays
            Places in ``agents``, the agents sensed, and whether the link is certain.
        """
        if not self.graph.moves or (at_start and self._states_start):
            place = np.flatnonzero(np.isin(self.pairs[0], agents))
            k = np.searchsorted(agents, self.pairs[0][place])
            return k, self.pairs[1][place], np.ones(len(k), dtype=bool)
        if not self._sparse:
            links = self.graph.update(q, self.matrix(self.pairs), self.space)[agents]
            k, j = np.nonzero(links)
            return k, j, np.ones(len(k), dtype=bool)
        offsets = self.space.displacement(q[None, :, :] - q[agents][:, None, :])
        r = np.sqrt((offsets**2).sum(axis=2))
        r[np.arange(len(agents)), agents] = np.inf
        enter, leave = self._enter[agents][:, None], self._leave[agents][:, None]
        k, j = np.nonzero(r < leave * (1.0 + slack))
        r, enter, leave = r[k, j], enter[k, 0], leave[k, 0]
        linked = r < enter * (1.0 + slack)
        if self._remembers:
            linked |= self.remembered(agents[k], j)
        certain = (np.abs(r - enter) > slack * enter) & (np.abs(r - leave) > slack * leave)
        return k[linked], j[linked], certain[linked]


def _of_matrix(links: Links) -> tuple[Indices, Indices]:
    i, j = np.nonzero(links)
    return i.astype(np.int64), j.astype(np.int64)
