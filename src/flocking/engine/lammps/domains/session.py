"""Session of the kernels of the tiled engine on any number of MPI ranks; all methods are collective."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from flocking.arrays import AnyArray, Array, Links, Numbers, Positions, Reals, Velocities
from flocking.engine import interruption
from flocking.engine.fixed_step.threads import Workers
from flocking.engine.lammps import library
from flocking.engine.lammps.domains.checkpoint import (
    LinkRows,
    columns_of,
    link_rows,
    link_tables,
    stored_options,
    unpacked,
)
from flocking.engine.lammps.domains.frame_shares import FrameShares
from flocking.engine.lammps.domains.instability import RankInstability
from flocking.engine.lammps.domains.options import DomainOptions
from flocking.engine.lammps.domains.particles import RankParticles
from flocking.engine.lammps.ledger import observed_state
from flocking.engine.lammps.ranks import Ranks
from flocking.engine.protocol.session import Packed, Session, Stored, end_of_slice, time_to_reach
from flocking.engine.runs.frame_parts import FramePart
from flocking.engine.runs.recorder import MOST_LINKED
from flocking.engine.tiles import checks
from flocking.engine.tiles.checkpoint import pack_tiles
from flocking.engine.tiles.instability import Instability
from flocking.engine.tiles.integrators import integrator_named
from flocking.engine.tiles.neighbours.listed_pairs import listed_pairs
from flocking.engine.tiles.options import TilesOptions
from flocking.engine.tiles.particle_memory import ParticleMemory
from flocking.engine.tiles.particles.particle_arrays import ParticleArrays
from flocking.engine.tiles.planted_law import Planted
from flocking.engine.tiles.records import TilesRecorder
from flocking.engine.tiles.session import TilesSession
from flocking.engine.tiles.snapshot import TilesSnapshot
from flocking.errors import NotFinite, SimulationError, UnsupportedLaw
from flocking.model.law import Law, Scenario
from flocking.model.state import State

GO_ON, TIME_IS_OVER, INTERRUPTED = 0.0, 1.0, 2.0
"""What the first rank sends all others with a step: the largest counts."""


class DomainSession(TilesSession):
    """Session of the tiled kernels, each rank with the agents of a domain of space.

    Steps, checks and the ledger are those of the tiled engine; what they read of the group is that of all ranks.

    Parameters
    ----------
    scenario
        The scenario to simulate; the same on all ranks.
    options
        Options of the engine.
    plant
        The law that agents follow, over the graphs of the scenario's law; the scenario's law by default.

    Raises
    ------
    UnsupportedLaw
        If a part of the scenario is not supported.
    EngineMissing
        If LAMMPS or MPI is not installed.
    TooCrowded
        If the neighbour lists would not fit in memory.
    """

    engine = "lammps"
    options: DomainOptions
    _particles: RankParticles
    _shares: FrameShares | None = None

    def __init__(self, scenario: Scenario, options: DomainOptions, *, plant: Law | None = None) -> None:
        self.ranks = Ranks(library.communicator())
        self._tables: list[np.ndarray[tuple[int, int], np.dtype[np.int32]]] | None = None
        with self.ranks.bound():
            super().__init__(scenario, options, plant=plant)

    def _new_particles(self, scenario: Scenario, state: State) -> ParticleArrays:
        spec = self._spec(scenario)
        options = self.options
        particles = RankParticles(
            scenario, state, spec, self.workers, self._lists_limit, options.skin, ranks=self.ranks,
            log=options.keep_log or "none", tables=self._tables,
        )  # fmt: skip
        self.instability: Instability = RankInstability()
        if self.plant is not None:
            particles.kernels.planted = Planted(scenario, self.plant, spec)
            particles.kernels.planted.pass_switch_time(state.t)
        return particles

    @property
    def _lists_limit(self) -> float:
        """Largest size of the lists of this rank in bytes: all ranks of a machine share its memory."""
        options = self.options
        return options.lists_limit / (1 if options.memory_limit is not None else self.ranks.on_this_machine)

    def _automatic_step(self) -> float:
        """The step of the tiled engine, chosen by the first rank."""

        def chosen() -> float:
            options = TilesOptions(scheme=self.options.scheme, precision=self.options.precision, ledger=False)
            alone = TilesSession(self.scenario, replace(options, keep_frames=False, threads=self.workers.threads))
            return float(alone.step)

        return self.ranks.shared(chosen)

    def _resolving_step(self) -> float:
        return -self._particles.highest(-super()._resolving_step())

    @property
    def team(self) -> Ranks:
        """The ranks of the job."""
        return self.ranks

    # --- steps ---

    def advance(self, to: float, seconds: float = math.inf) -> None:
        """Take steps until the session's time is at or just beyond ``to``, or for ``seconds`` of wall time.

        The first rank decides for all when the time is over, and whether Ctrl-C was pressed.
        """
        to = time_to_reach("DomainSession", to, self.time, self.step)
        stop, particles = end_of_slice("DomainSession", seconds), self._particles
        try:
            with self.ranks.bound():
                while not self.reached(to):
                    particles.notice = self._noticed(stop)
                    self._take_step()
                    notice = particles.noticed
                    self._record()
                    if notice == INTERRUPTED:
                        interruption.check()
                        raise interruption.Noted
                    if notice == TIME_IS_OVER:
                        return
        except SimulationError as error:
            error.run = self.run(str(error))
            raise

    def _noticed(self, stop: float) -> float:
        if not self.ranks.first:
            return GO_ON
        if interruption.noted():
            return INTERRUPTED
        return TIME_IS_OVER if time.monotonic() >= stop else GO_ON

    def _record(self) -> None:
        """Store a frame if one is due, on the first rank."""
        if not self.records.due(self.time):
            return
        particles, options = self._particles, self.options
        velocities = self._guarded(lambda: self._integrator.look(particles, self.time, self.step))
        checks.links_stay(particles, self.step, self.time)
        checks.look_at_closest(particles, self.records, self.time)
        self._update_ledger()
        rows: Array | None = None
        if self._shares is not None:
            self._keep_part(self._shares, self.time, self._rows(velocities))
            return
        if options.keep_frames or options.observe:
            rows = self._gathered(velocities)
        pairs = self._linked_pairs(velocities) if options.observe or self._keeps_links else None
        self.ranks.alone(lambda: self._write_frame(self.time, rows, pairs))
        if not self.ranks.first:
            self.records.skip()

    def _gathered(self, velocities: Reals) -> Array | None:
        """Positions, velocities and further columns of all agents in order, on the first rank; None elsewhere.

        Velocities are those of the agents here, shape (m, size).
        """
        return self._particles.gathered(self._rows(velocities))

    def _rows(self, velocities: Reals) -> AnyArray:
        """Positions, velocities and further columns of the agents here."""
        particles = self._particles
        n, m = particles.n, particles.m
        return np.concatenate(
            [particles.agents[:n, :m], velocities[:, :n].T, particles.body_rows.further[:, :n].T], axis=1
        )

    def share_frames(self, agents: int) -> bool:
        """Send frames to the ranks that write them, unless something reads them as a whole. See `Session`."""
        if not self.options.observe and self.options.keep_frames and not self._keeps_links:
            self._shares = FrameShares(self.ranks, self.scenario.start.n, agents)
        return self._shares is not None

    def _keep_part(self, shares: FrameShares, t: float, rows: AnyArray) -> None:
        """Check the state of all agents, and keep that of the agents whose chunks this rank writes."""
        particles, m = self._particles, self._particles.m
        particles.agree(lambda: self._check_finite_rows(rows, t))
        out = np.abs(rows[:, :m]).max(axis=1)
        # The median of all is between the least and the largest of those of the ranks.
        middle = particles.highest(float(np.median(out)) if len(out) else 0.0)
        if not checks.resolved(particles, middle):
            found = particles.gathered(rows[:, :m])
            self.ranks.alone(lambda: None if found is None else checks.resolution(particles, found, t))
        first, found = shares.collected(particles.ids[: particles.n], rows)
        kind = self.records.dtype
        self.records.parts.append(
            FramePart(t, first, found[:, :m].astype(kind), found[:, m : 2 * m].astype(kind), found[:, 2 * m :].copy())
        )

    def _check_finite_rows(self, rows: AnyArray, t: float) -> None:
        if not np.isfinite(rows).all():
            raise NotFinite("The state became infinite or NaN.", time=t)

    @property
    def _keeps_links(self) -> bool:
        return self.options.keep_frames and self.scenario.start.n <= MOST_LINKED

    def _write_frame(self, t: float, rows: Array | None, pairs: Numbers | None) -> None:
        """Check and store the state of all agents at time ``t`` on the first rank."""
        if rows is None:
            self.records.skip()
            return
        m = self._particles.m
        q, p = np.ascontiguousarray(rows[:, :m]), np.ascontiguousarray(rows[:, m : 2 * m])
        if not np.isfinite(rows).all():
            raise NotFinite("The state became infinite or NaN.", time=t)
        checks.resolution(self._particles, q, t)
        observed = None
        if self.options.observe and pairs is not None:
            observed = observed_state(State(q, p, t), (pairs[:, 0], pairs[:, 1]), self.scenario.space)
        links = self._link_matrix(pairs) if self._keeps_links and pairs is not None else None
        self.records.frame(t, q, p, links, observed=observed, columns=columns_of(self.scenario, rows))

    def _linked_pairs(self, velocities: Reals | None = None) -> Numbers | None:
        """Numbers of the linked ordered pairs under the law's graph, shape (K, 2), on the first rank.

        Velocities are those of the agents here, shape (m, size); those of the last step when absent.
        """
        particles = self._particles
        lists, by_state = particles.lists[0], particles.radii.follow_state(0)
        assert lists is not None
        i, j = listed_pairs(lists, particles.n, linked=not by_state)
        if by_state:
            particles.turn_views()
            q = particles.X[: particles.m]
            apart = self.scenario.space.displacement((q[:, j] - q[:, i]).T)
            p = particles.X[particles.m :] if velocities is None else velocities
            near = particles.radii.linked(0, i, apart, p)
            i, j = i[near], j[near]
        pairs = np.stack([particles.ids[i], particles.ids[j]], axis=1).astype(np.float64)
        found = self.ranks.gathered(pairs)
        return None if found is None else found.astype(np.int64)

    def _link_matrix(self, pairs: Numbers) -> Links:
        n = self.scenario.start.n
        links = np.zeros((n, n), dtype=bool)
        links[pairs[:, 0], pairs[:, 1]] = True
        return links

    def _add_ledger_row(self) -> None:
        super()._add_ledger_row()
        if not self.ranks.first:
            # The first rank writes all rows.
            del self.records.trace[:-1]

    # --- states ---

    def gathered_state(self) -> State | None:
        """The state on the first rank, None elsewhere."""
        particles = self._particles
        velocities = self._guarded(lambda: self._integrator.look(particles, self.time, self.step))
        rows = self._gathered(velocities)
        pairs = self._linked_pairs(velocities) if self.scenario.start.n <= MOST_LINKED else None
        if rows is None:
            return None
        m, links = particles.m, None if pairs is None else self._link_matrix(pairs)
        return State(rows[:, :m], rows[:, m : 2 * m], self.time, links, columns_of(self.scenario, rows))

    @property
    def state(self) -> State:
        """State at the session's time, on every rank."""
        found = self.ranks.comm.bcast(self.gathered_state())
        return State(found.q, found.p, found.t, found.links, found.columns)

    def _look(self) -> tuple[Positions, Velocities]:
        state = self.state
        return state.q, state.p

    def accelerations(self) -> Array:
        """Current acceleration (order 1: velocity) of every agent, shape (N, m), on every rank."""
        particles = self._particles
        velocities = self._guarded(lambda: self._integrator.look(particles, self.time, self.step))
        rates = particles.rates(self.time, velocities)
        found: Array = self.ranks.comm.bcast(particles.gathered(rates[:, : particles.n].T))
        return found

    # --- checkpoints ---

    def _packed_links(self) -> list[LinkRows] | None:
        """Links of the graphs with memory, on the first rank; None before there are lists."""
        particles = self._particles
        tables = particles.tables()
        if tables is None:
            return None
        found = []
        for table in tables:
            counts = np.count_nonzero(table, axis=1)
            sensing = np.repeat(particles.ids[: particles.n], counts)
            pairs = self.ranks.gathered(np.stack([sensing, table[table > 0] - 1], axis=1).astype(np.float64))
            found.append(link_rows(np.zeros((0, 2)) if pairs is None else pairs, self.scenario.start.n))
        return found

    def pack(self) -> Packed:
        """The packed state on the first rank; empty elsewhere. Collective."""
        with self.ranks.bound():
            particles = self._particles
            n, m = particles.n, particles.m
            rows = particles.gathered(
                np.concatenate([particles.agents[:n], particles.body_rows.further[:, :n].T], axis=1)
            )
            links = self._packed_links()
        if rows is None:
            return {}, {}
        fields: dict[str, object] = {
            "q": np.ascontiguousarray(rows[:, :m]), "p": np.ascontiguousarray(rows[:, m : 2 * m]), "links": links,
        }  # fmt: skip
        if rows.shape[1] > 2 * m:
            fields["columns"] = np.ascontiguousarray(rows[:, 2 * m :])
        return pack_tiles(
            TilesSnapshot(
                self.scenario, self.options, self.step, self.time, self._plan, ParticleMemory(fields),
                self._integrator.memory(), self.records, self.steps, self.farthest, replace(self.law_gaps),
                Instability(), self.plant,
            )
        )  # fmt: skip

    @classmethod
    def unpack(cls, packed: Packed, stored: Stored, changes: Mapping[str, object]) -> DomainSession:
        """Restore a session from its packed form, on any number of ranks; all get the same arguments."""
        numbers, arrays = packed
        session = cls.__new__(cls)
        session.ranks = Ranks(library.communicator())
        session.scenario, session.plant = stored.scenario, stored.plant
        session.options = stored_options(numbers["options"])
        threads = changes.get("threads")
        session.workers = Workers(threads if isinstance(threads, int) else session.options.threads)
        spec = session._spec(stored.scenario)
        memory = unpacked(
            numbers, arrays, stored.scenario, sum(k.memory and not k.fixed for k in spec.graphs)
        )  # fmt: skip
        options = session.options
        session.records = TilesRecorder(
            stored.scenario, options.precision, keep_frames=options.keep_frames, observe=options.observe
        )
        # The first rank alone has records on disk.
        counts = stored.counts if session.ranks.first else dict.fromkeys(stored.counts, 0)
        session.records.recall_memory(memory["records"], counts, stored.read)
        session._integrator = integrator_named(session.scheme, spec)
        session._integrator.recall(memory["scheme"])
        stored_agents = memory["crowd"].fields
        q, p, links = stored_agents["q"], stored_agents["p"], stored_agents["links"]
        assert isinstance(q, np.ndarray)
        assert isinstance(p, np.ndarray)
        session._tables = None if links is None else [link_tables(rows) for rows in links]  # type: ignore[attr-defined]
        start, more = stored.scenario.start, stored_agents.get("columns", np.zeros((len(q), 0)))
        columns = columns_of(stored.scenario, np.concatenate([q, p, more], axis=1))
        with session.ranks.bound():
            state = State(q, p, memory["time"], start.links if links is None else None, columns)
            session._particles = session._new_particles(stored.scenario, state)  # type: ignore[assignment]
        session._tables = None
        session.time, session.steps, session.step = memory["time"], memory["steps"], memory["step"]
        session._plan, session.farthest, session.law_gaps = memory["plan"], memory["farthest"], memory["law_gaps"]
        session._particles.pass_switch_time(session.scenario, memory["plan"][0])
        return session

    def replace(self, *, law: Law | None = None, state: State | None = None) -> None:
        """Raise an error: nothing is replaced on many processes."""
        raise UnsupportedLaw(
            "engine='lammps' cannot replace a law or a state during a run. Use engine='tiles' or 'exact', or start a "
            "new session from the session's state."
        )

    def moment(self) -> Callable[[], Session]:
        """A function that opens a session in the current state of this one."""
        return Session.moment(self)

    @property
    def about(self) -> dict[str, object]:
        """Entries of the run's provenance."""
        return super().about | library.versions() | {
            "forces": "kernels", "ranks": self.ranks.size, "threads": self.workers.threads,
        }  # fmt: skip

    def close(self) -> None:
        """Release the memory of LAMMPS, the requests of messages, and the threads."""
        self._particles.close()
        self.workers.close()
