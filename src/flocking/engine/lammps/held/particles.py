"""Particle arrays of one rank under held control: forces, samples and believed links are sent with the agents."""

from __future__ import annotations

import numpy as np

from flocking.arrays import AnyArray, Array, Numbers32, Reals
from flocking.engine.fixed_step.threads import Workers
from flocking.engine.lammps.domains.link_tables import link_table, mark_links, most_links
from flocking.engine.lammps.domains.messages import fetched
from flocking.engine.lammps.domains.particles import RankParticles
from flocking.engine.lammps.held.actuation import RankActuation
from flocking.engine.lammps.held.samples import RankSampleStore
from flocking.engine.lammps.ranks import Ranks
from flocking.engine.protocol.waiting_forces import Waiting
from flocking.engine.tiles.held.held_particles import SPARE, HeldParticles
from flocking.engine.tiles.held.messages import SampleStore
from flocking.engine.tiles.kernels.spec import KernelSpec
from flocking.engine.tiles.neighbours.listed_pairs import remember_links
from flocking.engine.tiles.neighbours.neighbour_lists import NOBODY
from flocking.model.bodies.body import Body
from flocking.model.law import Scenario
from flocking.model.state import State


class HeldRankParticles(RankParticles, HeldParticles):
    """The agents of this rank with the forces that act on them, and copies with what was received of those.

    Links by the information of agents are sent with them as true links are. All other numbers of an agent are
    requested from the rank that had it, also for copies.

    Parameters
    ----------
    scenario, state, spec, workers, memory_limit, skin, ranks, log
        As for `RankParticles`.
    tables
        As there; those of links by the information of agents follow those of true links.

    Attributes
    ----------
    waiting
        Forces of agents of this rank that act later.
    """

    store: RankSampleStore | None
    actuation: RankActuation | None

    def __init__(
        self, scenario: Scenario, state: State, spec: KernelSpec, workers: Workers, memory_limit: float,
        skin: float | None = None, *, ranks: Ranks, log: str = "none", tables: list[Numbers32] | None = None,
    ) -> None:  # fmt: skip
        self.waiting: Waiting = []
        super().__init__(scenario, state, spec, workers, memory_limit, skin, ranks=ranks, log=log, tables=tables)
        self._first_known_links = state.links if tables is None else None
        self._nothing_known_yet = tables is None

    def _new_store(self, scenario: Scenario, memory_limit: float) -> SampleStore:
        return RankSampleStore(
            scenario, self.agents, self.n, self.dtype, memory_limit, self.workers, self.ranks
        )  # fmt: skip

    def new_actuation(self, body: Body, start: State) -> RankActuation:
        """See `HeldParticles.new_actuation`."""
        return RankActuation(body, start, self.dtype, self.ids[: self.size], self.workers, self._periods)

    def _resize(self) -> None:
        super()._resize()
        self.acting = np.zeros(self.size, np.int32)
        self._fastest = np.zeros(self.tiles)
        self.known_builders = [self._builder(old) for old in self.known_builders]
        self.motion.reorder()

    # --- rebuilds ---

    def rebuild(self, step: float, skin: float | None = None) -> None:
        """Exchange agents among the ranks with all that belongs to them, sort them and rebuild all lists.

        Parameters
        ----------
        step, skin
            As for `RankParticles.rebuild`.
        """
        if self.store is not None:
            self.search.margin = SPARE * self.store.deviation(None)
        before, columns = self.ids[: self.n].copy(), self.columns()
        self._before = before
        super().rebuild(step, skin)
        self.hold_columns(fetched(self.ranks.comm, before, columns, self.ids))
        self.forget_used()

    def columns(self) -> AnyArray:
        """Of each agent of this rank: its force, samples, what its body goes on from, and its forces that act later.

        Shape (n, `width`).
        """
        n = self.n
        parts = [self.force[:, :n].T.astype(np.float64)]
        parts += [self.store.columns()] if self.store is not None else []
        parts += [self.actuation.columns_here(n)] if self.actuation is not None else []
        for _, agents, force in self.waiting:
            later, places = np.zeros((n, 1 + self.m)), self.places_of(agents)
            later[places, 0], later[places, 1:] = 1.0, force
            parts.append(later)
        return np.concatenate(parts, axis=1)

    @property
    def width(self) -> int:
        """Number of columns of `columns`."""
        own = [each.width for each in (self.store, self.actuation) if each is not None]
        return self.m + sum(own) + len(self.waiting) * (1 + self.m)

    def well_formed(self, columns: AnyArray) -> bool:
        """Whether all that `columns` of anybody hold is finite, but for forces that act now or are to.

        Parameters
        ----------
        columns
            Shape (N, `width`).
        """
        m, forces = self.m, self.m + (0 if self.store is None else self.store.width)
        own = columns[:, forces:] if self.actuation is None else columns[:, forces + m :]
        return bool(np.isfinite(columns[:, m:forces]).all() and np.isfinite(own).all())

    def hold_columns(self, columns: AnyArray) -> None:
        """Hold what belongs to the agents that are here now.

        Parameters
        ----------
        columns
            A row of `columns` for each place; where forces act later those of `waiting` are replaced.
        """
        n, m, size = self.n, self.m, self.size
        self.force = np.ascontiguousarray(columns[:size, :m].T.astype(self.dtype))
        end = m
        if self.store is not None:
            end += self.store.width
            self.store.hold(columns[:, m:end], n, size)
        if self.actuation is not None:
            width = self.actuation.width
            self.actuation.hold(columns[:size, end : end + width], self.ids[:size])
            end += width
        order = np.argsort(self.ids[:n], kind="stable")
        numbers = self.ids[:n][order].astype(np.int64)
        for k, (when, _, _) in enumerate(self.waiting):
            later = columns[:n, end + k * (1 + m) : end + (k + 1) * (1 + m)][order]
            here = later[:, 0] > 0.0
            self.waiting[k] = (when, numbers[here], np.ascontiguousarray(later[here, 1:].astype(self.dtype)))

    def _widths(self, tables: list[Numbers32] | None) -> list[Numbers32]:
        found = super()._widths(tables)
        if tables is None:
            found += [np.zeros((self.everyone, 0), np.int32) for _ in self._known_with_memory]
        return found

    def _tables(self) -> list[Numbers32]:
        found = super()._tables()
        for number in self._known_with_memory:
            lists = self.known[number]
            if lists is None:
                found.append(np.zeros((self.n, 0), np.int32))
                continue
            width = most_links(lists, self.n, self.workers)
            found.append(link_table(lists, self.n, self.ids, width, self.workers))
        return found

    def _list_moving(self, skin: float, tables: list[Numbers32]) -> tuple[int, int] | None:
        known = len(self._known_with_memory)
        beyond = skin + self.search.margin
        if self._no_links_yet and self.actuation is not None and self.actuation.heading is not None:
            # Afterwards links go with the agents.
            rows = self.actuation.heading[: len(self._before)]
            self.radii.face(fetched(self.ranks.comm, self._before, rows, self.ids[: self.size]))
        lost = super()._list_moving(beyond, tables[: len(tables) - known])
        self._list_known(beyond, tables[len(tables) - known :])
        return lost

    def _list_known(self, beyond: float, tables: list[Numbers32]) -> None:
        """Build the lists of the graphs whose links by the information of agents have memory."""
        radii, left = self.radii, iter(tables)
        self.known = [None] * len(self.known)
        for number in self._known_with_memory:
            listed, inside = radii.searched(number, beyond, self.ids, self.workers)
            table = next(left, None)
            fresh = self._nothing_known_yet or table is None
            lists, _ = self.known_builders[number].build(
                self.agents, listed, self._grid, self._start, None, NOBODY, NOBODY,
                begin=inside if fresh else None, remember=True, beside=self._beside,
            )  # fmt: skip
            self.known[number] = lists
            if table is not None and not fresh:
                mark_links(lists, self.n, self.ids, table[self._received], self.workers)
        self._nothing_known_yet = False
        links, self._first_known_links = self._first_known_links, None
        if links is not None and self.n and self.known[0] is not None and self.control_spec.graphs[0].memory:
            remember_links(self.known[0], np.asarray(links), self.ids)

    # --- steps ---

    def coast(self, h: float, target: Reals | None = None) -> float:
        """Move all agents by ``h``, see `HeldParticles.coast`; copies of a ``target`` are set. Collective."""
        if self._begin is not None and target is None:
            # Agents are divided by positions that are known on all ranks, which they are at the start only.
            self.rebuild(h)
        top = super().coast(h, target)
        if target is not None:
            self.refresh_copies(target)
        return top

    def _fastest_of_all(self, speed: float) -> float:
        largest: Array = np.array([speed if speed == speed else np.inf, self.notice])
        found = self.ranks.reduced(largest, np.zeros(0))[0]
        self.noticed = float(found[1])
        return float(found[0])
