"""Particle arrays: agents with their neighbour lists, moved by the kernels of a law."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flocking.arrays import Array, Numbers32, Reals
from flocking.engine.fixed_step.threads import Workers
from flocking.engine.tiles.kernels.spec import PRECISIONS, KernelSpec, only_numbers_differ
from flocking.engine.tiles.kernels.step_kernel import tile_kernels
from flocking.engine.tiles.kernels.tile_sums import sums_of
from flocking.engine.tiles.measures import column_sums, extremes_of
from flocking.engine.tiles.neighbours.listed_pairs import nearest_pair_beyond
from flocking.engine.tiles.neighbours.obstacle_lists import ObstacleLists
from flocking.engine.tiles.particles.graph_radii import GraphRadii
from flocking.engine.tiles.particles.law_parameters import LawParameters
from flocking.engine.tiles.particles.listed_agents import ListedAgents
from flocking.engine.tiles.planted_law import PassArrays, Planted
from flocking.model.law import Scenario
from flocking.model.state import State


class LawKernels:
    """Compiled passes of a law.

    Parameters
    ----------
    spec
        Specification of the kernels.
    planted
        Another law that acts in the place of the declared one, in tests; None for none.

    Attributes
    ----------
    move, flow
        The pass over all tiles, and the second one of agents of order 1, None where there is none.
    obstacle_rows
        Numbers of the obstacles, as the passes take them.
    """

    def __init__(self, spec: KernelSpec, planted: Planted | None = None) -> None:
        module = tile_kernels(spec)
        self.move, self.flow = module.move, module.flow
        self.obstacle_rows: object = spec.layout.obstacle_rows()
        self.planted = planted


class PassResults:
    """What the last pass computed beside the next state.

    Parameters
    ----------
    spec
        Specification of the kernels.
    tiles
        Number of tiles.
    m
        Number of axes.

    Attributes
    ----------
    tile_extremes
        For each tile the largest square of a speed, the smallest square of a distance and whether a link broke, shape
        (tiles, 3).
    extremes
        The same of all tiles, shape (3,).
    sums
        Sums of the ledger for each tile; of one where there is no ledger.
    means
        Mean position and velocity of the group, where the law needs them, shape (2m,).
    """

    def __init__(self, spec: KernelSpec, tiles: int, m: int) -> None:
        self.begin_tiles(spec, tiles)
        self.extremes: Array = np.zeros(3)
        self.means: Array = np.zeros(2 * m, np.float64)

    def begin_tiles(self, spec: KernelSpec, tiles: int) -> None:
        """Make room for another number of tiles.

        Parameters
        ----------
        spec, tiles
            As for the class.
        """
        self.tile_extremes: Reals = np.zeros((tiles, 3), PRECISIONS[spec.precision])
        self.begin_sums(spec, tiles)

    def begin_sums(self, spec: KernelSpec, tiles: int) -> None:
        """Make room for the sums of another law.

        Parameters
        ----------
        spec, tiles
            As for the class.
        """
        self.sums: Array = np.zeros((tiles if spec.ledger else 1, len(sums_of(spec))), np.float64)


class ParticleArrays(ListedAgents):
    """Agents under one law.

    Parameters
    ----------
    scenario
        Law, agents and energy.
    state, spec, workers, memory_limit, skin
        As for `ListedAgents`.
    """

    def __init__(
        self, scenario: Scenario, state: State, spec: KernelSpec, workers: Workers, memory_limit: float,
        skin: float | None = None,
    ) -> None:  # fmt: skip
        super().__init__(scenario, state, spec, workers, memory_limit, skin)
        self.kernels = LawKernels(spec)
        self.results = PassResults(spec, self.tiles, self.m)
        self._set_parameters(scenario, state.t)
        self._set_obstacles(scenario)

    def rebuild(self, step: float, skin: float | None = None) -> None:
        """Sort the agents and rebuild all lists, see `ListedAgents.rebuild`; those of obstacles when they are needed.

        Parameters
        ----------
        step
            The time step; the skin is chosen by it.
        skin
            Width of the skin; chosen by default.
        """
        super().rebuild(step, skin)
        if self.moving and self.obstacles is not None:
            self.obstacles.used = np.inf

    def _reorder(self, order: Numbers32) -> None:
        super()._reorder(order)
        self.parameters.reorder(order)

    def _set_obstacles(self, scenario: Scenario) -> None:
        met = self.spec.layout.obstacle_groups()
        self.obstacles = ObstacleLists(scenario.law, [term.range for term, _ in met]) if met else None

    def _set_parameters(self, scenario: Scenario, t: float) -> None:
        self.parameters = LawParameters(scenario, self.spec, t, self.ids[: self.size], self.n)

    def pass_switch_time(self, scenario: Scenario, t: float) -> None:
        """Use the values of scheduled gains from time ``t`` on."""
        self._set_parameters(scenario, t)
        if self.kernels.planted is not None:
            self.kernels.planted.pass_switch_time(t)

    def move(
        self, t: float, *, keep: float, kick: float, drift: float, velocity_lag: float = 0.0,
        exponential_damping: float = 1.0, hold: bool = False, writes: bool = True,
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
        writes
            Whether Y is written; without, the pass leaves extremes, links and the sums of the ledger alone.
        """
        T = self.dtype
        # Further passes of the same step read Y.
        writes = writes or self.kernels.flow is not None or self.kernels.planted is not None
        self.refresh_copies(self.agents)
        if self.spec.reads_means:
            self.fill_means(self.X, self.results.means)
        parameters, velocity = self.parameters, self.displacement.velocity
        lists = [*self.graph_arguments(self.lists), *self.obstacle_arguments(t, drift)]
        kernels, results, bodies = self.kernels, self.results, self.body_rows
        begin = (float(t), T(keep), T(kick), T(drift), T(velocity_lag), T(exponential_damping))
        arguments = (
            self.agents, self.successor if writes else self.successor[:0], self.n, *lists, parameters.P, parameters.A,
            kernels.obstacle_rows, self.ids,
            parameters.seeds, parameters.matrices, results.means, velocity, results.tile_extremes, results.sums,
            *((bodies.further, bodies.slopes, bodies.controls) if self.spec.bodied else ()),
        )  # fmt: skip
        self.workers.each(kernels.move, self.tiles, *begin, hold, *arguments)
        if kernels.flow is not None:
            self.refresh_copies(self.successor)
            # Means of positions are unchanged; those of velocities are recomputed from the result of the pass.
            self.fill_means(self.Y[self.m :], self.results.means[self.m :])
            self.workers.each(kernels.flow, self.tiles, *begin, True, *arguments)
        if kernels.planted is not None:
            arrays = PassArrays(
                self.agents, self.successor, self.ids, self.n, results.means, velocity, results.tile_extremes
            )
            kernels.planted.move(self.workers, arrays, begin, lists)
        if drift:
            self.begin_copies(self.successor)
        self.read_tile_extremes()
        if self.results.extremes[2] > 0 and self.lost is None and not hold:
            self.lost = self._broken_pair()

    def rates(self, t: float, velocities: Reals) -> Reals:
        """Accelerations of the agents (velocities of those of order 1), shape (m, size); nothing else changes.

        Parameters
        ----------
        t
            The time.
        velocities
            Velocities at the time of the positions, which half-step-velocity Verlet does not store, shape (m, size).
        """
        kept, moving = self.X[self.m :].copy(), velocities.copy()
        if self.spec.order == 2:
            self.X[self.m :] = moving
        self.move(t, keep=0.0, kick=1.0, drift=0.0, exponential_damping=0.0, hold=True)
        self.X[self.m :] = kept
        return self.Y[self.m :]

    def obstacle_arguments(self, t: float, drift: float = 0.0, places: Reals | None = None) -> list[object]:
        """Obstacles within range of each tile, as kernels take them.

        Parameters
        ----------
        t, drift
            As for `move`.
        places
            Other positions of the agents than their own, shape (m, size), for which no lists are kept.
        """
        if self.obstacles is None:
            return []
        if places is None:
            speed = self.top_speed + float(np.linalg.norm(self.displacement.velocity))
            self.obstacles.require(self.X[: self.m, : self.size], self.tiles, t, speed * abs(drift))
        lists = self.obstacles.lists if places is None else self.obstacles.around(places, self.tiles, t)
        return [x for pair in lists for x in pair]

    def refresh_copies(self, rows: Reals) -> None:
        """Set the copies of agents of other processes in an array of agents; here there are none.

        Parameters
        ----------
        rows
            The array, with `size` rows of own agents.
        """

    def begin_copies(self, rows: Reals) -> None:
        """Begin to set copies in an array that is going to be the state; `refresh_copies` ends it.

        Parameters
        ----------
        rows
            The array; unchanged until the next step.
        """

    def motions(self) -> tuple[Array, Array, Numbers32] | None:
        """Positions before the last step, displacements in it and numbers of all agents, on the first process."""
        q = self.Y[: self.m, : self.n].T.astype(np.float64)
        return q, self.X[: self.m, : self.n].T - q, self.ids[: self.n]

    def agree(self, check: Callable[[], None]) -> None:
        """Make a check; if it raises an error in one process, all processes raise it.

        Parameters
        ----------
        check
            Raises the error.
        """
        check()

    def group_sum(self, values: Array) -> Array:
        """Sum over all processes.

        Parameters
        ----------
        values
            Sums over the agents of this process.
        """
        return values

    def agreed_pair(self, square: float, pair: tuple[int, int] | None) -> tuple[int, int] | None:
        """The closest pair of all processes.

        Parameters
        ----------
        square
            Smallest squared distance in this process.
        pair
            Numbers of its agents.
        """
        return pair

    def total_sums(self) -> Array:
        """The sums of the last pass over all tiles, in a fixed order."""
        total = np.empty(self.results.sums.shape[1])
        column_sums(self.results.sums, total)
        return total

    def _broken_pair(self) -> tuple[int, int] | None:
        """Numbers of the agents of the nearest pair beyond its radius, in the tiles with a broken link."""
        kinds = self.spec.graphs
        least = min(float(x[0]) for x, kind in zip(self.radii.limits, kinds, strict=True) if kind.barrier)
        tiles = np.flatnonzero(self.results.tile_extremes[:, 2] > 0)[:4]
        i, j = nearest_pair_beyond(least, self.lists, tiles, self.X[: self.m], self.n, self.space)
        return int(self.ids[i]), int(self.ids[j])

    def read_tile_extremes(self) -> None:
        """Compute the extremes over the results of all tiles."""
        extremes_of(self.results.tile_extremes, self.results.extremes)

    def fill_means(self, rows: Reals, out: Array) -> None:
        """Means of rows over the group, weighted by masses.

        Parameters
        ----------
        rows
            Numbers of the agents, shape (k, size or more).
        out
            Takes the means, shape (k,).
        """
        n = self.n
        if len(self.parameters.A) and self.spec.mass_each:
            mass = self.parameters.A[0, :n].astype(np.float64)
            out[:] = self.group_sum((rows[:, :n] * mass).sum(axis=1)) / self.group_sum(mass.sum(keepdims=True))
        else:
            out[:] = self.group_sum(rows[:, :n].sum(axis=1, dtype=np.float64)) / self.everyone

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
        self.top_speed = self._largest_speed()

    def swap(self, stride: float) -> None:
        """Make Y the state, reached by a drift over the time ``stride``."""
        self.agents, self.successor = self.successor, self.agents
        self.top_speed = float(np.sqrt(self.results.extremes[0]))
        self.moved(stride, self.top_speed)

    def moved(self, stride: float, speed: float) -> None:
        """Account for motion over the time ``stride`` with at most ``speed`` in the frame of the lists."""
        if self.obstacles is not None:
            fastest = speed + float(np.linalg.norm(self.displacement.velocity))
            self.obstacles.moved(abs(stride) * fastest, abs(stride))
        self.displacement.add(stride, speed)

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
        self.kernels = LawKernels(spec, self.kernels.planted)
        self.results.begin_sums(spec, self.tiles)
        self._set_obstacles(scenario)
        self.radii = GraphRadii(scenario.law.graphs, spec, self.ids, self.n, scenario.start.n)
        self._set_parameters(scenario, t)
        self._build_fixed()
        self.displacement.bound = np.inf
        if self.moving:
            self.rebuild(0.0)

    @property
    def nbytes(self) -> int:
        """Memory of all arrays in bytes."""
        displacement, parameters = self.displacement, self.parameters
        arrays = [self.agents, self.successor, self.ids, self._room.spare_ids]
        arrays += [self.results.tile_extremes, self.results.sums]
        arrays += [parameters.A, displacement.reference]
        sorter = self.search.sorter
        arrays += [
            sorter.key,
            sorter.key_buffer,
            sorter.index_buffer,
            sorter.order,
            sorter.start,
            *self.radii.each,
            *self.radii.views,
        ]
        spares = [b.spare for b in self.search.builders if b.spare is not None]
        return int(sum(a.nbytes for a in arrays)) + sum(x.nbytes for x in [*self.lists, *spares] if x is not None)
