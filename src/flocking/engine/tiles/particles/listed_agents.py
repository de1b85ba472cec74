"""Agents with their neighbour lists, and the rebuilds of those.

Agents are in the order of the cells of the last rebuild; `ids` contains their numbers. Lists contain every pair that
was within cutoff + skin at that time. While no agent has moved further than half the skin since (in a frame that moves
with the group), they contain every pair within the cutoff. A bound on the displacement is updated at every step, and
lists are rebuilt before it exceeds half the skin.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flocking.arrays import Array, Indices, Links, Numbers32, Reals
from flocking.engine.fixed_step.threads import Workers
from flocking.engine.tiles.kernels.spec import KernelSpec
from flocking.engine.tiles.measures import fastest
from flocking.engine.tiles.neighbours.fixed_lists import complete_lists, fixed_lists
from flocking.engine.tiles.neighbours.listed_pairs import remember_links
from flocking.engine.tiles.neighbours.neighbour_lists import TileLists
from flocking.engine.tiles.neighbours.verlet_skin import FIRST_SKIN, best_skin
from flocking.engine.tiles.particles.agent_arrays import AgentArrays
from flocking.engine.tiles.particles.displacement import CERTAIN, Displacement
from flocking.engine.tiles.particles.graph_radii import GraphRadii
from flocking.engine.tiles.particles.list_search import ListSearch
from flocking.model.law import Scenario
from flocking.model.state import State

SAME_CELLS = 0.9
"""Cells are reused if at least this fraction of their width is needed: at most (1/0.9)^3 = 1.4 times the pairs."""


class ListedAgents(AgentArrays):
    """Arrays of all agents, and the lists of their neighbours in each graph.

    Parameters
    ----------
    scenario
        Its law has the graphs.
    state
        Positions, velocities and, if the law's graph has memory, links.
    spec
        Specification of the kernel.
    workers
        Threads to use.
    memory_limit
        Largest size of the neighbour lists in bytes.
    skin
        Skin of the lists; chosen at every rebuild by default.

    Attributes
    ----------
    everyone
        Number of agents of the law, of which these may be a part.
    search
        What the lists are built with.
    lost
        Numbers of two agents whose link broke at a barrier; None while there are none.
    top_speed
        Largest speed of an agent.
    """

    def __init__(
        self, scenario: Scenario, state: State, spec: KernelSpec, workers: Workers, memory_limit: float,
        skin: float | None = None,
    ) -> None:  # fmt: skip
        super().__init__(state, spec, workers)
        self.everyone = scenario.start.n
        self.radii = GraphRadii(scenario.law.graphs, spec, self.ids, self.n, scenario.start.n)
        self.space = scenario.space
        self.search = ListSearch(
            self.n, self.n if self.moving else 1, len(scenario.law.graphs), self.m, self.space, self.dtype, workers,
            memory_limit, skin,
        )  # fmt: skip
        self.search.first_links = state.links
        self.displacement = Displacement(self.size if self.moving else 0, self.m, self.dtype)
        self.lists: list[TileLists | None] = [None] * len(spec.graphs)
        self.lost: tuple[int, int] | None = None
        self.top_speed = self._largest_speed()

    @property
    def moving(self) -> bool:
        """Whether a graph depends on distances, so that its lists change."""
        return any(not kind.fixed for kind in self.spec.graphs)

    def _largest_speed(self) -> float:
        """Largest speed of an agent relative to the mean velocity."""
        return fastest(self.agents[: self.n, self.m :])

    def usable(self) -> bool:
        """Whether the lists contain every pair within the cutoffs."""
        if not self.moving:
            return self.lists[0] is not None
        displacement = self.displacement
        if displacement.bound > displacement.allowed and self.search.rebuilds:
            displacement.bound = self.displacement_bound()
        return bool(displacement.bound <= displacement.allowed)

    def displacement_bound(self) -> float:
        """Bound on the displacement of any agent since the rebuild, relative to the group."""
        return self.displacement.measured(self.agents, self.n, self.workers)

    def require_lists(self, step: float) -> None:
        """Rebuild the lists if they may lack a pair within the cutoffs.

        Parameters
        ----------
        step
            The time step; the skin is chosen by it.
        """
        if not self.usable():
            self.rebuild(step)

    def _sort(self, step: float, skin: float | None) -> None:
        """Sort the agents into cells for the given skin, or else the best one at the current speed."""
        cutoff, sorter = max(self.radii.cutoffs), self.search.sorter
        seen = sorter.survey(self.agents)
        given = skin if skin is not None else self.search.given_skin
        guess = float(given if given is not None else self.displacement.skin or FIRST_SKIN * cutoff)
        cells = cutoff + self.search.margin
        sorter.sort(self.agents, seen, cells + guess)
        self._check_count()
        if given is None:
            stride = 2.0 * self.top_speed * step / CERTAIN
            guess, sorted_for = best_skin(self.agents, sorter, cutoff, stride, self.space, self._passes(step)), guess
            if not SAME_CELLS * (cells + sorted_for) <= cells + guess <= cells + sorted_for:
                sorter.sort(self.agents, seen, cells + guess)
                self._check_count()
        farthest = max(float(np.abs(seen.low).max()), float(np.abs(seen.high).max()))
        self.displacement.begin(guess, seen.velocity, farthest)

    def _passes(self, step: float) -> float:
        """Cost of what a step of the length ``step`` does with the lists, in passes of a step under ideal control."""
        return 1.0

    def _check_count(self) -> None:
        q: Reals = self.agents[: self.n, : self.m]
        self.search.pair_count_bound.check(self.search.sorter.crowding, q, self.radii.certain_reaches, self.space)

    def distances(self, i: Indices, j: Indices) -> Array:
        """Distances of pairs of agents, by their places."""
        x = self.X[: self.m]
        apart = self.space.displacement((x[:, j] - x[:, i]).astype(np.float64).T)
        square: Array = (apart**2).sum(axis=1)
        return np.sqrt(square)

    def graph_arguments(self, lists: Sequence[TileLists | None]) -> list[object]:
        """What kernels take of each graph: its list, its squared radii, per agent and common, and its views
        and factors of headings.

        Parameters
        ----------
        lists
            A list of each graph, which has been built.
        """
        found: list[object] = []
        for number, each in enumerate(lists):
            assert each is not None
            found += [each.rows.reshape(-1), each.first, each.count]
            found += [self.radii.each[number], self.radii.limits[number]]
            found += [self.radii.views[number]] * bool(self.spec.graphs[number].view)
            if self.spec.graphs[number].fades:
                found.append(self.radii.factors_of(number, each, self.ids, self.workers))
        return found

    def turn_views(self) -> None:
        """Take the headings of views that turn with the bodies, before links are found outside of the kernels."""
        self.radii.turn(self.body_rows.further)

    def rebuild(self, step: float, skin: float | None = None) -> None:
        """Sort the agents and rebuild all lists; stored links are kept.

        Parameters
        ----------
        step
            The time step; the skin is chosen by it.
        skin
            Width of the skin; chosen by default.

        Raises
        ------
        TooManyNeighboursError
            If the lists would exceed the memory limit; positions and links are kept.
        """
        if not self.moving:
            self._build_fixed()
            return
        # Squares of a skin that is given may be infinite: then everybody is listed.
        with np.errstate(over="ignore"):
            self._rebuild_moving(step, skin)

    def _rebuild_moving(self, step: float, skin: float | None) -> None:
        self._sort(step, skin)
        sorter, order = self.search.sorter, self.search.sorter.order
        old_place = sorter.arrange(
            self.agents, self.ids, self.successor, self._room.spare_ids, self.displacement.reference
        )
        self.agents, self.successor = self.successor, self.agents
        self.ids, self._room.spare_ids = self._room.spare_ids, self.ids
        self._reorder(order)
        self._fill_pads()
        radii, beyond = self.radii, self.displacement.skin + self.search.margin
        radii.turn(self.body_rows.further)
        for number, kind in enumerate(self.spec.graphs):
            if kind.fixed:
                continue
            old = self.lists[number]
            listed, inside = radii.searched(number, beyond, self.ids, self.workers)
            self.lists[number], lost = self.search.builders[number].build(
                self.agents, listed, sorter.grid, sorter.start, old, order,
                old_place, begin=inside if kind.memory and old is None else None, remember=kind.memory,
            )  # fmt: skip
            if lost is not None and kind.barrier:
                self.lost = (int(self.ids[lost[0]]), int(self.ids[lost[1]]))
        self._build_fixed()
        if self.search.first_links is not None:
            self._take_links(self.search.first_links)
        self.displacement.elapsed, self.displacement.bound = 0.0, 0.0
        self.search.rebuilds += 1

    def _reorder(self, order: Numbers32) -> None:
        """Sort what else is stored per agent.

        Parameters
        ----------
        order
            Index of each agent before the sort, shape (n,).
        """
        self.radii.reorder(order)
        if len(self.body_rows.further):
            self.body_rows.further[:, : self.n] = self.body_rows.further[:, order]

    def _build_fixed(self) -> None:
        place = None
        for number, kind in enumerate(self.spec.graphs):
            if kind.fixed:
                place = self.place if place is None else place
                edges = self.radii.edges[number]
                self.lists[number] = (
                    complete_lists(self.n)
                    if edges is None
                    else fixed_lists(self.ids, place, *edges, self.workers, self.n)
                )

    def _take_links(self, links: Links) -> None:
        """Set the links of the law's graph from the link matrix of the start."""
        self.search.first_links = None
        lists = self.lists[0]
        if lists is not None and self.spec.graphs[0].memory:
            remember_links(lists, np.asarray(links), self.ids)
