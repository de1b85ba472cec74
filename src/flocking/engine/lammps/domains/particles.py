"""Particle arrays of one rank: the agents of its domain, and copies of those near it."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array, Numbers32, Reals, Vector
from flocking.engine.fixed_step.threads import Workers
from flocking.engine.lammps.domains.copies import Copies
from flocking.engine.lammps.domains.decomposition import Decomposition, Residents
from flocking.engine.lammps.domains.fixed_links import complete_beside, fixed_partners
from flocking.engine.lammps.domains.link_tables import link_table, mark_links, most_links
from flocking.engine.lammps.domains.messages import among, fetched, newcomers
from flocking.engine.lammps.domains.shared_particles import SharedParticles
from flocking.engine.lammps.ranks import Ranks
from flocking.engine.tiles.kernels.spec import GraphKind, KernelSpec
from flocking.engine.tiles.neighbours.cell_list import Grid, Sorter, Survey, choose_grid
from flocking.engine.tiles.neighbours.fixed_lists import fixed_lists
from flocking.engine.tiles.neighbours.listed_pairs import remember_links
from flocking.engine.tiles.neighbours.neighbour_lists import (
    NOBODY,
    ListBuilder,
    TileLists,
    TooManyNeighboursError,
)
from flocking.engine.tiles.neighbours.verlet_skin import FIRST_SKIN, best_skin
from flocking.engine.tiles.particles.displacement import CERTAIN, Displacement
from flocking.engine.tiles.particles.graph_radii import GraphRadii
from flocking.model.law import Scenario
from flocking.model.state import State

SAME_SKIN, SAME_STRIDE = 8, 0.1
"""A skin is kept for at most so many rebuilds, while the largest stride stays within this share of the one before."""


class RankParticles(SharedParticles):
    """The agents of this rank, with the interface of the arrays of all agents. All methods are collective.

    Rows of agents come first, filled up to whole tiles; copies of agents of other ranks follow. What is decided from
    numbers of the group - when lists are rebuilt, the skin, the largest speed - is decided from those of all ranks.

    Parameters
    ----------
    scenario, state, spec, workers, memory_limit, skin
        As for `ParticleArrays`; ``state`` holds all agents.
    ranks
        The ranks.
    log
        LAMMPS's log file, or ``"none"``.
    tables
        Links of each graph with memory to begin with, see `Residents`; None where they follow from the state.

    Attributes
    ----------
    migrated
        Number of agents that have come from other ranks.
    """

    def __init__(
        self, scenario: Scenario, state: State, spec: KernelSpec, workers: Workers, memory_limit: float,
        skin: float | None = None, *, ranks: Ranks, log: str = "none", tables: list[Numbers32] | None = None,
    ) -> None:  # fmt: skip
        self.ranks, self._scenario, self._t = ranks, scenario, state.t
        self.migrated = 0
        self._limit = memory_limit
        self._copies: Copies | None = None
        # Before the first rebuild the agents are divided by their numbers.
        cut = [state.n * k // ranks.size for k in (ranks.rank, ranks.rank + 1)]
        self._begin: tuple[State, list[Numbers32] | None] | None = (state, tables)
        self._part = slice(*cut)
        links = state.links
        part = _rows_of(state, self._part)
        super().__init__(scenario, part, spec, workers, memory_limit, skin)
        self.ids[: self.n] = np.arange(*cut, dtype=np.int32)
        self._fill_pads()
        self._resize()
        self.search.first_links = links if tables is None else None
        self._no_links_yet = tables is None
        self._next_skin = 0.0
        self._skin_for = (0.0, -SAME_SKIN)
        self._decomposition = Decomposition(ranks, log, self.space) if self.moving and ranks.size > 1 else None

    def _resize(self) -> None:
        """Make anew all that depends on the number of agents of this rank."""
        spec, scenario = self.spec, self._scenario
        self.radii = GraphRadii(
            scenario.law.graphs, spec, self.ids[: self.size], self.n, self.everyone, self.radii.edges
        )  # fmt: skip
        self.search.builders = [self._builder(old) for old in self.search.builders]
        self.results.begin_tiles(spec, self.tiles)
        self._set_parameters(scenario, self._t)
        if self.obstacles is not None:
            self.obstacles.used = np.inf

    def _builder(self, old: ListBuilder) -> ListBuilder:
        """A builder for the agents of now that starts with the room that the old one needed."""
        found = ListBuilder(self.n, self._limit, self.workers, self.search.box)
        if old.chunks:
            found.capacity[: old.chunks] = old.capacity[: found.chunks]
            found.capacity[old.chunks :] = old.capacity[-1]
        else:
            found.capacity[:] = old.capacity.max(initial=0)
        found.spare = None
        return found

    def pass_switch_time(self, scenario: Scenario, t: float) -> None:
        """Use the values of scheduled gains from time ``t`` on."""
        self._t = t
        super().pass_switch_time(scenario, t)

    # --- rebuilds ---

    def rebuild(self, step: float, skin: float | None = None) -> None:
        """Exchange agents among the ranks, sort them and rebuild all lists; links are kept.

        Parameters
        ----------
        step
            The time step; the skin is chosen by it.
        skin
            Width of the skin; chosen by default.

        Raises
        ------
        TooManyNeighboursError
            On all ranks, if the lists of one would exceed the memory limit.
        """
        cutoff = max(self.radii.cutoffs)
        given = skin if skin is not None else self.search.given_skin
        width = float(given if given is not None else self._next_skin or FIRST_SKIN * cutoff)
        reach = cutoff + self.search.margin + width
        first = self._begin is not None
        came = self._exchanged(reach)
        before, further = self.ids[: self.n].copy(), np.ascontiguousarray(self.body_rows.further[:, : self.n].T)
        # Before the first exchange agents are divided by their numbers, not by space.
        self.migrated += 0 if first else newcomers(before, came.ids)
        self._take(came)
        if self.moving:
            self._sort_all(reach)
        if further.shape[1]:
            self.body_rows.further = np.ascontiguousarray(
                fetched(self.ranks.comm, before, further, self.ids[: self.size]).T
            )
        self._resize()
        self._list_all(width, came.tables)
        self.search.rebuilds += 1
        if self.moving and given is None:
            self._choose_skin(cutoff, step)

    def _exchanged(self, reach: float) -> Residents:
        """The agents that belong to this rank, and who is near them."""
        begin, self._begin = self._begin, None
        m = self.m
        if begin is not None and self._decomposition is not None:
            state, tables = begin
            p = state.p if self.spec.order == 2 else self._all_velocities()
            return self._decomposition.place(
                np.arange(state.n, dtype=np.int32), state.q, p, self._widths(tables), reach
            )  # fmt: skip
        n = self.n
        q, p = (x.astype(np.float64, copy=False) for x in (self.agents[:n, :m], self.agents[:n, m:]))
        tables = self._tables() if begin is None else [t[self._part] for t in begin[1] or []]
        if self._decomposition is None:
            return Residents(self.ids[:n].copy(), q.copy(), p.copy(), tables, NOBODY, np.zeros(0, np.int64))
        there = self._decomposition.exchanged(self.ids[:n], q, p, tables, reach, self.everyone)
        if there is None:
            there = self._placed_again(q, p, tables, reach)
        return there

    def _all_velocities(self) -> Array:
        """Velocities of the last step of agents of order 1, of all ranks, in order; no formula reads them."""
        parts = self.ranks.comm.allgather(
            (self.ids[: self.n].copy(), self.agents[: self.n, self.m :].astype(np.float64))
        )
        found = np.zeros((self.everyone, self.m))
        for ids, rows in parts:
            found[ids] = rows
        return found

    def _placed_again(self, q: Array, p: Array, tables: list[Numbers32], reach: float) -> Residents:
        """Divide all agents anew, where some went farther than LAMMPS looks for them."""
        assert self._decomposition is not None
        ids = self.ids[: self.n].copy()
        # Tables are as wide as the widest of any rank.
        most = self.ranks.comm.allreduce(np.array([t.shape[1] for t in tables], np.int64), op=_most)
        wide = [np.pad(t, ((0, 0), (0, int(w) - t.shape[1]))) for t, w in zip(tables, most, strict=True)]
        parts = self.ranks.comm.allgather((ids, q, p, wide))
        numbers, places, speeds = (np.concatenate([part[k] for part in parts]) for k in range(3))
        joined = [np.concatenate([part[3][k] for part in parts]) for k in range(len(wide))]
        return self._decomposition.place(numbers, places, speeds, joined, reach)

    def _widths(self, tables: list[Numbers32] | None) -> list[Numbers32]:
        if tables is not None:
            return tables
        return [np.zeros((self.everyone, 0), np.int32) for kind in self.spec.graphs if _travels(kind)]

    def _tables(self) -> list[Numbers32]:
        """Links of the graphs with memory by numbers of agents."""
        found = []
        for lists, kind in zip(self.lists, self.spec.graphs, strict=True):
            if _travels(kind):
                if lists is None:
                    found.append(np.zeros((self.n, 0), np.int32))
                    continue
                width = most_links(lists, self.n, self.workers)
                found.append(link_table(lists, self.n, self.ids, width, self.workers))
        return found

    def tables(self) -> list[Numbers32] | None:
        """Links of the graphs with memory in the order of `ids`; None before there are lists."""
        begin = self._begin
        if begin is not None:
            return None if begin[1] is None else [t[self._part] for t in begin[1]]
        return self._tables()

    def _take(self, came: Residents) -> None:
        """Hold the agents that came, and copies of those that they need."""
        if self._copies is not None:
            self._copies.close()
        if self._decomposition is None and self.ranks.size == 1:
            requested, self._copies = NOBODY, None
        else:
            linked = fixed_partners(came.ids, self.spec.graphs, self.radii.edges, self.everyone)
            requested = np.unique(np.concatenate([came.near, linked]))
            visible = np.arange(len(came.ids)) if any(kind.fixed for kind in self.spec.graphs) else came.visible
            # An own agent that is near through an image is near a border of the domain.
            requested = requested[~among(np.sort(came.ids[visible]), requested)].astype(np.int32)
            self._copies = Copies(self.ranks.comm, came.ids[visible], visible, requested)
        self._hold(came.ids, came.q, came.p, len(requested))
        self._received = np.arange(self.n)
        if self._copies is not None:
            self.ids[self.size :] = self._copies.ids
            self._copies.refresh(self.agents, self.size)

    def _sort_all(self, reach: float) -> None:
        """Sort agents and copies by one grid of cells."""
        n, m = self.n, self.m
        if self.search.sorter.n != n:
            self.search.sorter = Sorter(n, self.workers, self.space.lengths)
        sorter = self.search.sorter
        copies = self.agents[self.size :].copy()
        beside = Sorter(len(copies), self.workers, self.space.lengths)
        surveys = [each.survey(rows) for each, rows in ((sorter, self.agents), (beside, copies)) if each.n]
        low: Vector = np.array([x.low for x in surveys]).min(axis=0) if surveys else np.zeros(m)
        high: Vector = np.array([x.high for x in surveys]).max(axis=0) if surveys else np.zeros(m)
        grid = choose_grid(low, high, reach, max(n + len(copies), 1), self.space.lengths)
        total = n * surveys[0].velocity if n else np.zeros(m)
        seen = Survey(low, high, self.group_sum(total) / self.everyone)
        sorter.sort(self.agents, seen, reach, grid)
        beside.sort(copies, seen, reach, grid)
        self._beside = beside.start if len(copies) else NOBODY
        self._grid: Grid = grid
        self._crowding = sorter.crowding
        self._start = sorter.start
        self._seen = seen
        if len(self.displacement.reference) != self.size:
            self.displacement = Displacement(self.size, m, self.dtype)
        place = sorter.arrange(self.agents, self.ids, self.successor, self._room.spare_ids, self.displacement.reference)
        self.agents, self.successor = self.successor, self.agents
        self.ids, self._room.spare_ids = self._room.spare_ids, self.ids
        self.agents[self.size :] = copies[beside.order]
        self._fill_pads()
        self._received = sorter.order.astype(np.int64)
        if self._copies is not None:
            row = np.empty(len(copies), np.int64)
            row[beside.order] = np.arange(len(copies))
            self._copies.reorder(place.astype(np.int64), row)
            self.ids[self.size :] = self._copies.ids

    def _list_all(self, skin: float, tables: list[Numbers32]) -> None:
        """Build all lists; tables of links are in the order in which the agents came."""
        failure: TooManyNeighboursError | None = None
        lost: tuple[int, int] | None = None
        if self.moving:
            far = float(max(np.abs(self._seen.low).max(), np.abs(self._seen.high).max()))
            self.displacement.begin(skin, self._seen.velocity.astype(self.dtype), self.highest(far))
            try:
                lost = self._list_moving(skin, tables)
            except TooManyNeighboursError as error:
                failure = error
        self._agree_on_room(failure)
        if any(kind.barrier for kind in self.spec.graphs):
            self.lost = self.lost or next((x for x in self.ranks.comm.allgather(lost) if x is not None), None)
        self._build_fixed()
        self.displacement.elapsed, self.displacement.bound = 0.0, 0.0

    def _list_moving(self, skin: float, tables: list[Numbers32]) -> tuple[int, int] | None:
        q: Reals = self.agents[: self.n, : self.m]
        self.search.pair_count_bound.check(self._crowding, q, self.radii.certain_reaches, self.space)
        radii, left = self.radii, iter(tables)
        radii.turn(self.body_rows.further)
        lost = None
        for number, kind in enumerate(self.spec.graphs):
            if kind.fixed:
                continue
            listed, inside = radii.searched(number, skin, self.ids, self.workers)
            table = next(left, None) if kind.memory else None
            fresh = kind.memory and (self._no_links_yet or table is None)
            builder, old = self.search.builders[number], self.lists[number]
            if old is not None:
                # Links have been taken from the old lists before.
                builder.spare = TileLists(
                    old.rows, np.zeros(builder.tiles, np.int64), np.zeros(builder.tiles, np.int32)
                )  # fmt: skip
            self.lists[number], _ = builder.build(
                self.agents, listed, self._grid, self._start, None, NOBODY, NOBODY,
                begin=inside if fresh else None, remember=kind.memory, beside=self._beside,
            )  # fmt: skip
            lists = self.lists[number]
            assert lists is not None
            if table is not None and not fresh:
                missing = mark_links(lists, self.n, self.ids, table[self._received], self.workers)
                lost = missing if missing is not None and kind.barrier else lost
        self._no_links_yet = False
        if self.search.first_links is not None:
            links, self.search.first_links = self.search.first_links, None
            if self.lists[0] is not None and self.spec.graphs[0].memory and self.n:
                remember_links(self.lists[0], np.asarray(links), self.ids)
        return lost

    def _build_fixed(self) -> None:
        if not hasattr(self, "_received"):
            return
        for number, kind in enumerate(self.spec.graphs):
            if kind.fixed:
                edges = self.radii.edges[number]
                place = np.zeros(self.everyone, np.int32)
                place[self.ids[: self.n]] = np.arange(self.n, dtype=np.int32)
                copies = self.ids[self.size :]
                place[copies] = self.size + np.arange(len(copies), dtype=np.int32)
                if edges is None:
                    self.lists[number] = complete_beside(self.n, self.size, len(copies))
                else:
                    self.lists[number] = fixed_lists(self.ids[: self.size], place, *edges, self.workers, self.n)

    def _agree_on_room(self, failure: TooManyNeighboursError | None) -> None:
        needed = self.highest(0.0 if failure is None else failure.bytes_needed)
        if needed:
            raise TooManyNeighboursError(needed)

    def _choose_skin(self, cutoff: float, step: float) -> None:
        """The skin of the next lists, chosen by the rank with the most agents; the same while speeds are."""
        stride = 2.0 * self.top_speed * step / CERTAIN
        chosen_for, lists = self._skin_for
        if lists + SAME_SKIN > self.search.rebuilds and abs(stride - chosen_for) <= SAME_STRIDE * chosen_for:
            return
        self._skin_for = (stride, self.search.rebuilds)
        chooser = 0 if self._decomposition is None else int(np.argmax(self._decomposition.counts))
        found = None
        if self.ranks.rank == chooser:
            identity = self.search.sorter
            identity.order, identity.start, identity.grid = np.arange(self.n, dtype=np.int32), self._start, self._grid
            found = best_skin(self.agents, identity, cutoff, stride, self.space)
        self._next_skin = float(self.ranks.comm.bcast(found, root=chooser))

    def refresh_copies(self, rows: Reals) -> None:
        """Set the copies of agents of other ranks.

        Parameters
        ----------
        rows
            The array, with `size` rows of own agents.
        """
        if self._copies is not None:
            self._copies.refresh(rows, self.size)

    def begin_copies(self, rows: Reals) -> None:
        """Begin to set copies: ranks then wait for each other once in a step, in the reduction that follows.

        Parameters
        ----------
        rows
            As for `refresh_copies`.
        """
        if self._copies is not None:
            self._copies.begin(rows)

    def close(self) -> None:
        """Release the memory of LAMMPS and the requests of messages."""
        if self._copies is not None:
            self._copies.close()
        if self._decomposition is not None:
            self._decomposition.close()


def _rows_of(state: State, rows: slice) -> State:
    """Some agents of a state, or none, which `State` does not allow."""
    found = object.__new__(State)
    columns = {name: values[rows] for name, values in state.columns.items()}
    parts = {"q": state.q[rows], "p": state.p[rows], "t": state.t, "links": None, "columns": columns}
    for name, value in parts.items():
        object.__setattr__(found, name, value)
    return found


def _travels(kind: GraphKind) -> bool:
    """Whether links of a graph go with the agents."""
    return kind.memory and not kind.fixed


def _most(a: Array, b: Array) -> Array:
    return np.maximum(a, b)
