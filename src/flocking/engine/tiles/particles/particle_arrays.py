"""Particle arrays: positions and velocities sorted by cell, their neighbour lists, and the rebuilds of those.

Agents are in the order of the cells of the last rebuild; `ids` contains their numbers. Lists contain every pair that
was within cutoff + skin at that time. While no agent has moved further than half the skin since (in a frame that moves
with the group), they contain every pair within the cutoff. A bound on the displacement is updated at every step, and
lists are rebuilt before it exceeds half the skin.
"""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array, Indices, Links, Numbers32, Reals
from flocking.engine.tiles.kernels.spec import PRECISIONS, KernelSpec, only_numbers_differ
from flocking.engine.tiles.kernels.step_kernel import tile_kernels
from flocking.engine.tiles.kernels.tile_sums import sums_of
from flocking.engine.tiles.measures import extremes_of, fastest
from flocking.engine.tiles.neighbours.cell_list import Sorter
from flocking.engine.tiles.neighbours.fixed_lists import complete_lists, fixed_lists
from flocking.engine.tiles.neighbours.listed_pairs import nearest_pair_beyond, remember_links
from flocking.engine.tiles.neighbours.nearest_image import box_of
from flocking.engine.tiles.neighbours.neighbour_lists import WIDTH, ListBuilder, TileLists
from flocking.engine.tiles.neighbours.obstacle_lists import ObstacleLists
from flocking.engine.tiles.neighbours.pair_count_bound import PairCountBound
from flocking.engine.tiles.neighbours.verlet_skin import FIRST_SKIN, best_skin
from flocking.engine.tiles.particles.displacement import CERTAIN, Displacement
from flocking.engine.tiles.particles.graph_radii import GraphRadii
from flocking.engine.tiles.particles.law_parameters import LawParameters
from flocking.engine.tiles.planted_law import PassArrays, Planted
from flocking.engine.tiles.threads import Workers
from flocking.model.law import Scenario
from flocking.model.state import State

SAME_CELLS = 0.9
"""Cells are reused if at least this fraction of their width is needed: at most (1/0.9)^3 = 1.4 times the pairs."""


