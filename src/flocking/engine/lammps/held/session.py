"""Session under held control on any number of MPI ranks; all methods are collective."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from flocking.arrays import AnyArray, Array, Numbers32
from flocking.engine import interruption
from flocking.engine.archives.data_checks import MalformedError
from flocking.engine.lammps import library
from flocking.engine.lammps.domains.checkpoint import columns_of, link_tables, stored_options
from flocking.engine.lammps.domains.options import DomainOptions
from flocking.engine.lammps.domains.session import INTERRUPTED, TIME_IS_OVER, DomainSession
from flocking.engine.lammps.held.checkpoint import Carried, HeldRankFields, pack_held_ranks, unpacked
from flocking.engine.lammps.held.particles import HeldRankParticles
from flocking.engine.lammps.ranks import Ranks
from flocking.engine.protocol.session import Packed, Stored, end_of_slice, time_to_reach
from flocking.engine.runs.recorder import MOST_LINKED
from flocking.engine.tiles.held.held_ledger import HeldLedger
from flocking.engine.tiles.held.session import HeldTilesSession
from flocking.engine.tiles.held.true_state import ON_STEP
from flocking.engine.tiles.kernels.control_kernel import control_spec
from flocking.engine.tiles.options import TilesOptions
from flocking.errors import SimulationError, UnsupportedLaw
from flocking.model.law import Law, Scenario
from flocking.model.state import State
from flocking.model.world.times import NANOSECOND


class HeldDomainSession(DomainSession, HeldTilesSession):
    """Session under held control, each rank with the agents of a domain of space.

    Samples, messages, controls and the ledger are those of the tiled engine. Draws are functions of seed, agents and
    numbers of samples, so that ranks agree without messages of their own.

    Parameters
    ----------
    scenario
        The scenario to simulate; the same on all ranks.
    options
        Options of the engine.

    Raises
    ------
    UnsupportedLaw
        If a part of the scenario is not supported.
    InvalidInput
        If a time of the world is no whole number of steps.
    EngineMissing
        If LAMMPS or MPI is not installed.
    TooCrowded
        If the neighbour lists would not fit in memory.
    """

    keeps_log = False
    _particles: HeldRankParticles
    _begin: State | None = None

    def __init__(self, scenario: Scenario, options: DomainOptions) -> None:
        self.ranks = Ranks(library.communicator())
        self._tables: list[Numbers32] | None = None
        with self.ranks.bound():
            HeldTilesSession.__init__(self, scenario, options)

    def _set_up(self, scenario: Scenario, options: TilesOptions, threads: int | None = None) -> None:
        super()._set_up(scenario, options, threads)
        self._particles.waiting = self._memory.waiting

    def _new_particles(self, scenario: Scenario, state: State) -> HeldRankParticles:
        options = self.options
        return HeldRankParticles(
            scenario, self._begin or state, self._spec(scenario), self.workers, self._lists_limit, options.skin,
            ranks=self.ranks, log=options.keep_log or "none", tables=self._tables,
        )  # fmt: skip

    def _automatic_step(self) -> float:
        """The longest step that the tiled engine would choose, found by the first rank."""
        if not self._follows:
            return math.inf
        options = TilesOptions(precision=self.options.precision, ledger=self.options.ledger)
        return self.ranks.shared(lambda: HeldTilesSession.longest_step(self.scenario, options))

    # --- steps ---

    def advance(self, to: float, seconds: float = math.inf) -> None:
        """Take steps until time ``to``, or for ``seconds`` of wall time; frames lie anywhere between.

        The first rank decides for all when the time is over, and whether Ctrl-C was pressed.
        """
        to = time_to_reach("DomainSession", to, self.time, self.step * ON_STEP)
        stop, particles = end_of_slice("DomainSession", seconds), self._particles
        try:
            with self.ranks.bound():
                while self._reaches_next(to):
                    particles.notice = self._noticed(stop)
                    self._take_step()
                    if particles.noticed == INTERRUPTED:
                        interruption.check()
                        raise interruption.Noted
                    if particles.noticed == TIME_IS_OVER:
                        return
                self._go_on_to(to)
        except SimulationError as error:
            error.run = self.run(str(error))
            raise

    def _add_row(self, seconds: float) -> None:
        super()._add_row(seconds)
        if not self.ranks.first:
            # The first rank writes all rows.
            del self.records.trace[:-1]

    # --- states ---

    def _frame(self, t: float, offset: float) -> None:
        options = self.options
        rows: Array | None = None
        pairs = None
        if self._shares is not None:
            with self._moved_by(offset):
                own = self._own_rows()
            self._keep_part(self._shares, t, own)
            return
        if options.keep_frames or options.observe:
            with self._moved_by(offset):
                rows = self._gathered_rows()
                pairs = self._linked_pairs() if options.observe or self._keeps_links else None
        self.ranks.alone(lambda: self._write_frame(t, rows, pairs))
        if not self.ranks.first:
            self.records.skip()

    def _gathered_rows(self) -> Array | None:
        """Positions, velocities and further columns of all agents in order, on the first rank.

        Agents of order 1 have no velocities.
        """
        return self._particles.gathered(self._own_rows())

    def _own_rows(self) -> AnyArray:
        """The same of the agents here."""
        particles = self._particles
        n, m, actuation = particles.n, particles.m, particles.actuation
        further = np.zeros((n, 0)) if actuation is None else actuation.further(n)
        rows = np.concatenate([particles.agents[:n], further], axis=1)
        if self.scenario.agents.order == 1:
            rows[:, m : 2 * m] = 0.0
        return rows

    def gathered_state(self) -> State | None:
        """The state on the first rank, None elsewhere."""
        with self._moved_by(self._offset()):
            rows = self._gathered_rows()
            pairs = self._linked_pairs() if self.scenario.start.n <= MOST_LINKED else None
        if rows is None:
            return None
        m = self._particles.m
        links = None if pairs is None else self._link_matrix(pairs)
        return State(rows[:, :m], rows[:, m : 2 * m], self.time, links, columns_of(self.scenario, rows))

    def accelerations(self) -> Array:
        """Rates of change of the velocities, shape (N, m), on every rank; of agents of order 1 their velocities."""
        particles, body = self._particles, self.scenario.agents
        with self._moved_by(self._offset()):
            force: Array = self.ranks.comm.bcast(particles.gathered(particles.seen_force[:, : particles.n].T))
        if body.order == 1:
            return force
        n = self.scenario.start.n
        masses, damping = (
            np.broadcast_to(np.asarray(x, dtype=np.float64), n)[:, None] for x in (body.masses, body.damping)
        )
        return np.asarray((force - damping * self.state.p) / masses)

    # --- checkpoints ---

    def pack(self) -> Packed:
        """The packed state on the first rank; empty elsewhere. Collective."""
        with self.ranks.bound():
            particles = self._particles
            rows = particles.gathered(np.concatenate([particles.agents[: particles.n], particles.columns()], axis=1))
            links = self._packed_links()
        if rows is None:
            return {}, {}
        return pack_held_ranks(self._memory, Carried(rows, links))

    @classmethod
    def unpack(cls, packed: Packed, stored: Stored, changes: Mapping[str, object]) -> HeldDomainSession:
        """Restore a session from its packed form, on any number of ranks; all get the same arguments."""
        numbers, arrays = packed
        session = cls.__new__(cls)
        session.ranks = Ranks(library.communicator())
        session.options = stored_options(numbers["options"])
        threads = changes.get("threads")
        scenario = stored.scenario
        spec = session._spec(scenario)
        kinds = (*spec.graphs, *control_spec(spec, scenario.law.graphs).graphs)
        found = unpacked(numbers, arrays, scenario, sum(kind.memory and not kind.fixed for kind in kinds))
        m, links = scenario.start.dimension, found["links"]
        rows = found["rows"]
        known_links = scenario.start.links if links is None else None
        session._begin = State(rows[:, :m].copy(), rows[:, m : 2 * m].copy(), scenario.start.t, known_links)
        session._tables = None if links is None else [link_tables(each) for each in links]
        with session.ranks.bound():
            session._set_up(scenario, session.options, threads if isinstance(threads, int) else None)
            session._recall(found, stored)
        session._begin = session._tables = None
        return session

    def _recall(self, found: HeldRankFields, stored: Stored) -> None:
        """Go on from a checkpoint, at the start of a session."""
        particles, memory, scenario = self._particles, self._memory, stored.scenario
        m, n, store = particles.m, particles.n, particles.store
        nobody = np.zeros(0, np.int64)
        memory.waiting[:] = [(when, nobody, np.zeros((0, m), particles.dtype)) for when in found["waiting"]]
        rows = found["rows"]
        if rows.shape[1] != 2 * m + particles.width or (store is None) != (found["samples"] is None):
            raise MalformedError("session: rows must hold forces and samples of this scenario")
        if not particles.well_formed(rows[:, 2 * m :]):
            raise MalformedError("session: rows must be finite, but for forces")
        if scenario.agents.order == 1:
            particles.agents[:n, m:] = rows[particles.ids[:n], m : 2 * m]
            particles._fill_pads()
        if particles.actuation is not None:
            particles.actuation.take_gusts(found["steps"] * found["step_length"], particles.ids[: particles.size])
        particles.hold_columns(rows[particles.ids, 2 * m :])
        if store is not None and found["samples"] is not None:
            off, speeds = found["samples"]
            if off.shape != store.off.shape:
                raise MalformedError("session: samples must have a deviation for each place")
            store.off, store.speeds.rows = off.copy(), speeds.tolist()
        memory.step_length, memory.steps, memory.acted = found["step_length"], found["steps"], found["acted"]
        memory.time, memory.looked, memory.farthest = found["time"], found["looked"], found["farthest"]
        memory.ledger_ends, memory.ledger = found["ledger_ends"], HeldLedger.restored(found["ledger"])
        # The first rank alone has records on disk.
        counts = stored.counts if self.ranks.first else dict.fromkeys(stored.counts, 0)
        self.records.recall_memory(found["records"], counts, stored.read)
        # Gains change before the controls of the same time.
        share = ON_STEP if memory.acted else -ON_STEP
        t = scenario.start.t + self._now * NANOSECOND + share * self.step
        particles.pass_switch_time(scenario, max(t, scenario.start.t))

    def replace(self, *, law: Law | None = None, state: State | None = None) -> None:
        """Raise an error: forces that are held belong to the past of this run."""
        raise UnsupportedLaw(
            "engine='lammps' replaces neither law nor state under held control. Start another run from run.state(-1)."
        )
