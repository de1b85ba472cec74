"""Radii and views of the graphs of a law, in the form that kernels and neighbour lists use."""

from __future__ import annotations

from functools import partial

import numpy as np

from flocking.arrays import Indices, Mask, Numbers, Numbers32, Reals
from flocking.engine.fixed_step.threads import Workers
from flocking.engine.tiles.kernels.spec import HEADINGS, PRECISIONS, KernelSpec
from flocking.engine.tiles.measures import cutoffs_of, sensed_offsets
from flocking.engine.tiles.neighbours.listed_factors import ListedFactors
from flocking.engine.tiles.neighbours.neighbour_lists import ENTRY, NO_VIEWS, FirstLinks, Listed, TileLists
from flocking.engine.tiles.neighbours.similar_headings import Openings
from flocking.model.graphs.distance_graphs import Fixed, Graph
from flocking.model.graphs.smooth_cones import SmoothCone
from flocking.model.graphs.views import VELOCITY, Cone, FieldOfView


class GraphRadii:
    """Squared radii, cutoffs and views of the graphs of a law.

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
        self.graphs, self._spec, self._n, self._everyone = graphs, spec, n, everyone
        self._dtype = PRECISIONS[spec.precision]
        self.cutoffs = cutoffs_of(graphs, spec)
        """Largest distance of linked agents under each graph; 0 for a fixed one."""
        self.limits: list[Reals] = []
        """For each graph the squared radii at which links break and appear, and half the first radius, shape (3,)."""
        self.each: list[Reals] = []
        """For each graph the squared radius of each agent, shape (size,); shape (1,) if it is common."""
        self.views: list[Reals] = []
        """For each graph the squares of the cosines of half angles, with their signs, and then the headings unless they
        are those of velocities: a row for each number, shape (m + 1, size) or (1, size); those of columns as `turn`
        or `face` left them. `NO_VIEWS` where agents see all around."""
        headings = spec.layout.bodies.headings
        cones = [g if isinstance(g, Cone | SmoothCone) else None for g in graphs]
        self._openings = [None if cone is None else Openings(cone, headings, everyone) for cone in cones]
        self._factors = {
            number: ListedFactors(g, headings, everyone, self._dtype)
            for number, g in enumerate(graphs)
            if isinstance(g, SmoothCone)
        }
        self.edges: list[tuple[Numbers, Numbers32] | None] = list(edges or [])
        """Links of fixed graphs, see `flocking.engine.tiles.measures.sensed_offsets`; None for other graphs, and for
        `Complete`, which needs no list of pairs."""
        for graph in graphs:
            self.limits.append(np.zeros(3, self._dtype))
            self.each.append(np.zeros(1, self._dtype))
            self.views.append(NO_VIEWS.astype(self._dtype))
            if edges is None:
                self.edges.append(sensed_offsets(graph, everyone) if isinstance(graph, Fixed) else None)
        self._set(ids)
        self.look(ids)

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

    def look(self, ids: Numbers32) -> None:
        """Take the views of the agents.

        Parameters
        ----------
        ids
            Number of the agent at each index, shape (size,).
        """
        for number, graph in enumerate(self.graphs):
            if isinstance(graph, FieldOfView):
                cosines = graph.cosines(self._everyone)
                table = (cosines * np.abs(cosines))[None]
                if self._spec.graphs[number].view == HEADINGS and not graph.heading_column:
                    table = np.vstack([table, graph.directions(self._spec.layout.bodies.headings, self._everyone).T])
                elif not graph.along_velocity:
                    table = np.vstack([table, np.zeros((self._spec.dimension, self._everyone))])
                self.views[number] = np.ascontiguousarray(table[:, ids], dtype=self._dtype)

    def turn(self, further: Reals) -> None:
        """Take the headings of views along columns of bodies, before links are found outside of the kernels.

        Parameters
        ----------
        further
            Further numbers of the bodies, a row for each, shape (rows, size).
        """
        for views, kind in zip(self.views, self._spec.graphs, strict=True):
            if kind.view not in ("", HEADINGS, VELOCITY):
                first = self._spec.row_of(kind.view)
                views[1:] = further[first : first + self._spec.dimension, : views.shape[1]]

    def face(self, headings: Reals) -> None:
        """Take the headings of views along a direction of bodies that is no column of the kernels.

        Parameters
        ----------
        headings
            Unit vectors, shape (size, m).
        """
        for views, kind, graph in zip(self.views, self._spec.graphs, self.graphs, strict=True):
            if kind.view == HEADINGS and isinstance(graph, FieldOfView) and graph.heading_column:
                views[1:] = headings[: views.shape[1]].T

    def follow_state(self, number: int) -> bool:
        """Whether links of a graph follow from positions and headings, whatever the last pass found.

        They appear and break at one radius then.

        Parameters
        ----------
        number
            The graph.
        """
        graph = self.graphs[number]
        return bool(graph.moves and np.all(graph.appear_radius == graph.break_radius))

    def linked(self, number: int, i: Indices, d: Reals, p: Reals) -> Mask:
        """Which pairs are linked under a graph whose links follow from the positions.

        Parameters
        ----------
        number
            The graph.
        i, d
            Places of the sensing agents, shape (K,), and displacements to the sensed ones, shape (K, m).
        p
            Velocities of all agents by their places, shape (m, size).
        """
        kind, square = self._spec.graphs[number], (d**2).sum(axis=1)
        near = square < (self.each[number][i] if kind.uneven else self.limits[number][0])
        if kind.view:
            least, *headings = self.views[number][:, i]
            along = np.stack(headings) if headings else _in_units(p[:, i])
            ahead = (d.T * along).sum(axis=0)
            near &= ahead * np.abs(ahead) >= least * square * (1 if headings else (along**2).sum(axis=0))
        return np.asarray(near)

    def searched(self, number: int, beyond: float, ids: Numbers32, workers: Workers) -> tuple[Listed, FirstLinks]:
        """Which neighbours of a graph are listed, and which of them are linked, as lists are built.

        Parameters
        ----------
        number
            The graph.
        beyond
            By how much lists reach further than links.
        ids
            Number of the agent at each index, copies of agents of other processes included.
        workers
            Threads to use.
        """
        openings = self._openings[number]
        keep = None if openings is None else partial(openings.keep, n=self._n, ids=ids, workers=workers)
        each, cutoff, views = self.each[number], self.cutoffs[number] + beyond, self.views[number]
        size = ENTRY + (np.dtype(self._dtype).itemsize if number in self._factors else 0)
        if self._spec.graphs[number].uneven:
            return Listed(cutoff, np.sqrt(each) + self._dtype(beyond), keep, size), FirstLinks(each, views)
        return Listed(cutoff, each, keep, size), FirstLinks(self.limits[number][:1], views)

    def factors_of(self, number: int, lists: TileLists, ids: Numbers32, workers: Workers) -> Reals:
        """Factors of the headings of the pairs in lists under a smooth cone.

        Parameters
        ----------
        number
            The graph.
        lists
            Its lists, for all agents or for what agents know.
        ids
            Number of the agent at each index, copies of agents of other processes included.
        workers
            Threads to use.
        """
        return self._factors[number].of(lists, self._n, ids, workers)

    def reorder(self, order: Numbers32) -> None:
        """Sort the radii and views of each agent.

        Parameters
        ----------
        order
            Index of each agent before the sort, shape (n,).
        """
        for each, kind in zip(self.each, self._spec.graphs, strict=True):
            if kind.uneven:
                each[: self._n] = each[order]
        for views, kind in zip(self.views, self._spec.graphs, strict=True):
            if kind.view:
                views[:, : self._n] = views[:, order]

    def certain_reaches(self) -> list[float]:
        """Distance within which every agent lists another, for each moving graph, before a cone takes some out."""
        return [
            float(np.sqrt(self.each[k][: self._n].min(initial=np.inf))) if kind.uneven else self.cutoffs[k]
            for k, kind in enumerate(self._spec.graphs)
            if not kind.fixed
        ]


def _in_units(p: Reals) -> Reals:
    """Velocities, shape (m, K), divided by their largest components, so that their squares are numbers; zeros stay."""
    fastest = np.abs(p).max(axis=0)
    return np.asarray(p / np.where(fastest > 0, fastest, fastest.dtype.type(1)))
