"""Radii of the graphs of a law, in the form that kernels and neighbour lists use."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Numbers, Numbers32, Reals
from flocking.engine.tiles.kernels.spec import PRECISIONS, KernelSpec
from flocking.engine.tiles.measures import cutoffs_of, sensed_offsets
from flocking.model.graphs.distance_graphs import Fixed, Graph


class GraphRadii:
    """Squared radii and cutoffs of the graphs of a law.

    Parameters
    ----------
    graphs
        The graphs.
    spec
        Specification of the kernel of the law.
    ids
        Number of the agent at each index, shape (size,).
    n
        Number of agents in the arrays.
    everyone
        Number of agents of the law.
    edges
        `edges` of the same graphs where they are known.
    """

    def __init__(
        self, graphs: tuple[Graph, ...], spec: KernelSpec, ids: Numbers32, n: int, everyone: int,
        edges: list[tuple[Numbers, Numbers32] | None] | None = None,
    ) -> None:  # fmt: skip
        self.graphs, self._spec, self._n = graphs, spec, n
        self._dtype = PRECISIONS[spec.precision]
        self.cutoffs = cutoffs_of(graphs, spec)
        """Largest distance of linked agents under each graph; 0 for a fixed one."""
        self.limits: list[Reals] = []
        """For each graph the squared radii at which links break and appear, and half the first radius, shape (3,)."""
        self.each: list[Reals] = []
        """For each graph the squared radius of each agent, shape (size,); shape (1,) if it is common."""
        self.edges: list[tuple[Numbers, Numbers32] | None] = list(edges or [])
        """Links of fixed graphs, see `flocking.engine.tiles.measures.sensed_offsets`; None for other graphs, and for
        `Complete`, which needs no list of pairs."""
        for graph in graphs:
            self.limits.append(np.zeros(3, self._dtype))
            self.each.append(np.zeros(1, self._dtype))
            if edges is None:
                self.edges.append(sensed_offsets(graph, everyone) if isinstance(graph, Fixed) else None)
        self._set(ids)

    def _set(self, ids: Numbers32) -> None:
        n, dtype = self._n, self._dtype
        for number, (graph, kind) in enumerate(zip(self.graphs, self._spec.graphs, strict=True)):
            if kind.fixed:
                self.limits[number][:] = (0.0, 0.0, 1.0)
                continue
            leave, enter = np.asarray(graph.break_radius), np.asarray(graph.appear_radius)
            square = dtype(np.max(leave)) ** 2
            closed = bool(getattr(graph, "closed", False))
            if closed:
                square = np.nextafter(square, dtype(np.inf))
            self.limits[number][:] = (square, dtype(np.max(enter)) ** 2, 0.5 * float(np.max(leave)))
            if kind.uneven:
                each = np.zeros(len(ids), dtype)
                each[:n] = leave.astype(dtype)[ids[:n]] ** 2
                each[n:] = 0.0
                self.each[number] = np.nextafter(each, dtype(np.inf)) if closed else each

    def searched(self, number: int, beyond: float) -> tuple[float, Reals, Reals]:
        """How far the neighbours of a graph are searched, and which of them are linked, as lists are built.

        Parameters
        ----------
        number
            The graph.
        beyond
            By how much lists reach further than links.

        Returns
        -------
        tuple of float and arrays
            The largest distance; that of each agent, shape (size,), or shape (1,) if it is common; and the squared
            radius of each agent, of the same shape.
        """
        each, cutoff = self.each[number], self.cutoffs[number] + beyond
        if self._spec.graphs[number].uneven:
            return cutoff, np.sqrt(each) + self._dtype(beyond), each
        return cutoff, each, self.limits[number][:1]

    def reorder(self, order: Numbers32) -> None:
        """Sort the radii of each agent.

        Parameters
        ----------
        order
            Index of each agent before the sort, shape (n,).
        """
        for each, kind in zip(self.each, self._spec.graphs, strict=True):
            if kind.uneven:
                each[: self._n] = each[order]

    def certain_reaches(self) -> list[float]:
        """Distance within which every agent lists another, for each moving graph."""
        return [
            float(np.sqrt(self.each[k][: self._n].min(initial=np.inf))) if kind.uneven else self.cutoffs[k]
            for k, kind in enumerate(self._spec.graphs)
            if not kind.fixed
        ]