class ParticleArrays:
    """Particle arrays and neighbour lists of a group under one law.

    Parameters
    ----------
    scenario
        Law, agents and energy.
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
    margin
        What cells are wider by than the lists of the true state need.
    """

    def __init__(
        self, scenario: Scenario, state: State, spec: KernelSpec, workers: Workers, memory_limit: float,
        skin: float | None = None,
    ) -> None:  # fmt: skip
        n, m = state.q.shape
        self.n, self.m, self.spec, self.workers = n, m, spec, workers
        self.dtype: type[np.float32] | type[np.float64] = PRECISIONS[spec.precision]
        self.tiles = (n + WIDTH - 1) // WIDTH
        self.size = self.tiles * WIDTH
        self._take_kernels(spec)
        self.given_skin = skin
        self.agents: Reals = np.empty((self.size, 2 * m), self.dtype)
        # For agents of order 1 the second half is the velocity of the last step, which no formula reads.
        self.agents[:n, :m], self.agents[:n, m:] = state.q, state.p if spec.order == 2 else 0.0
        self.successor: Reals = np.empty((self.size, 2 * m), self.dtype)
        self.ids: Numbers32 = np.zeros(self.size, np.int32)
        self.ids[:n] = np.arange(n, dtype=np.int32)
        self._ids_buffer: Numbers32 = np.zeros(self.size, np.int32)
        self.tile_extremes: Reals = np.zeros((self.tiles, 3), self.dtype)
        self.extremes: Array = np.zeros(3)
        self.sums: Array = np.zeros((self.tiles if spec.ledger else 1, len(sums_of(spec))), np.float64)
        self.planted: Planted | None = None
        self.moving = any(not kind.fixed for kind in spec.graphs)
        self._fill_pads()
        self.radii = GraphRadii(scenario.law.graphs, spec, self.ids, n)
        self.space = scenario.space
        self.box: Reals = box_of(self.space, m, self.dtype)
        self.sorter = Sorter(n if self.moving else 1, workers, self.space.lengths)
        self.pair_count_bound = PairCountBound(memory_limit)
        self.builders = [ListBuilder(n, memory_limit, workers, self.box) for _ in scenario.law.graphs]
        self._set_parameters(scenario, state.t)
        self.M: Array = np.zeros(2 * m, np.float64)
        self.displacement = Displacement(self.size if self.moving else 0, m, self.dtype)
        self.rebuilds = 0
        self.lists: list[TileLists | None] = [None] * len(spec.graphs)
        self._first_links = state.links
        self._set_obstacles(scenario)
        self.lost: tuple[int, int] | None = None
        self.top_speed = fastest(self.agents[: self.n, self.m :])
        self.margin = 0.0

    @property
    def X(self) -> Reals:  # noqa: N802
        """Positions and velocities, shape (2m, size): a view of `agents`, which has a row for each agent."""
        return self.agents.T

    @X.setter
    def X(self, values: Reals) -> None:  # noqa: N802
        self.agents = np.ascontiguousarray(values.T)

    @property
    def Y(self) -> Reals:  # noqa: N802
        """The previous or next state, shape (2m, size)."""
        return self.successor.T

    def _set_obstacles(self, scenario: Scenario) -> None:
        met = self.spec.layout.obstacle_groups()
        self.obstacles = ObstacleLists(scenario.law, [term.range for term, _ in met]) if met else None
        self.O: object = self.spec.layout.obstacle_rows()

    def _take_kernels(self, spec: KernelSpec) -> None:
        module = tile_kernels(spec)
        self.kernel, self.flow_kernel = module.move, module.flow

    def _set_parameters(self, scenario: Scenario, t: float) -> None:
        self.parameters = LawParameters(scenario, self.spec, t, self.ids)

    def pass_switch_time(self, scenario: Scenario, t: float) -> None:
        """Use the values of scheduled gains from time ``t`` on."""
        self._set_parameters(scenario, t)
        if self.planted is not None:
            self.planted.pass_switch_time(t)

    def _fill_pads(self) -> None:
        n = self.n
        self.agents[n:] = self.agents[n - 1]
        self.ids[n:] = self.ids[n - 1]

    @property
    def place(self) -> Numbers32:
        """Index of each identity, shape (n,)."""
        found = np.empty(self.n, np.int32)
        found[self.ids[: self.n]] = np.arange(self.n, dtype=np.int32)
        return found

    def usable(self) -> bool:
        """Whether the lists contain every pair within the cutoffs."""
        if not self.moving:
            return self.lists[0] is not None
        displacement = self.displacement
        if displacement.bound > displacement.allowed and self.rebuilds:
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
        cutoff, sorter = max(self.radii.cutoffs), self.sorter
        seen = sorter.survey(self.agents)
        given = skin if skin is not None else self.given_skin
        guess = float(given if given is not None else self.displacement.skin or FIRST_SKIN * cutoff)
        cells = cutoff + self.margin
        sorter.sort(self.agents, seen, cells + guess)
        self._check_count()
        if given is None:
            stride = 2.0 * self.top_speed * step / CERTAIN
            guess, sorted_for = best_skin(self.agents, sorter, cutoff, stride, self.space), guess
            if not SAME_CELLS * (cells + sorted_for) <= cells + guess <= cells + sorted_for:
                sorter.sort(self.agents, seen, cells + guess)
                self._check_count()
        farthest = max(float(np.abs(seen.low).max()), float(np.abs(seen.high).max()))
        self.displacement.begin(guess, seen.velocity, farthest)

    def _check_count(self) -> None:
        q: Reals = self.agents[: self.n, : self.m]
        if not self.space.is_open:
            q = self.space.wrapped(q.astype(np.float64))
        self.pair_count_bound.check(self.sorter.crowding, q, self.radii.certain_reaches)

    def distances(self, i: Indices, j: Indices) -> Array:
        """Distances of pairs of agents, by their places."""
        x = self.X[: self.m]
        apart = self.space.displacement((x[:, j] - x[:, i]).astype(np.float64).T)
        square: Array = (apart**2).sum(axis=1)
        return np.sqrt(square)

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
        self._sort(step, skin)
        sorter, order = self.sorter, self.sorter.order
        old_place = sorter.arrange(self.agents, self.ids, self.successor, self._ids_buffer, self.displacement.reference)
        self.agents, self.successor = self.successor, self.agents
        self.ids, self._ids_buffer = self._ids_buffer, self.ids
        self.parameters.reorder(order)
        self.radii.reorder(order)
        self._fill_pads()
        radii, skin = self.radii, self.displacement.skin
        for number, kind in enumerate(self.spec.graphs):
            if kind.fixed:
                continue
            each_reach = radii.each[number]
            if kind.uneven:
                each_reach = np.sqrt(each_reach) + self.dtype(skin)
            old = self.lists[number]
            inside = radii.each[number] if kind.uneven else radii.limits[number][:1]
            self.lists[number], lost = self.builders[number].build(
                self.agents, radii.cutoffs[number] + skin, each_reach, sorter.grid, sorter.start, old, order,
                old_place, begin2=inside if kind.memory and old is None else None, remember=kind.memory,
            )  # fmt: skip
            if lost is not None and kind.barrier:
                self.lost = (int(self.ids[lost[0]]), int(self.ids[lost[1]]))
        self._build_fixed()
        if self._first_links is not None:
            self._take_links(self._first_links)
        self.displacement.elapsed, self.displacement.bound = 0.0, 0.0
        if self.obstacles is not None:
            self.obstacles.used = np.inf
        self.rebuilds += 1

    def _build_fixed(self) -> None:
        place = None
        for number, kind in enumerate(self.spec.graphs):
            if kind.fixed:
                place = self.place if place is None else place
                edges = self.radii.edges[number]
                self.lists[number] = (
                    complete_lists(self.n) if edges is None else fixed_lists(self.ids, place, *edges, self.workers)
                )

    def _take_links(self, links: Links) -> None:
        """Set the links of the law's graph from the link matrix of the start."""
        self._first_links = None
        lists = self.lists[0]
        if lists is not None and self.spec.graphs[0].memory:
            remember_links(lists, np.asarray(links), self.ids)

    def move(
        self, t: float, *, keep: float, kick: float, drift: float, velocity_lag: float = 0.0,
        exponential_damping: float = 1.0, hold: bool = False,
    ) -> None:  # fmt: skip
        """Run one pass of the kernel from X to Y; the caller decides whether Y becomes the state.

        Parameters
        ----------
        keep
            Factor on the old velocity.
        kick, drift
            Times for which the control acts on velocities, and velocities on positions.
        velocity_lag
            Time by which velocities lag behind positions.
        exponential_damping
            1 if damping of velocities is exponential within the kick, else 0.
        hold
            Whether links do not change.
        """
        T = self.dtype
        if self.spec.layout.law.beyond_neighbours or (
            self.spec.ledger and self.spec.layout.energy.frame == "centre of mass"
        ):
            self._fill_means(self.X, self.M)
        lists: list[object] = []
        radii, parameters, velocity = self.radii, self.parameters, self.displacement.velocity
        for number, found in enumerate(self.lists):
            assert found is not None
            lists += [found.rows.reshape(-1), found.first, found.count, radii.each[number], radii.limits[number]]
        if self.obstacles is not None:
            speed = self.top_speed + float(np.linalg.norm(self.displacement.velocity))
            self.obstacles.require(self.X[: self.m], self.tiles, t, speed * abs(drift))
            lists += [x for pair in self.obstacles.lists for x in pair]
        begin = (float(t), T(keep), T(kick), T(drift), T(velocity_lag), T(exponential_damping))
        arguments = (
            self.agents, self.successor, self.n, *lists, parameters.P, parameters.A, self.O, self.ids,
            parameters.seeds, parameters.matrices, self.M, velocity, self.tile_extremes, self.sums,
        )  # fmt: skip
        self.workers.each(self.kernel, self.tiles, *begin, hold, *arguments)
        if self.flow_kernel is not None:
            # Means of positions are unchanged; those of velocities are recomputed from the result of the pass.
            self._fill_means(self.Y[self.m :], self.M[self.m :])
            self.workers.each(self.flow_kernel, self.tiles, *begin, True, *arguments)
        if self.planted is not None:
            arrays = PassArrays(self.agents, self.successor, self.ids, self.n, self.M, velocity, self.tile_extremes)
            self.planted.move(self.workers, arrays, begin, lists)
        self.read_tile_extremes()
        if self.extremes[2] > 0 and self.lost is None and not hold:
            self.lost = self._broken_pair()

    def _broken_pair(self) -> tuple[int, int]:
        """Numbers of the agents of the nearest pair beyond its radius, in the tiles with a broken link."""
        kinds = self.spec.graphs
        least = min(float(x[0]) for x, kind in zip(self.radii.limits, kinds, strict=True) if kind.barrier)
        tiles = np.flatnonzero(self.tile_extremes[:, 2] > 0)[:4]
        i, j = nearest_pair_beyond(least, self.lists, tiles, self.X[: self.m], self.n, self.space)
        return int(self.ids[i]), int(self.ids[j])

    def read_tile_extremes(self) -> None:
        """Compute the extremes over the results of all tiles."""
        extremes_of(self.tile_extremes, self.extremes)

    def _fill_means(self, rows: Reals, out: Array) -> None:
        """Means of rows over the group, weighted by masses."""
        n = self.n
        if len(self.parameters.A) and self.spec.mass_each:
            mass = self.parameters.A[0, :n].astype(np.float64)
            out[:] = (rows[:, :n] * mass).sum(axis=1) / mass.sum()
        else:
            out[:] = rows[:, :n].mean(axis=1, dtype=np.float64)

    def take_velocities(self, t: float) -> None:
        """Initialize the velocities of agents of order 1 with those of their first step; links do not change.

        Parameters
        ----------
        t
            The time.
        """
        self.move(t, keep=0.0, kick=1.0, drift=0.0, exponential_damping=0.0, hold=True)
        self.agents[:, self.m :] = self.successor[:, self.m :]
        self._fill_pads()
        self.top_speed = fastest(self.agents[: self.n, self.m :])

    def swap(self, stride: float) -> None:
        """Make Y the state, reached by a drift over the time ``stride``."""
        self.agents, self.successor = self.successor, self.agents
        self.top_speed = float(np.sqrt(self.extremes[0]))
        if self.obstacles is not None:
            self.obstacles.moved(
                abs(stride) * (self.top_speed + float(np.linalg.norm(self.displacement.velocity))), abs(stride)
            )
        self.displacement.add(stride, self.top_speed)

    def adopt(self, scenario: Scenario, spec: KernelSpec, t: float) -> None:
        """Replace the law by one over graphs of the same kinds; links are kept.

        Parameters
        ----------
        spec
            Specification of the kernel of the new law.
        """
        before, self.spec = self.spec, spec
        if only_numbers_differ(before, spec):
            self.radii.graphs = scenario.law.graphs
            self._set_parameters(scenario, t)
            return
        self._take_kernels(spec)
        self.sums = np.zeros((self.tiles if spec.ledger else 1, len(sums_of(spec))), np.float64)
        self._set_obstacles(scenario)
        self.radii = GraphRadii(scenario.law.graphs, spec, self.ids, self.n)
        self._set_parameters(scenario, t)
        self._build_fixed()
        self.displacement.bound = np.inf
        if self.moving:
            self.rebuild(0.0)

    def in_order(self, array: Reals) -> Array:
        """Rows of ``array``, shape (k, size), as float64 columns in the order of identities, shape (n, k)."""
        out = np.empty((self.n, len(array)))
        out[self.ids[: self.n]] = array[:, : self.n].T
        return out

    @property
    def nbytes(self) -> int:
        """Memory of all arrays in bytes."""
        displacement, parameters = self.displacement, self.parameters
        arrays = [self.agents, self.successor, self.ids, self._ids_buffer, self.tile_extremes, self.sums]
        arrays += [parameters.A, displacement.reference]
        sorter = self.sorter
        arrays += [sorter.key, sorter.key_buffer, sorter.index_buffer, sorter.order, sorter.start, *self.radii.each]
        spares = [b.spare for b in self.builders if b.spare is not None]
        return int(sum(a.nbytes for a in arrays)) + sum(x.nbytes for x in [*self.lists, *spares] if x is not None)
