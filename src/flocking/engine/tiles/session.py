"""Session of the tiled engine: advance, evaluate, snapshot, resume, replace."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cached_property, partial
from typing import TypeVar

import numpy as np

from flocking.arrays import Array, Links, Positions, Velocities
from flocking.engine import interruption
from flocking.engine.fixed_step.certain_pairs import too_crowded
from flocking.engine.fixed_step.given_links import check_given_links
from flocking.engine.fixed_step.law_gaps import LawGaps, is_due
from flocking.engine.fixed_step.passing_pairs import singular_reach
from flocking.engine.fixed_step.step_checks import ledger_rule, step_too_large
from flocking.engine.fixed_step.step_counts import is_reached, steps_between
from flocking.engine.fixed_step.threads import Workers
from flocking.engine.kernels.layout import Layout
from flocking.engine.protocol.session import Packed, Session, Stored, end_of_slice, time_to_reach
from flocking.engine.protocol.world import check_world
from flocking.engine.reference.infinite_starts import infinite_start
from flocking.engine.runs.fidelity import Approaches, Fidelity
from flocking.engine.runs.recorder import MOST_LINKED
from flocking.engine.tiles import automatic_step, checks
from flocking.engine.tiles.checkpoint import pack_tiles, restore_tiles
from flocking.engine.tiles.instability import Instability
from flocking.engine.tiles.integrators import Euler, Integrator, Verlet, integrator_named
from flocking.engine.tiles.kernels.spec import KernelSpec, check_supported, graph_kinds, integrator_of
from flocking.engine.tiles.law_check import LawCheck, Moment
from flocking.engine.tiles.neighbours.listed_pairs import listed_pairs
from flocking.engine.tiles.neighbours.neighbour_lists import TooManyNeighboursError
from flocking.engine.tiles.options import TilesOptions as TilesOptions
from flocking.engine.tiles.particle_memory import ParticleMemory
from flocking.engine.tiles.particles.law_parameters import next_gust
from flocking.engine.tiles.particles.particle_arrays import ParticleArrays
from flocking.engine.tiles.planted_law import Planted, check_planted
from flocking.engine.tiles.records import TilesRecorder
from flocking.engine.tiles.snapshot import TilesSnapshot as TilesSnapshot
from flocking.errors import InvalidInput, NotFinite, SimulationError
from flocking.model.law import Law, Scenario
from flocking.model.state import State

STEPS_BEYOND = 1000
"""Number of steps to the next stop after the end of the scenario."""
MOST_STEPS = 1e12
"""Largest number of steps of a run: eleven days at a microsecond per step; a larger number is probably a mistake."""
Result = TypeVar("Result")


class TilesSession(Session):
    """Session of the tiled engine. Its time is always the end of a step.

    Parameters
    ----------
    scenario
        The scenario to simulate.
    options
        Options of the engine.
    plant
        The law that agents follow, over the graphs of the scenario's law. The ledger uses the declared law.

    Raises
    ------
    UnsupportedLaw
        If a part of the scenario is not supported.
    InvalidInput
        If the frames would not fit in memory.
    TooCrowded
        If the neighbour lists would not fit in memory.
    """

    engine = "tiles"
    saves_when_interrupted = True
    records: TilesRecorder
    options: TilesOptions

    def __init__(self, scenario: Scenario, options: TilesOptions | None = None, *, plant: Law | None = None) -> None:
        check_world(self.engine, scenario)
        check_supported(scenario)
        if plant is not None:
            check_planted(scenario, plant)
        self.scenario, self.options = scenario, (options or TilesOptions()).of_body(scenario.agents)
        self.plant = plant
        self.time, self.steps = scenario.start.t, 0
        self.workers = Workers(self.options.threads)
        self.records = TilesRecorder(
            scenario, self.options.precision, keep_frames=self.options.keep_frames, observe=self.options.observe
        )
        self.farthest = 0.0
        self.law_gaps, self.instability = LawGaps(), Instability()
        self._particles = self._new_particles(scenario, scenario.start)
        self._integrator: Integrator = integrator_named(self.scheme, self._particles.spec)
        checks.resolution(self._particles, scenario.start.q, self.time)
        self._set_going()
        self.step, span = self.options.step or self._automatic_step(), scenario.t_end - scenario.start.t
        self.step = min(self.step, span) if span > 0 else self.step
        if span > MOST_STEPS * self.step:
            raise InvalidInput(
                "TilesSession", "step", f"must reach the end in {MOST_STEPS:.0e} steps", self.step, "Give a longer one."
            )
        self._plan = (self.time, self.time, 1, 1)
        self._record()

    @property
    def scheme(self) -> str:
        """Name of the integrator."""
        return integrator_of(self.options.scheme, self.scenario.agents.order)

    def _spec(self, scenario: Scenario) -> KernelSpec:
        agents, options = scenario.agents, self.options
        layout = Layout(scenario.law, scenario.energy, agents, scenario.space)
        return KernelSpec(
            layout, scenario.start.dimension, options.precision, graph_kinds(scenario, options.ledger),
            layout.weight_kinds(), np.ndim(agents.masses) > 0, np.ndim(agents.damping) > 0, self.scheme == "damped",
            options.ledger,
        )  # fmt: skip

    def _new_particles(self, scenario: Scenario, state: State) -> ParticleArrays:
        spec = self._spec(scenario)
        particles = ParticleArrays(scenario, state, spec, self.workers, self.options.lists_limit, self.options.skin)
        if self.plant is not None:
            particles.kernels.planted = Planted(scenario, self.plant, spec)
            particles.kernels.planted.pass_switch_time(state.t)
        return particles

    def _set_going(self) -> None:
        """Initialize the velocities of agents of order 1; their changes are used to detect instability."""
        if self.scenario.agents.order == 1:
            self._guarded(lambda: self._particles.require_lists(0.0))
            self._particles.take_velocities(self.time)

    def _automatic_step(self) -> float:
        self._guarded(lambda: self._particles.require_lists(0.0))
        return automatic_step.choose(self._particles, self.scenario, self.scheme)

    def _resolving_step(self) -> float:
        """The largest step that resolves the forces at the start."""
        return automatic_step.resolves(self._particles, self.scenario, self.scheme)

    @cached_property
    def singular_reach(self) -> float | None:
        """Shortest radius of a potential that diverges at contact; None if there is none."""
        law = self.scenario.law
        return singular_reach(law) if law.singular_at_zero() else None

    @cached_property
    def _law_check(self) -> LawCheck:
        motion = isinstance(self._integrator, Verlet | Euler) and not self._particles.spec.damped
        return LawCheck(self.scenario, self._particles.dtype, motion=motion, refuses=self.plant is None)

    @property
    def memory_in_use(self) -> int:
        """Memory of the session's arrays in bytes."""
        return self._particles.nbytes

    @property
    def rebuilds(self) -> int:
        """Number of rebuilds of the neighbour lists."""
        return self._particles.search.rebuilds

    @property
    def state(self) -> State:
        """State at the session's time; includes the link matrix for at most 2,000 agents."""
        q, p = self._look()
        return State(q, p, self.time, self._links(p), self._particles.columns_in_order)

    def _look(self) -> tuple[Positions, Velocities]:
        particles = self._particles
        velocities = self._guarded(lambda: self._integrator.look(particles, self.time, self.step))
        return particles.in_order(particles.X[: particles.m]), particles.in_order(velocities)

    def _links(self, velocities: Velocities) -> Links | None:
        """Links of the law's graph, of agents with these velocities; None for more than `MOST_LINKED`."""
        n, lists = self.scenario.start.n, self._particles.lists[0]
        if n > MOST_LINKED or lists is None:
            return None
        by_state = self._particles.radii.follow_state(0)
        i, j = listed_pairs(lists, n, linked=not by_state)
        if by_state:
            self._particles.turn_views()
            q, p = self._particles.X[: self._particles.m], velocities[self._particles.ids].T
            near = self._particles.radii.linked(0, i, self.scenario.space.displacement((q[:, j] - q[:, i]).T), p)
            i, j = i[near], j[near]
        links = np.zeros((n, n), dtype=bool)
        links[self._particles.ids[i], self._particles.ids[j]] = True
        return links

    def accelerations(self) -> Array:
        """Current acceleration (order 1: velocity) of every agent, shape (N, m), by the links of now."""
        particles = self._particles
        velocities = self._guarded(lambda: self._integrator.look(particles, self.time, self.step))
        return particles.in_order(particles.rates(self.time, velocities))

    def _guarded(self, action: Callable[[], Result]) -> Result:
        """Call a function that may rebuild lists; raises TooCrowded if they do not fit."""
        try:
            return action()
        except TooManyNeighboursError as error:
            fix = "Spread the agents, shorten the radius or raise memory_limit."
            raise too_crowded(error.bytes_needed, self.options.lists_limit, self.time, fix) from None

    def _next_stop(self) -> float:
        """Next time at which a step must end: a frame, a jump of a force, or the end."""
        now = self.time
        times = [self.scenario.t_end] * (now < self.scenario.t_end)
        times += [float(t) for t in self.scenario.frame_times if t > now][:1]
        for term in self.scenario.law.body_terms:
            times += [s for s in term.switch_times(now, np.inf) if s > now]
        times += [t for t in (next_gust(self.scenario, now),) if now < t < np.inf]
        return min(times, default=now + STEPS_BEYOND * self.step)

    def reached(self, to: float) -> bool:
        """Whether time ``to`` is reached, up to the rounding of a step."""
        return is_reached(self.time, to, self.step)

    def advance(self, to: float, seconds: float = np.inf) -> None:
        """Take steps until the session's time is at or just beyond ``to``, or for ``seconds`` of wall time."""
        to = time_to_reach("TilesSession", to, self.time, self.step)
        stop = end_of_slice("TilesSession", seconds)
        try:
            while not self.reached(to):
                interruption.check()
                self._take_step()
                self._record()
                if time.monotonic() >= stop:
                    return
        except SimulationError as error:
            error.run = self.run(str(error))
            raise

    def _take_step(self) -> None:
        start, end, count, index = self._plan
        if index >= count:
            last_start, start, end = start, self.time, self._next_stop()
            change = self._integrator.change_gains
            self._guarded(partial(change, self._particles, self.scenario, last_start, start, self.step))
            count, index = steps_between(start, end, self.step), 0
        h = (end - start) / count
        particles, last = self._particles, self._integrator.last
        self._plan, moment = (start, end, count, index), Moment(self.time, start, self.steps)
        resolves = np.inf
        if not (self.steps or self.options.ledger):
            self._guarded(lambda: particles.require_lists(h))
            resolves = self._resolving_step()
        law_checked = self.options.ledger and is_due(self.steps + 1)
        try:
            if law_checked:
                if not self._law_check.motion:
                    self._guarded(lambda: particles.require_lists(h))
                particles.agree(lambda: self._law_check.before_step(particles, moment, self.law_gaps))
            self._guarded(lambda: self._integrator.step(particles, self.time, h))
        except FloatingPointError:
            why = "agents move beyond the reach of their neighbour lists in one step"
            raise step_too_large(self.step, h, why, time=self.time) from None
        checks.after_step(particles, h, self.records, self.step, self.time, self.singular_reach)
        checks.stiff_start(self.step, resolves, self.scheme, particles.spec.order, self.time)
        if law_checked:
            particles.agree(lambda: self._law_check.after_step(particles, 0.5 * (last + h), h, moment, self.law_gaps))
        if not self.options.ledger:
            self.instability.look(
                particles, self.steps, h, self.step, self.time, alternating=self.scheme in ("verlet", "euler")
            )  # fmt: skip
        self.farthest = max(self.farthest, 2.0 * particles.top_speed * h)
        if self.options.ledger:
            self._add_ledger_row()
        self.steps += 1
        self._plan = (start, end, count, index + 1)
        self.time = end if index + 1 == count else start + (end - start) * (index + 1) / count

    def _record(self) -> None:
        """Store a frame if one is due."""
        if not self.records.due(self.time):
            return
        if not (self.options.keep_frames or self.options.observe):
            self._guarded(lambda: self._integrator.look(self._particles, self.time, self.step))
            checks.links_stay(self._particles, self.step, self.time)
            checks.look_at_closest(self._particles, self.records, self.time)
            self._update_ledger()
            self.records.skip()
            return
        q, p = self._look()
        if not (np.isfinite(q).all() and np.isfinite(p).all()):
            raise NotFinite("The state became infinite or NaN.", time=self.time)
        checks.links_stay(self._particles, self.step, self.time)
        checks.resolution(self._particles, q, self.time)
        checks.look_at_closest(self._particles, self.records, self.time)
        self._update_ledger()
        observed = None
        if self.options.observe:
            from flocking.engine.tiles.observables import observe

            observed = observe(self._particles, self.time, p)
        columns = self._particles.columns_in_order
        self.records.frame(self.time, q, p, self._links(p), observed=observed, columns=columns)

    def _add_ledger_row(self) -> None:
        unlinked = self.scenario.energy.unlinked
        self.records.add_ledger_row(self.time, self._integrator.ledger_sums, self.scenario.start.n, unlinked)

    def _update_ledger(self) -> None:
        """Update the ledger, and check the step by its residual."""
        if self.options.ledger:
            self._add_ledger_row()
            if not self.steps and not np.isfinite(self.records.trace[-1][1]):
                energy, start = self.records.trace[-1][1], self.scenario.start
                raise infinite_start(self.scenario, start, energy, self.options.precision)
            checks.ledger(self.records, self._integrator, self._particles, self._law_check, self.step, self.time)

    def snapshot(self, *, copied: bool = True) -> TilesSnapshot:
        """Everything needed to continue bit for bit; if not ``copied``, valid only until the session continues."""
        return TilesSnapshot(
            self.scenario, self.options, self.step, self.time, self._plan,
            ParticleMemory.of(self._particles, copied=copied),
            self._integrator.memory(),
            self.records.copy() if copied else self.records, self.steps, self.farthest,
            replace(self.law_gaps), self.instability.copy(), self.plant,
        )  # fmt: skip

    @classmethod
    def resume(cls, snapshot: TilesSnapshot, *, threads: int | None = None) -> TilesSession:
        """A session that continues a snapshot bit for bit, with any number of threads."""
        session = cls.__new__(cls)
        session.scenario, session.options, session.plant = snapshot.scenario, snapshot.options, snapshot.plant
        session.workers, session.law_gaps = Workers(threads or snapshot.options.threads), replace(snapshot.law_gaps)
        session._particles = session._new_particles(snapshot.scenario, snapshot.scenario.start)
        session._integrator = integrator_named(session.scheme, session._particles.spec)
        snapshot.particles.put_back(session._particles)
        session._integrator.recall(snapshot.scheme)
        session.time, session.steps, session.step = snapshot.time, snapshot.steps, snapshot.step
        session.records, session._plan = snapshot.records.copy(), snapshot.plan
        session.farthest, session.instability = snapshot.farthest, snapshot.instability.copy()
        # The planned steps use the values that scheduled gains had when they were planned.
        session._particles.pass_switch_time(session.scenario, snapshot.plan[0])
        return session

    def replace(self, *, law: Law | None = None, state: State | None = None) -> None:
        """Replace the law or the state from the session's time on.

        Links are kept if graphs have the same kinds and no state is given. The ledger records a jump of the energy.

        Raises
        ------
        InvalidInput
            If law and state do not fit together.
        UnsupportedLaw
            If this engine cannot run the law.
        """
        particles = self._particles
        if self.plant is not None:
            raise InvalidInput("TilesSession", "law", "cannot be replaced when agents follow a plant", law)
        velocities = self._guarded(lambda: self._integrator.look(particles, self.time, self.step))
        before = self._energy()
        scenario = self.scenario.with_(law=law or self.scenario.law, t_end=max(self.scenario.t_end, self.time))
        check_supported(scenario)
        scenario.law.check_count(particles.n, particles.m)
        if state is None and (spec := self._spec(scenario)).graphs == particles.spec.graphs:
            if self.scenario.agents.order == 2:
                particles.X[particles.m :] = velocities
            self._guarded(lambda: particles.adopt(scenario, spec, self.time))
        else:
            if state is None:
                q, p = particles.in_order(particles.X[: particles.m]), particles.in_order(velocities)
                state = State(q, p, self.time, columns=particles.columns_in_order)
            elif state.q.shape != self.scenario.start.q.shape:
                raise InvalidInput("TilesSession", "state", "must keep the number of agents", state.q.shape)
            check_given_links(self.engine, scenario, state)
            self._particles = self._new_particles(scenario, replace(state, t=self.time))
            self._set_going()
        self.scenario = scenario
        for name in ("_law_check", "singular_reach"):
            self.__dict__.pop(name, None)
        self._integrator.last, self._integrator.counted, self._plan = 0.0, True, (self.time, self.time, 1, 1)
        self.records.note_replacement(self.time)
        if self.options.ledger:
            jumped = self._integrator.ledger_sums.jumped
            self._look()
            self._integrator.ledger_sums.jumped = jumped + self._energy() - before
            self._add_ledger_row()

    def _energy(self) -> float:
        return sum(self._integrator.ledger_sums.sums.get(name, 0.0) for name in ("pairs", "bodies", "kinetic"))

    def moment(self) -> Callable[[], Session]:
        """A function that opens a session in the current state of this one."""
        return partial(TilesSession.resume, self.snapshot())

    def pack(self) -> Packed:
        """Everything needed to continue bit for bit, without the scenario and the records on disk."""
        return pack_tiles(self.snapshot(copied=False))

    @classmethod
    def unpack(cls, packed: Packed, stored: Stored, changes: Mapping[str, object]) -> TilesSession:
        """Restore a session from its packed form, with another number of ``threads`` if ``changes`` contains it."""
        threads = changes.get("threads")
        return cls.resume(restore_tiles(*packed, stored), threads=threads if isinstance(threads, int) else None)

    @property
    def about(self) -> dict[str, object]:
        """Entries of the run's provenance."""
        o = self.options
        return super().about | {
            "step": self.step, "scheme": self.scheme, "precision": o.precision,
            "rebuilds": self._particles.search.rebuilds, "switches": "not recorded", "farthest": self.farthest,
            **(self.law_gaps.about if o.ledger else {}), **self.records.replacements,
        }  # fmt: skip

    @property
    def fidelity(self) -> Fidelity:
        """Steps are fixed, switches are not located, and linked pairs are checked once per step."""
        return Fidelity(
            self.engine, approaches=Approaches("linked", self.farthest), ledger=ledger_rule(self.records),
            fixed_step=self.step, law=self.law_gaps.agreement if self.options.ledger else None,
            changed=bool(self.records.replaced_at),
        )  # fmt: skip
